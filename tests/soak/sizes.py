"""How much each proof does: in full, in short, or any single figure by environment.

COOPNAV_SOAK=short takes the second column; COOPNAV_SOAK_KILLS=10 and the like change one figure.
"""

from __future__ import annotations

import os

SIZES = {
    # figure: in full, in short
    "jobs": (200, 60),
    "kills": (50, 15),
    "cancels": (50, 50),
    "overflow": (10, 2),  # times the length of the queue
    "cycles": (200, 60),
    "streams": (50, 50),
    "reads_per_s": (500, 500),
    "load_s": (120, 20),
    "requests": (50_000, 3_000),
    "files": (50_000, 3_000),
    "scenarios": (1_000, 100),
    "opens": (200, 30),
    "clicks": (1_500, 100),
    "soak_s": (1_800, 180),
}


def size(name: str) -> int:
    """The figure of that name."""
    asked = os.environ.get(f"COOPNAV_SOAK_{name.upper()}")
    if asked is not None:
        return int(asked)
    return SIZES[name][os.environ.get("COOPNAV_SOAK", "full") == "short"]


def promise(seconds: float, at_most: float) -> None:
    """A time that is promised for a machine of two cores with nothing else to do; the short version only reports."""
    if os.environ.get("COOPNAV_SOAK", "full") != "short":
        assert seconds <= at_most
