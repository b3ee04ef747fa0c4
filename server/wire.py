"""JSON as this server speaks it: NaN and infinity are null, arrays are lists."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
from fastapi.responses import JSONResponse


def plain(value: Any) -> Any:
    """The value in JSON's own types; what is not a finite number becomes None."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def dumps(value: Any) -> str:
    """Compact JSON of a value."""
    try:
        return json.dumps(value, allow_nan=False, separators=(",", ":"))
    except (ValueError, TypeError):
        return json.dumps(plain(value), allow_nan=False, separators=(",", ":"))


def rounded(array: np.ndarray, digits: int = 3) -> list[Any]:
    """Nested lists of an array for display: rounded, None where it is not finite."""
    short = np.round(np.asarray(array, dtype=float), digits)
    if np.isfinite(short).all():
        return short.tolist()
    return plain(short.tolist())


class Json(JSONResponse):
    """A JSON answer."""

    def render(self, content: Any) -> bytes:
        return dumps(content).encode()
