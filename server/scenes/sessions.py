"""Browser sessions with 3D panes: which job each shows, at which moment, and where its panes are found."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import secrets
from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import Any

import numpy as np

from server import artifacts
from server.jobs import Jobs
from server.problems import Refusal
from server.scenes import ensemble, graph, palette, pursuit, sound
from server.scenes.cameras import ABOVE, OBLIQUE, Cameras
from server.scenes.footage import Footage, at, footage
from server.scenes.geometry import Chart, chart
from server.scenes.options import Options
from server.scenes.pane import Pane
from server.settings import Settings

log = logging.getLogger(__name__)

#: Cameras stay within this distance (scene units).
FARTHEST = 500.0
#: The pane that shows all algorithms laid over each other.
OVERLAY = "overlay"

BROKEN = "the 3D panes could not be drawn; the server's log says why"

Send = Callable[[dict[str, Any]], Awaitable[None]]


class Sessions:
    """All sessions of the server, and the panes by the secret ids in their paths."""

    def __init__(self, settings: Settings, jobs: Jobs) -> None:
        self.settings, self.jobs = settings, jobs
        self.panes: dict[str, Pane] = {}
        self._opening = 0
        self._open: set[Session] = set()

    def open(self, send: Send) -> Session:
        """A new session that answers through `send`."""
        session = Session(self, send)
        self._open.add(session)
        return session

    async def shut(self, session: Session) -> None:
        """End a session and its panes."""
        self._open.discard(session)
        await session.close()

    async def close(self) -> None:
        """End all sessions."""
        for session in list(self._open):
            await self.shut(session)

    async def add(self, count: int) -> list[tuple[str, Pane]]:
        """New panes under secret ids, all of them; Refusal where that is too many."""
        if len(self.panes) + self._opening + count > self.settings.panes_altogether:
            raise Refusal(429, "panes", "too many 3D panes are open on this server; close some")
        self._opening += count
        opened: dict[str, Pane] = {}
        try:
            for _ in range(count):
                opened[secrets.token_urlsafe(18)] = await asyncio.to_thread(Pane)
        except BaseException:
            for pane in opened.values():
                await asyncio.to_thread(pane.close)
            raise
        finally:
            self._opening -= count
        self.panes |= opened
        return list(opened.items())

    async def remove(self, id: str) -> None:
        pane = self.panes.pop(id, None)
        if pane is not None:
            await asyncio.to_thread(pane.close)


class Session:
    """One browser session: takes its messages, keeps its panes drawn; the newest moment asked for wins."""

    def __init__(self, sessions: Sessions, send: Send) -> None:
        self._sessions, self._send = sessions, send
        self._panes: dict[str, tuple[str, Pane]] = {}
        self._cameras = Cameras(asyncio.get_running_loop(), self._tell_camera)
        self._telling: set[asyncio.Task[None]] = set()
        self._job: str | None = None
        self._ensembles: dict[str, ensemble.Ensemble] | None = None
        self._options = Options()
        self._footage: Footage | None = None
        self._chart: Chart | None = None
        self._moment: float | None = None
        self._followed: np.ndarray | None = None
        self._stale = asyncio.Event()
        self._drawing = asyncio.Lock()
        self._painter = asyncio.create_task(self._paint())
        self._following: asyncio.Task[None] | None = None

    async def take(self, text: str) -> None:
        """Act on a message of the browser; what is wrong with it is told, not raised."""
        try:
            message = json.loads(text)
            if not isinstance(message, dict) or "type" not in message:
                raise ValueError("a message is an object with a type")
            kind = message["type"]
            if kind == "show":
                await self._show(str(message["job"]), [str(name) for name in message["panes"]])
            elif kind == "seek":
                self._seek(float(message["time_s"]))
            elif kind == "options":
                await self._choose({k: v for k, v in message.items() if k != "type"})
            elif kind == "camera":
                self._look([float(v) for v in message["pose"]])
            else:
                raise ValueError(f"there are no messages of type {str(kind)[:40]!r}")
        except Refusal as refusal:
            await self._send({"type": "error", "detail": refusal.detail})
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
            await self._send({"type": "error", "detail": f"message not understood: {error}"})

    async def close(self) -> None:
        for task in (self._painter, self._following):
            if task is not None:
                task.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await task
        async with self._drawing:
            for name in list(self._panes):
                await self._drop(name)

    async def _show(self, job: str, names: list[str]) -> None:
        found = self._sessions.jobs.find(job)
        names = list(dict.fromkeys(names))
        if len(names) > self._sessions.settings.panes_per_session:
            raise Refusal(422, "panes", f"at most {self._sessions.settings.panes_per_session} panes at once")
        for name in names:
            if name not in found.algorithms and name != OVERLAY:
                raise Refusal(422, "panes", f"{name!r} does not run in this job")
        if self._following is not None:
            self._following.cancel()
        async with self._drawing:
            self._footage = self._chart = self._moment = self._job = self._ensembles = None
            for name in [n for n in self._panes if n not in names]:
                await self._drop(name)
            new = [name for name in names if name not in self._panes]
            for name, (id, pane) in zip(new, await self._sessions.add(len(new))):
                self._panes[name] = id, pane
                self._cameras.join(pane)
        panes = {name: f"/scenes/{self._panes[name][0]}/" for name in names}
        await self._send({"type": "scenes", "panes": panes})
        self._following = asyncio.create_task(self._follow(job, found.algorithms))

    def _seek(self, time_s: float) -> None:
        if not np.isfinite(time_s):
            raise ValueError("time_s is not a number")
        self._moment = time_s
        self._stale.set()

    async def _choose(self, values: dict[str, Any]) -> None:
        before, self._options = self._options, self._options.chosen(values)
        if self._options.top != before.top:
            self._cameras.look(ABOVE if self._options.top else OBLIQUE)
        self._cameras.link(self._options.linked)
        if (self._options.depth, self._options.dark) != (before.depth, before.dark):
            async with self._drawing:
                if self._footage is not None:
                    self._chart = self._charted(self._footage)
                    await _undisturbed(self._stage_panes, self._footage, self._chart)
        self._stale.set()

    def _look(self, pose: list[float]) -> None:
        if len(pose) != 6 or not np.isfinite(pose).all() or np.abs(pose).max() > FARTHEST:
            raise ValueError("pose is a position and a point to look at, six numbers")
        self._cameras.look(np.array(pose))

    def _tell_camera(self, pose: np.ndarray) -> None:
        task = asyncio.ensure_future(self._send({"type": "camera", "pose": np.round(pose, 3).tolist()}))
        self._telling.add(task)
        task.add_done_callback(self._telling.discard)

    async def _drop(self, name: str) -> None:
        id, pane = self._panes.pop(name)
        self._cameras.leave(pane)
        await self._sessions.remove(id)

    async def _follow(self, job: str, names: list[str]) -> None:
        """Gather a job's footage: all of a finished one, else as its estimates come in."""
        jobs = self._sessions.jobs
        try:
            state = jobs.find(job).state
            if state != "done":
                async for event in jobs.journal.follow(job, pause_s=1.0):
                    if self._footage is None:
                        outline = await asyncio.to_thread(jobs.results.outline, job)
                        if outline is not None:
                            await self._stage(footage(outline, names))
                    if self._footage is None or event is None or event.kind != "estimates":
                        continue
                    news = json.loads(event.data)
                    if news["algorithm"] in self._footage.tracks:
                        tracks = self._footage.tracks
                        tracks[news["algorithm"]] = tracks[news["algorithm"]].grown(news)
                        self._stale.set()
            if jobs.find(job).state == "done":
                text = await asyncio.to_thread(jobs.results.view, job)
                assert text is not None, "a job that is done has a view"
                view = json.loads(text)
                graphs = await asyncio.to_thread(_graphs, jobs, job, view)
                pursuits = await asyncio.to_thread(_pursuits, jobs, job, view)
                self._job = job
                sounds = await asyncio.to_thread(_sounds, jobs, job, view)
                await self._stage(replace(footage(view, names), graphs=graphs, pursuits=pursuits, sounds=sounds))
        except Refusal as refusal:
            await self._send({"type": "error", "detail": refusal.detail})
        except asyncio.CancelledError:
            raise
        except Exception:
            log.exception("a session's footage broke off")
            await self._send({"type": "error", "detail": BROKEN})

    async def _stage(self, new: Footage) -> None:
        """Take new footage; send what stands still unless the panes have it already."""
        async with self._drawing:
            wanted = self._chart if self._chart and new.truth and not new.sounds else self._charted(new)
            if self._chart is None or wanted != self._chart:
                self._chart = wanted
                await _undisturbed(self._stage_panes, new, wanted)
            else:
                for _, pane in self._panes.values():
                    pane.footage = new
            self._footage = new
        self._stale.set()

    def _charted(self, footage: Footage) -> Chart:
        deepest = max((abs(s["depth_m"] or 0.0) for s in footage.subjects), default=0.0)
        return chart(footage.points(), deepest, self._options.depth)

    def _stage_panes(self, new: Footage, where: Chart) -> None:
        for _, pane in self._panes.values():
            pane.stage(new, where, palette.DARK if self._options.dark else palette.LIGHT)

    async def _gather(self) -> None:
        """Read the trials of a finished job once they are to be shown."""
        if self._ensembles is not None or self._job is None or not (self._options.cloud or self._options.contours):
            return
        assert self._footage is not None
        shown = {s: (self._footage.time_s, track) for s, track in self._footage.truth.items()}
        try:
            path = self._sessions.jobs.results.artifact(self._job, artifacts.ARRAYS)
            self._ensembles = await asyncio.to_thread(ensemble.read, path, list(self._footage.tracks), shown)
        except Refusal as refusal:
            self._ensembles = {}
            await self._send({"type": "error", "detail": refusal.detail})

    async def _paint(self) -> None:
        while True:
            await self._stale.wait()
            self._stale.clear()
            async with self._drawing:
                if self._footage is None:
                    continue
                moment = self._footage.latest_s if self._moment is None else self._moment
                await self._gather()
                try:
                    await _undisturbed(self._show_panes, moment)
                except Exception:
                    log.exception("a 3D pane could not be drawn")
                    await self._send({"type": "error", "detail": BROKEN})
                    continue
                self._steer(moment)
            await self._send({"type": "at", "time_s": moment})

    def _steer(self, moment: float) -> None:
        """Go along with the vehicle that is followed: with its true position, else the first pane's estimate."""
        assert self._footage is not None and self._chart is not None
        name, place = self._options.follow, None
        if name in self._footage.truth:
            place = at(self._footage.time_s, self._footage.truth[name], moment)
        elif name is not None and self._panes:
            track = self._footage.tracks[self._drawn(next(iter(self._panes)))[0]]
            place = at(track.time_s, track.mean[name], moment) if name in track.mean else None
        if place is None or not np.isfinite(place).all():
            self._followed = None
            return
        target = self._chart.place(place)
        step = target - (self._cameras.pose[3:] if self._followed is None else self._followed)
        step[2], self._followed = 0.0, target
        if np.abs(step).max() > 1e-6:
            self._cameras.shift(step)

    def _drawn(self, pane: str) -> list[str]:
        """The algorithms that a pane shows: its own, or those that colours are given for."""
        assert self._footage is not None
        if pane != OVERLAY:
            return [pane]
        return [name for name in self._footage.tracks if name in self._options.colours] or list(self._footage.tracks)

    def _show_panes(self, moment: float) -> None:
        for name, (_, pane) in self._panes.items():
            pane.ensembles = self._ensembles or {}
            pane.show(self._drawn(name), moment, self._options, overlay=name == OVERLAY)


def _graphs(jobs: Jobs, job: str, view: dict[str, Any]) -> dict[str, dict[str, graph.Graph]]:
    """The factor graphs of a finished job, of the algorithms that keep them."""
    names = [s["name"] for s in view["subjects"]]
    found = {}
    for algorithm, told in view["algorithms"].items():
        if told.get("graph"):
            path = jobs.results.artifact(job, artifacts.graph_file(algorithm))
            found[algorithm] = graph.read(json.loads(path.read_text(encoding="utf-8")), names)
    return found


def _pursuits(jobs: Jobs, job: str, view: dict[str, Any]) -> dict[str, pursuit.Pursuit]:
    """What the algorithms of a finished job tell of their schedules."""
    names = [s["name"] for s in view["subjects"]]
    found = {}
    for algorithm, told in view["algorithms"].items():
        if told.get("schedule"):
            path = jobs.results.artifact(job, artifacts.graph_file(algorithm))
            read = pursuit.read(json.loads(path.read_text(encoding="utf-8")), names)
            if read is not None:
                found[algorithm] = read
    return found


def _sounds(jobs: Jobs, job: str, view: dict[str, Any]) -> dict[str, sound.Sound]:
    """How beliefs grew, of the algorithms of a finished job that tell it."""
    found = {}
    for algorithm, told in view["algorithms"].items():
        if told.get("sound"):
            path = jobs.results.artifact(job, artifacts.graph_file(algorithm))
            found[algorithm] = sound.read(json.loads(path.read_text(encoding="utf-8")))
    return found


async def _undisturbed(draw: Callable[..., None], *arguments: Any) -> None:
    """Run in a thread to its end, even when cancelled: a pane must not be closed under the pen."""
    drawing = asyncio.ensure_future(asyncio.to_thread(draw, *arguments))
    try:
        await asyncio.shield(drawing)
    except asyncio.CancelledError:
        await asyncio.wait([drawing])
        raise
