"""One algorithm's pane: what stands still is sent once, what moves is sent again for every moment shown."""

from __future__ import annotations

import secrets
import threading
from dataclasses import dataclass

import numpy as np
import rich

from server.scenes import graph, inner, palette
from server.scenes.footage import Footage, at
from server.scenes.geometry import SPAN, Chart, dashes, ellipses, round_length, segments
from server.view import thinned

#: What a browser can draw smoothly even without a graphics card.
TRACK_POINTS, TRUTH_POINTS, ELLIPSES, RAYS = 250, 600, 20, 12
#: Ellipses smaller than this (scene units) are not worth their lines.
SMALLEST = 0.02
#: A ray is seen for this share of the mission, and at least this long.
RAY_SHARE, RAY_S = 0.006, 3.0

FIELD_OF_VIEW = np.radians(50.0)


@dataclass(frozen=True)
class Options:
    """What to show: estimated trails, ranging rays, past ellipses; a vehicle to follow; the view from above; a vehicle
    whose factor graph to draw, where the estimator keeps one; and vehicles to leave out."""

    trails: bool = True
    rays: bool = True
    ellipses: bool = True
    follow: str | None = None
    top: bool = False
    hidden: tuple[str, ...] = ()
    graph: str | None = None


class Pane:
    """A viser server that shows one algorithm's estimates of a mission to who knows its secret."""

    def __init__(self) -> None:
        rich.get_console().quiet = True
        self.secret = secrets.token_urlsafe(24)
        self.server = inner.start(self.secret)
        self._lock = threading.Lock()
        self.footage: Footage
        self._chart: Chart
        self._graphed = False
        self._truth: dict[str, np.ndarray] = {}
        self._without: tuple[str, ...] | None = None
        self.server.gui.configure_theme(show_logo=False, show_share_button=False)
        scene = self.server.scene
        scene.configure_environment_map(hdri=None)
        scene.configure_default_lights(enabled=True, cast_shadow=False)
        scene.add_light_ambient("/light", intensity=2.0)
        scene.set_background_image(np.full((2, 2, 3), palette.WATER, dtype=np.uint8), format="png")
        self.server.initial_camera.fov = FIELD_OF_VIEW

    @property
    def port(self) -> int:
        return self.server.get_port()

    def close(self) -> None:
        self.server.stop()

    def begin_at(self, pose: np.ndarray) -> None:
        """Let new viewers look from a position at a point, together (6,)."""
        self.server.initial_camera.position = pose[:3]
        self.server.initial_camera.look_at = pose[3:]

    def stage(self, footage: Footage, chart: Chart) -> None:
        """Send what stands still: the sea surface, the true tracks, the vehicles with their names."""
        self.footage, self._chart = footage, chart
        scene = self.server.scene
        with self._lock, self.server.atomic():
            cell = round_length(SPAN / chart.scale / 10) * chart.scale
            scene.add_grid(
                "/surface",
                width=1.3 * SPAN,
                height=1.3 * SPAN,
                cell_size=cell,
                section_size=5 * cell,
                cell_color=palette.GRID,
                section_color=palette.GRID_SECTION,
                shadow_opacity=0.0,
            )
            self._without = None
            self._truth = {
                subject: dashes(chart.place(track[thinned(len(track), TRUTH_POINTS)], self._depth(subject)))
                for subject, track in footage.truth.items()
                if self._moves(subject)
            }
            for n, subject in enumerate(footage.subjects):
                self._vehicle(n, subject)

    def _vehicle(self, n: int, subject: dict) -> None:
        scene, colour, up = (
            self.server.scene,
            palette.vehicle(n),
            -self._chart.place(np.zeros(2), subject["depth_m"])[2],
        )
        scene.add_frame(f"/vehicle/{n}", show_axes=False, visible=False)
        radius = 0.06 if subject["kind"] == "fixed" else 0.1
        scene.add_icosphere(f"/vehicle/{n}/body", radius=radius, color=colour, subdivisions=2, cast_shadow=False)
        scene.add_label(
            f"/vehicle/{n}/name",
            subject["name"],
            position=(0.0, 0.0, 0.2),
            font_screen_scale=0.9,
            anchor="bottom-center",
        )
        if up > 0.02:
            mast = np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, up]]])
            self._lines(f"/vehicle/{n}/mast", [mast], [palette.faded(colour, 0.5)], 1.0)
        scene.add_icosphere(
            f"/true/{n}", radius=0.6 * radius, color=palette.TRUTH, subdivisions=2, cast_shadow=False, visible=False
        )

    def show(self, algorithm: str, moment_s: float, options: Options) -> None:
        """Draw one algorithm's estimates as they are at a moment of the mission."""
        footage, track = self.footage, self.footage.tracks[algorithm]
        without = options.hidden
        now = {s: at(track.time_s, mean, moment_s) for s, mean in track.mean.items() if s not in without}
        truth = {s: at(footage.time_s, p, moment_s) for s, p in footage.truth.items() if s not in without}
        with self._lock, self.server.atomic():
            if self._without != without:
                self._without = without
                lines = [line for subject, line in self._truth.items() if subject not in without]
                self._lines("/truth", lines, [palette.TRUTH] * len(lines), 1.5)
            self._trails(algorithm, moment_s, now, options)
            self._present(algorithm, moment_s, now, truth)
            self._rays(moment_s, now, truth, options)
            self._graph(algorithm, moment_s, options.graph)
            self._place(now, truth)

    def _trails(self, algorithm: str, moment_s: float, now: dict[str, np.ndarray], options: Options) -> None:
        """Estimated tracks up to the moment, and the ellipses along them."""
        footage, track = self.footage, self.footage.tracks[algorithm]
        lines, rings, colours, shades = [], [], [], []
        horizon = max(len(footage.time_s), len(track.time_s))
        past = int(np.searchsorted(track.time_s, moment_s, side="right"))
        shown, ringed = thinned(horizon, TRACK_POINTS), thinned(horizon, ELLIPSES)
        for n, name in enumerate(footage.names):
            if name not in now or not self._moves(name):
                continue
            depth, mean = self._depth(name), track.mean[name]
            line = np.concatenate([mean[shown[shown < past]], now[name][None]])
            lines.append(segments(self._chart.place(line, depth)))
            colours.append(palette.vehicle(n))
            chosen = ringed[ringed < past]
            drawn = ellipses(self._chart, mean[chosen], track.cov[name][chosen], depth)
            rings.append(_visible(drawn))
            shades.append(palette.faded(palette.vehicle(n), 0.35))
        self._lines("/trails", lines if options.trails else [], colours, 2.0)
        self._lines("/ellipses", rings if options.ellipses else [], shades, 1.2)

    def _present(
        self, algorithm: str, moment_s: float, now: dict[str, np.ndarray], truth: dict[str, np.ndarray]
    ) -> None:
        """The present ellipses, and from every estimate a line to the truth."""
        track = self.footage.tracks[algorithm]
        lines, colours = [], []
        for n, name in enumerate(self.footage.names):
            if name not in now:
                continue
            cov = at(track.time_s, track.cov[name], moment_s)
            lines.append(ellipses(self._chart, now[name][None], cov[None], self._depth(name)).reshape(-1, 2, 3))
            colours.append(palette.vehicle(n))
            if name in truth:
                ends = self._chart.place(np.stack([now[name], truth[name]]), self._depth(name))
                lines.append(segments(ends))
                colours.append(palette.TRUTH)
        self._lines("/present", lines, colours, 3.5)

    def _rays(
        self, moment_s: float, now: dict[str, np.ndarray], truth: dict[str, np.ndarray], options: Options
    ) -> None:
        """Packets on their way or just arrived: the sender's colour when heard, grey when lost, fading."""
        footage = self.footage
        last = max(RAY_S, RAY_SHARE * float(footage.time_s[-1])) if len(footage.time_s) else RAY_S
        names = footage.names
        recent = [p for p in footage.packets if p.tol_s <= moment_s <= p.toa_s + last][-RAYS:] if options.rays else []
        lines, colours = [], []
        for packet in recent:
            if {names[packet.sender], names[packet.receiver]} & set(options.hidden):
                continue
            ends = [
                truth.get(names[v], now.get(names[v], np.full(2, np.nan))) for v in (packet.sender, packet.receiver)
            ]
            depths = np.array([self._depth(names[v]) for v in (packet.sender, packet.receiver)])
            age = min(max((moment_s - packet.toa_s) / last, 0.0), 1.0)
            colour = palette.vehicle(packet.sender) if packet.heard else palette.LOST
            lines.append(segments(self._chart.place(np.stack(ends), depths)))
            colours.append(palette.faded(colour, 0.85 * age))
        self._lines("/rays", lines, colours, 2.5)

    def _graph(self, algorithm: str, moment_s: float, whose: str | None) -> None:
        """The factor graph of a vehicle up to the moment, or everybody's; nothing where there is none or it is off."""
        graphs = self.footage.graphs.get(algorithm, {})
        found = None if whose is None else graphs.get(whose, graphs.get(""))
        if found is None and not self._graphed:
            return
        self._graphed = found is not None
        names = self.footage.names
        drawn = graph.drawing(found, moment_s, self._chart, lambda n: self._depth(names[n])) if found else None
        self._lines("/graph/ranges", drawn.ranges if drawn else [], drawn.range_colours if drawn else [], 1.0)
        self._lines("/graph/links", drawn.lines if drawn else [], drawn.colours if drawn else [], 1.5)
        points, colours = (drawn.dots, drawn.dot_colours) if drawn else (np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
        if not len(points):
            points, colours = np.full((1, 3), -1000.0), np.full((1, 3), palette.WATER, np.uint8)
        self.server.scene.add_point_cloud(
            "/graph/poses",
            points.astype(np.float32),
            colours,
            point_size=graph.DOT,
            point_shape="circle",
            point_shading="flat",
            precision="float32",
        )

    def _place(self, now: dict[str, np.ndarray], truth: dict[str, np.ndarray]) -> None:
        for n, name in enumerate(self.footage.names):
            for node, places in ((f"/vehicle/{n}", now), (f"/true/{n}", truth)):
                known = name in places and bool(np.isfinite(places[name]).all())
                handle = self.server.scene.get_handle_by_name(node)
                if handle is None:
                    continue
                if known:
                    handle.position = self._chart.place(places[name], self._depth(name))
                if handle.visible != known:
                    handle.visible = known

    def _depth(self, subject: str) -> float:
        return next((s["depth_m"] for s in self.footage.subjects if s["name"] == subject), 0.0) or 0.0

    def _moves(self, subject: str) -> bool:
        return all(s["kind"] != "fixed" for s in self.footage.subjects if s["name"] == subject)

    def _lines(self, name: str, lines: list[np.ndarray], colours: list[palette.Rgb], pixels: float) -> None:
        """One set of line segments under a name that is used again; each line (M, 2, 3) in its colour."""
        drawn = [line.reshape(-1, 2, 3) for line in lines]
        points = np.concatenate([np.zeros((0, 2, 3)), *drawn]).astype(np.float32)
        shades = np.concatenate(
            [
                np.zeros((0, 2, 3), np.uint8),
                *(np.broadcast_to(palette.linear(c), line.shape) for line, c in zip(drawn, colours)),
            ]
        ).astype(np.uint8)
        if not len(points):
            points, shades = np.full((1, 2, 3), -1000.0, np.float32), np.full((1, 2, 3), palette.WATER, np.uint8)
        self.server.scene.add_line_segments(name, points, shades, thickness=pixels, thickness_units="screen")


def _visible(rings: np.ndarray) -> np.ndarray:
    """Rings (N, CORNERS, 2, 3) that are large enough to be seen, as segments (M, 2, 3)."""
    width = np.ptp(rings[..., 0, :2], axis=1).max(axis=-1, initial=0.0) if len(rings) else np.zeros(0)
    return rings[width > SMALLEST].reshape(-1, 2, 3)
