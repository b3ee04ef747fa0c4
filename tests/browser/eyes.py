"""What a person sees in a pane: the pixels of its frame on the screen."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image
from playwright.sync_api import Page

from tests.browser.serving import until

Rgb = tuple[int, int, int]
#: The water in a pane.
WATER = np.array([243.0, 247.0, 250.0])


def pixels(page: Page, algorithm: str) -> np.ndarray:
    """The pane of an algorithm as it is on the screen, (height, width, 3)."""
    shot = page.locator(f".pane[data-algorithm={algorithm}] .view").screenshot(timeout=60_000)
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)


def count(image: np.ndarray, colour: Rgb, off: float = 30.0) -> int:
    """How many pixels have a colour, or pale with the water's: thin lines, and what is seen through its surface.

    The pixels' share of the colour is 0.4 or more, more than the grid's of blue; `off` is how far they may be from
    the straight line between the two colours.
    """
    towards = np.array(colour, float) - WATER
    share = (image - WATER) @ towards / (towards @ towards)
    away = np.linalg.norm(image - WATER - share[..., None] * towards, axis=-1)
    return int(((share > 0.4) & (share < 1.2) & (away <= off)).sum())


def vehicle_colours(page: Page) -> list[Rgb]:
    """The colours that the page's vehicle chips promise."""
    found = page.locator(".vehicle .dot").evaluate_all("dots => dots.map(d => getComputedStyle(d).backgroundColor)")
    return [tuple(int(v) for v in text[4:-1].split(",")) for text in found]  # type: ignore[misc]


def see_the_vehicles(page: Page, algorithms: list[str]) -> None:
    """Wait until every pane shows something of every vehicle."""

    def seen(algorithm: str) -> bool:
        image = pixels(page, algorithm)
        colours = vehicle_colours(page)
        return bool(colours) and image.std() > 3 and all(count(image, colour) >= 15 for colour in colours)

    for algorithm in algorithms:
        page.locator(f".pane[data-algorithm={algorithm}][data-state=shown]").wait_for()
        until(lambda name=algorithm: seen(name), f"the vehicles in the pane of {algorithm}")


def settled(page: Page, algorithm: str) -> np.ndarray:
    """The pane once nothing in it moves any more."""
    seen = [pixels(page, algorithm)]

    def still() -> bool:
        seen.append(pixels(page, algorithm))
        return difference(seen[-2], seen[-1]) == 0

    until(still, f"a still pane of {algorithm}")
    return seen[-1]


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """Share of the pixels that differ visibly."""
    return float((np.abs(one - other).max(axis=-1) > 30).mean())
