"""Colours that people with any colour vision can tell apart (Okabe and Ito, 2008)."""

from __future__ import annotations

import numpy as np

Rgb = tuple[int, int, int]

VEHICLES: tuple[Rgb, ...] = (
    (0, 114, 178),
    (213, 94, 0),
    (0, 158, 115),
    (204, 121, 167),
    (230, 159, 0),
    (86, 180, 233),
)
TRUTH: Rgb = (70, 76, 84)
LOST: Rgb = (150, 155, 162)
WATER: Rgb = (243, 247, 250)
GRID: Rgb = (205, 218, 229)
GRID_SECTION: Rgb = (168, 189, 207)


def vehicle(index: int) -> Rgb:
    """The colour of a mission's vehicle number `index`."""
    return VEHICLES[index % len(VEHICLES)]


def linear(colour: Rgb) -> np.ndarray:
    """A colour (3,) as viser takes it for the points of lines: in linear light, of which it makes sRGB itself."""
    c = np.array(colour) / 255
    return (255 * np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)).round().astype(np.uint8)


def faded(colour: Rgb, share: float) -> Rgb:
    """A colour gone into the water's by a share of 0..1."""
    r, g, b = (round(c + (w - c) * share) for c, w in zip(colour, WATER))
    return r, g, b
