"""Colours that people with any colour vision can tell apart (Okabe and Ito, 2008), on light and on dark water."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

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


@dataclass(frozen=True)
class Look:
    """Colours of everything but the vehicles."""

    water: Rgb
    surface: Rgb
    grid: Rgb
    section: Rgb
    truth: Rgb
    lost: Rgb

    def faded(self, colour: Rgb, share: float) -> Rgb:
        """A colour gone into the water's by a share of 0..1."""
        r, g, b = (round(c + (w - c) * share) for c, w in zip(colour, self.water))
        return r, g, b


LIGHT = Look((243, 247, 250), (120, 175, 215), (205, 218, 229), (168, 189, 207), (70, 76, 84), (150, 155, 162))
DARK = Look((11, 24, 38), (40, 95, 135), (30, 52, 72), (52, 84, 110), (205, 212, 220), (118, 128, 140))


def vehicle(index: int) -> Rgb:
    """The colour of a mission's vehicle number `index`."""
    return VEHICLES[index % len(VEHICLES)]


@cache
def linear(colour: Rgb) -> np.ndarray:
    """A colour (3,) as viser takes it for the points of lines: in linear light, of which it makes sRGB itself."""
    c = np.array(colour) / 255
    return (255 * np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)).round().astype(np.uint8)
