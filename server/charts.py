"""Small charts as SVG text, drawn from arrays; no script, no other file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

WIDTH, HEIGHT, LEFT, BOTTOM, TOP = 640, 240, 56, 34, 26
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#4d4d4d", "#8a6d00")
#: A chart this wide shows no more points than this.
POINTS = 400


def curves(
    title: str,
    unit: str,
    time_s: np.ndarray,
    lines: Mapping[str, np.ndarray],
    band: tuple[float, float] | None = None,
    ceiling: float | None = None,
) -> str:
    """Curves (T,) over time with a legend; a shaded band of values; what is above the ceiling is cut off."""
    known = [v[np.isfinite(v)] for v in lines.values()]
    top = max([float(v.max()) for v in known if v.size] + [band[1] if band else 0.0, 1e-9])
    top = min(top, ceiling) if ceiling is not None else top
    last = max(float(time_s[-1]) if len(time_s) else 0.0, 1e-9)
    hours = last > 7200

    def x(t: np.ndarray) -> np.ndarray:
        return LEFT + (WIDTH - LEFT - 10) * t / last

    def y(v: np.ndarray) -> np.ndarray:
        return HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * np.clip(v, 0, top * 1.02) / (top * 1.05)

    parts = [_axes(title, unit, last / (3600 if hours else 60), "h" if hours else "min", top * 1.05)]
    if band:
        high, low = y(np.array([band[1], band[0]]))
        parts.append(
            f'<rect x="{LEFT}" y="{high:.1f}" width="{WIDTH - LEFT - 10}" height="{low - high:.1f}" fill="#8883"/>'
        )
    step = max(len(time_s) // POINTS, 1)
    for n, (label, value) in enumerate(lines.items()):
        points = _path(x(time_s[::step]), y(value[::step]), np.isfinite(value[::step]))
        colour = COLOURS[n % len(COLOURS)]
        parts.append(
            f'<path d="{points}" fill="none" stroke="{colour}" stroke-width="1.5"><title>{escape(label)}</title></path>'
        )
    return _svg(HEIGHT, parts) + _legend(list(lines))


def plan(truth: Sequence[np.ndarray], tracks: Mapping[str, Sequence[np.ndarray]]) -> str:
    """Tracks (T, 2) m from above: the truth dashed in grey, every algorithm in its colour."""
    lines = [*truth, *(line for group in tracks.values() for line in group)]
    everything = np.concatenate([np.zeros((0, 2)), *lines])
    everything = everything[np.isfinite(everything).all(axis=1)]
    if not len(everything):
        return ""
    low, high = everything.min(axis=0), everything.max(axis=0)
    span = max(float((high - low).max()), 1.0)
    side = 520

    def path(line: np.ndarray) -> str:
        line = line[:: max(len(line) // POINTS, 1)]
        place = 20 + (side - 40) * (line - low) / span
        return _path(place[:, 0], side - place[:, 1], np.isfinite(line.sum(axis=1)))

    parts = [
        f'<path d="{path(t)}" fill="none" stroke="#6b7280" stroke-width="1.2" stroke-dasharray="5 4"/>' for t in truth
    ]
    for n, group in enumerate(tracks.values()):
        parts += [
            f'<path d="{path(line)}" fill="none" stroke="{COLOURS[n % len(COLOURS)]}" stroke-width="1.3"/>'
            for line in group
        ]
    bar = 10 ** np.floor(np.log10(span / 3))
    length = (side - 40) * bar / span
    parts.append(
        f'<path d="M20 {side - 6}h{length:.1f}" stroke="#1c2430" stroke-width="2"/>'
        f'<text x="{24 + length:.0f}" y="{side - 2}">{bar:g} m</text>'
    )
    return _svg(side, parts, side) + _legend(list(tracks), "truth (dashed)")


def _path(x: np.ndarray, y: np.ndarray, known: np.ndarray) -> str:
    words, drawing = [], False
    for a, b, there in zip(x, y, known):
        if there:
            words.append(f"{'L' if drawing else 'M'}{a:.1f} {b:.1f}")
        drawing = bool(there)
    return "".join(words)


def _axes(title: str, unit: str, last: float, time_unit: str, top: float) -> str:
    base, right = HEIGHT - BOTTOM, WIDTH - 10
    parts = [f'<text x="{LEFT}" y="16" font-weight="600">{escape(title)}</text>']
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        across, up = LEFT + share * (right - LEFT), base - share * (base - TOP)
        parts.append(f'<path d="M{LEFT} {up:.1f}H{right}" stroke="#8884" stroke-width="1"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{up + 4:.1f}" text-anchor="end">{share * top:.3g}</text>')
        parts.append(f'<text x="{across:.1f}" y="{base + 16}" text-anchor="middle">{share * last:.3g}</text>')
    parts.append(f'<text x="{right}" y="{base + 30}" text-anchor="end">time ({time_unit})</text>')
    parts.append(f'<text x="{right}" y="16" text-anchor="end">{escape(unit)}</text>')
    return "".join(parts)


def _svg(height: int, parts: list[str], width: int = WIDTH) -> str:
    body = "".join(parts)
    return (
        f'<svg viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img" '
        f'font-size="12" fill="currentColor">{body}</svg>'
    )


def _legend(labels: list[str], also: str = "") -> str:
    items = [
        f'<span><i style="background:{COLOURS[n % len(COLOURS)]}"></i>{escape(label)}</span>'
        for n, label in enumerate(labels)
    ]
    if also:
        items.append(f'<span><i style="background:#6b7280"></i>{escape(also)}</span>')
    return f'<p class="legend">{"".join(items)}</p>'
