"""One pane: what stands still is sent once, what moves is sent again for every moment shown."""

from __future__ import annotations

import secrets
import threading
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rich

from server.scenes import ensemble, graph, inner, palette, pursuit, sound
from server.scenes.ensemble import Ensemble
from server.scenes.footage import Footage, Track, at
from server.scenes.geometry import (
    SPAN,
    Chart,
    compass,
    dashes,
    ellipses,
    essential,
    radius,
    round_length,
    scale_bar,
    segments,
)
from server.scenes.options import Options
from server.scenes.trail import Trail, trail
from server.view import thinned

#: What a browser can draw smoothly even without a graphics card.
TRACK_POINTS, TRUTH_POINTS, ELLIPSES, RAYS = 250, 600, 20, 12
#: A ray is seen for this share of the mission, and at least this long.
RAY_SHARE, RAY_S = 0.006, 3.0
#: Size of the points of a cloud (scene units), and where nothing is to be seen.
POINT, AWAY = 0.1, -1000.0

FIELD_OF_VIEW = np.radians(50.0)

Places = dict[str, np.ndarray]


class Pane:
    """A viser server that shows algorithms' estimates of a mission to who knows its secret."""

    def __init__(self) -> None:
        rich.get_console().quiet = True
        self.secret = secrets.token_urlsafe(24)
        self.server = inner.start(self.secret)
        self._lock = threading.Lock()
        #: Where a viewer said last that it is, (6,): viser mixes that with where it has been told to go.
        self.said = np.full(6, np.nan)
        self.footage: Footage
        self.ensembles: Mapping[str, Ensemble] = {}
        self._chart: Chart
        self._look = palette.LIGHT
        self._graphed = self._clouded = self._pursued = self._sounded = False
        self._truth: Places = {}
        self._made: dict[tuple[str, str, float, tuple[int, int]], tuple[Track, Trail]] = {}
        self._without: Sequence[str] | None = None
        self._staged = 0
        self.server.gui.configure_theme(show_logo=False, show_share_button=False)
        scene = self.server.scene
        scene.configure_environment_map(hdri=None)
        scene.configure_default_lights(enabled=True, cast_shadow=False)
        scene.add_light_ambient("/light", intensity=2.0)
        self._fill()
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

    def _fill(self) -> None:
        water = np.full((2, 2, 3), self._look.water, dtype=np.uint8)
        self.server.scene.set_background_image(water, format="png")

    def stage(self, footage: Footage, chart: Chart, look: palette.Look = palette.LIGHT) -> None:
        """Send what stands still: the sea surface, scale and north, the true tracks, the vehicles with their names."""
        self.footage, self._chart, self._made = footage, chart, {}
        scene = self.server.scene
        with self._lock, self.server.atomic():
            if look != self._look:
                self._look = look
                self._fill()
            cell = round_length(SPAN / chart.scale / 10) * chart.scale
            scene.add_grid(
                "/surface",
                width=1.3 * SPAN,
                height=1.3 * SPAN,
                cell_size=cell,
                section_size=5 * cell,
                cell_color=look.grid,
                section_color=look.section,
                shadow_opacity=0.0,
                plane_color=look.surface,
                plane_opacity=0.1,
            )
            self._bearings()
            self._without = None
            self._truth = {
                subject: dashes(line[essential(line, TRUTH_POINTS)])
                for subject, track in footage.truth.items()
                for line in (chart.place(track[thinned(len(track), TRUTH_POINTS)], self._depth(subject)),)
                if self._moves(subject)
            }
            for n in range(len(footage.subjects), self._staged):
                for node in (f"/vehicle/{n}", f"/true/{n}"):
                    scene.remove_by_name(node)
            self._staged = len(footage.subjects)
            for n, subject in enumerate(footage.subjects):
                self._vehicle(n, subject)

    def _bearings(self) -> None:
        """A distance scale and an arrow to the north on the surface, and how much depths are stretched."""
        bar, length_m = scale_bar(self._chart)
        arrow = compass()
        self._lines("/bearings", [bar, arrow], [self._look.truth] * 2, 2.0)
        told = f"{length_m / 1000:g} km" if length_m >= 1000 else f"{length_m:g} m"
        if self._chart.stretch >= 1.2 and any(s["depth_m"] for s in self.footage.subjects):
            told += f", depths × {self._chart.stretch:.3g}"
        for name, text, place in (("scale", told, bar.mean(axis=(0, 1))), ("north", "N", arrow[0, 1])):
            self.server.scene.add_label(
                f"/bearings/{name}", text, position=place, font_screen_scale=0.8, anchor="bottom-center"
            )

    def _vehicle(self, n: int, subject: dict) -> None:
        scene, colour, up = (
            self.server.scene,
            palette.vehicle(n),
            -self._chart.place(np.zeros(2), subject["depth_m"])[2],
        )
        scene.add_frame(f"/vehicle/{n}", show_axes=False, visible=False)
        size = 0.06 if subject["kind"] == "fixed" else 0.1
        scene.add_icosphere(f"/vehicle/{n}/body", radius=size, color=colour, subdivisions=2, cast_shadow=False)
        label = subject.get("label", subject["name"])
        if label:
            scene.add_label(
                f"/vehicle/{n}/name",
                label,
                position=(0.0, 0.0, 0.2),
                font_screen_scale=0.9,
                anchor="bottom-center",
            )
        else:
            scene.remove_by_name(f"/vehicle/{n}/name")
        mast = [np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, up]]])] if up > 0.02 else []
        self._lines(f"/vehicle/{n}/mast", mast, [self._look.faded(colour, 0.5)], 1.0)
        scene.add_icosphere(
            f"/true/{n}", radius=0.6 * size, color=self._look.truth, subdivisions=2, cast_shadow=False, visible=False
        )

    def show(self, algorithms: Sequence[str], moment_s: float, options: Options, overlay: bool = False) -> None:
        """Draw estimates as they are at a moment of the mission: one algorithm's, or several laid over each other."""
        self._overlay = overlay
        footage, without = self.footage, options.hidden
        now = {
            name: {s: at(track.time_s, mean, moment_s) for s, mean in track.mean.items() if s not in without}
            for name in algorithms
            for track in (footage.tracks[name],)
        }
        for name in now.keys() & footage.sounds.keys() if options.sound else ():
            modes = footage.sounds[name].modes(moment_s)
            now[name] = {s: modes.get(s, place) for s, place in now[name].items() if s in modes or self._moves(s)}
        truth = {s: at(footage.time_s, p, moment_s) for s, p in footage.truth.items() if s not in without}
        first = now[algorithms[0]] if algorithms else {}
        with self._lock, self.server.atomic():
            if self._without != without:
                self._without = without
                lines = [line for subject, line in self._truth.items() if subject not in without]
                self._lines("/truth", lines, [self._look.truth] * len(lines), 1.5)
            self._trails(moment_s, now, options)
            self._present(moment_s, now, truth, options)
            self._trials(moment_s, now, options)
            self._rays(moment_s, first, truth, options)
            self._graph(algorithms, moment_s, options.graph)
            self._pursuit(algorithms, moment_s, options.pursuit, first, truth)
            self._sound(algorithms, moment_s, options.sound)
            self._place(first | truth if overlay else first, {} if overlay else truth)

    def _colour(self, algorithm: str, n: int, options: Options) -> palette.Rgb:
        """Of a vehicle's estimates; where algorithms are laid over each other, the algorithm's."""
        if self._overlay and algorithm in options.colours:
            r, g, b = options.colours[algorithm]
            return r, g, b
        return palette.vehicle(n)

    def _trails(self, moment_s: float, now: Mapping[str, Places], options: Options) -> None:
        """Estimated tracks up to the moment, and the ellipses along them."""
        footage = self.footage
        lines, rings, colours, shades = [], [], [], []
        many = max(len(now), 1)
        most = max(2 * TRACK_POINTS // (many + 1), 60), max(2 * ELLIPSES // (many + 1), 6)
        for algorithm, places in now.items():
            for n, name in enumerate(footage.names):
                if name not in places or not self._moves(name):
                    continue
                colour = self._colour(algorithm, n, options)
                line, ring = self._trail(algorithm, name, options, most).until(
                    moment_s, self._chart.place(places[name], self._depth(name))
                )
                lines.append(line)
                colours.append(colour)
                rings.append(ring)
                shades.append(self._look.faded(colour, 0.35))
        self._lines("/trails", lines if options.trails else [], colours, 2.0)
        self._lines("/ellipses", rings if options.ellipses else [], shades, 1.2)

    def _trail(self, algorithm: str, name: str, options: Options, most: tuple[int, int]) -> Trail:
        """A trail with ellipses of the wanted size; made once for each track."""
        track, key = self.footage.tracks[algorithm], (algorithm, name, options.sigma, most)
        of, made = self._made.get(key, (None, None))
        if made is None or of is not track:
            reports = max(len(self.footage.time_s), len(track.time_s))
            made = trail(self._chart, track, name, self._depth(name), radius(options.sigma), reports=reports, most=most)
            self._made[key] = track, made
        return made

    def _present(self, moment_s: float, now: Mapping[str, Places], truth: Places, options: Options) -> None:
        """The present ellipses, and from every estimate a line to the truth; not where lines of density tell more."""
        lines, colours = [], []
        for algorithm, places in now.items():
            track = self.footage.tracks[algorithm]
            for n, name in enumerate(self.footage.names):
                heard = options.sound and algorithm in self.footage.sounds and not self._moves(name)
                if name not in places or heard:
                    continue
                mean, depth = places[name], self._depth(name)
                cov = at(track.time_s, track.cov[name], moment_s)
                ring = ellipses(self._chart, mean[None], cov[None], depth, radius(options.sigma))
                lines.append(ring.reshape(-1, 2, 3))
                colours.append(self._colour(algorithm, n, options))
                if name in truth:
                    lines.append(segments(self._chart.place(np.stack([mean, truth[name]]), depth)))
                    colours.append(colours[-1] if self._overlay else self._look.truth)
        self._lines("/present", lines, colours, 3.5)

    def _trials(self, moment_s: float, now: Mapping[str, Places], options: Options) -> None:
        """All trials: points and their envelope along the track, and lines of equal density."""
        wanted = (options.cloud or options.contours) and bool(self.ensembles)
        if not wanted and not self._clouded:
            return
        self._clouded = wanted
        points, tints, rings, shades, levels, inks = [], [], [], [], [], []
        for algorithm, places in now.items() if wanted else ():
            found = self.ensembles.get(algorithm)
            for n, name in enumerate(self.footage.names):
                if found is None or name not in places or name not in found.points:
                    continue
                colour, depth = self._colour(algorithm, n, options), self._depth(name)
                here = found.at(name, moment_s)
                if options.cloud:
                    points.append(self._chart.place(here, depth))
                    tints.append(np.tile(np.array(colour, np.uint8), (len(here), 1)))
                    kept = thinned(len(found.time_s), ELLIPSES)
                    past = [t for t in found.time_s[kept] if t <= moment_s] if self._moves(name) else []
                    hulls = [h for t in [*past, moment_s] if (h := ensemble.envelope(found.at(name, t))) is not None]
                    if hulls:
                        mean, cov = (np.stack(part) for part in zip(*hulls))
                        rings.append(ellipses(self._chart, mean, cov, depth, 1.0).reshape(-1, 2, 3))
                        shades.append(self._look.faded(colour, 0.45))
                if options.contours:
                    for line in ensemble.contours(here):
                        levels.append(self._chart.place(line, depth))
                        inks.append(colour)
        self._lines("/trials/envelope", rings, shades, 1.4)
        self._lines("/trials/density", levels, inks, 1.8)
        self._points("/trials/cloud", points, tints, POINT)

    def _rays(self, moment_s: float, now: Places, truth: Places, options: Options) -> None:
        """Packets on their way or just arrived: the sender's colour when heard, grey when lost, fading."""
        footage = self.footage
        last = max(RAY_S, RAY_SHARE * float(footage.time_s[-1])) if len(footage.time_s) else RAY_S
        names = footage.names
        recent = [
            p
            for p in footage.packets
            if p.tol_s <= moment_s <= p.toa_s + last and not {names[p.sender], names[p.receiver]} & set(options.hidden)
        ][-RAYS:]
        lines, colours = [], []
        for packet in recent if options.rays else []:
            ends = [
                truth.get(names[v], now.get(names[v], np.full(2, np.nan))) for v in (packet.sender, packet.receiver)
            ]
            depths = np.array([self._depth(names[v]) for v in (packet.sender, packet.receiver)])
            age = min(max((moment_s - packet.toa_s) / last, 0.0), 1.0)
            colour = palette.vehicle(packet.sender) if packet.heard else self._look.lost
            lines.append(segments(self._chart.place(np.stack(ends), depths)))
            colours.append(self._look.faded(colour, 0.85 * age))
        self._lines("/rays", lines, colours, 2.5)

    def _graph(self, algorithms: Sequence[str], moment_s: float, whose: str | None) -> None:
        """The factor graph of a vehicle up to the moment, or everybody's; nothing where there is none or it is off."""
        graphs = {} if self._overlay else self.footage.graphs.get(algorithms[0], {})
        found = None if whose is None else graphs.get(whose, graphs.get(""))
        if found is None and not self._graphed:
            return
        self._graphed = found is not None
        names = self.footage.names
        drawn = None
        if found is not None:
            drawn = graph.drawing(found, moment_s, self._chart, lambda n: self._depth(names[n]), self._look)
        self._lines("/graph/ranges", drawn.ranges if drawn else [], drawn.range_colours if drawn else [], 1.0)
        self._lines("/graph/links", drawn.lines if drawn else [], drawn.colours if drawn else [], 1.5)
        self._points("/graph/poses", [drawn.dots] if drawn else [], [drawn.dot_colours] if drawn else [], graph.DOT)

    def _pursuit(
        self, algorithms: Sequence[str], moment_s: float, whose: str | None, now: Places, truth: Places
    ) -> None:
        """Formation, waypoints, messages and hyperbolas of a pursuit; nothing where there is none or it is off."""
        found = self.footage.pursuits.get(algorithms[0]) if len(algorithms) == 1 and whose is not None else None
        if found is None and not self._pursued:
            return
        self._pursued = found is not None
        drawn = pursuit.Drawing([], [], [], [])
        if found is not None:
            target = next(iter(truth.values()), None)
            drawn = pursuit.drawing(found, moment_s, self._chart, self._look, whose, now, target)
        self._lines("/pursuit/lines", drawn.lines, drawn.colours, 2.2)
        self._lines("/pursuit/thin", drawn.thin, drawn.thin_colours, 1.2)

    def _sound(self, algorithms: Sequence[str], moment_s: float, wanted: bool) -> None:
        """Beliefs of beacons, beams of arrays and the drifted track; nothing where there are none or they are off."""
        found = self.footage.sounds.get(algorithms[0]) if len(algorithms) == 1 and wanted else None
        if found is None and not self._sounded:
            return
        self._sounded = found is not None
        drawn = sound.Drawing([], [], [], [], [], [])
        if found is not None:
            names = self.footage.names
            extent = float(np.ptp(self.footage.points(), axis=0).max())
            depths = {name: self._depth(name) for name in names}
            drawn = sound.drawing(found, moment_s, self._chart, self._look, names, depths, extent)
        self._lines("/sound/density", drawn.levels, drawn.level_colours, 2.2)
        self._lines("/sound/beams", drawn.beams, drawn.beam_colours, 1.4)
        self._lines("/sound/drift", drawn.drifts, drawn.drift_colours, 1.4)

    def _place(self, now: Places, truth: Places) -> None:
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
        """Whether a track is drawn of it: what is taken to stand still has none, however its estimate wanders."""
        return all(s["kind"] not in ("fixed", "beacon") for s in self.footage.subjects if s["name"] == subject)

    def _points(self, name: str, points: list[np.ndarray], colours: list[np.ndarray], size: float) -> None:
        """One cloud of points (N, 3) each in its colour (N, 3), under a name that is used again."""
        drawn = np.concatenate([np.zeros((0, 3)), *points]).astype(np.float32)
        shades = np.concatenate([np.zeros((0, 3), np.uint8), *colours]).astype(np.uint8)
        if not len(drawn):
            drawn, shades = np.full((1, 3), AWAY, np.float32), np.full((1, 3), self._look.water, np.uint8)
        if not self._again(name, drawn, shades):
            self.server.scene.add_point_cloud(
                name, drawn, shades, point_size=size, point_shape="circle", point_shading="flat", precision="float32"
            )

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
            points, shades = np.full((1, 2, 3), AWAY, np.float32), np.full((1, 2, 3), self._look.water, np.uint8)
        if not self._again(name, points, shades):
            self.server.scene.add_line_segments(name, points, shades, thickness=pixels, thickness_units="screen")

    def _again(self, name: str, points: np.ndarray, colours: np.ndarray) -> bool:
        """Whether lines or points of that name are there already, which then become these; what stays is not sent."""
        handle: Any = self.server.scene.get_handle_by_name(name)
        if handle is not None:
            handle.points, handle.colors = points, colours
        return handle is not None
