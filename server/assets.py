"""Files the page is made of: our own, plotly's and viser's, all from this machine."""

from __future__ import annotations

import gzip
from functools import cache
from importlib.util import find_spec
from pathlib import Path


def static_directory() -> Path:
    """The page's files: beside this package in an installed wheel, at the top of a checkout otherwise."""
    here = Path(__file__).resolve().parent
    inside = here / "static"
    return inside if inside.is_dir() else here.parent / "static"


def _package_file(package: str, *parts: str) -> Path:
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        raise RuntimeError(f"the package {package} is not installed completely")
    return Path(spec.origin).parent.joinpath(*parts)


@cache
def plotly_js() -> tuple[bytes, bytes]:
    """plotly.min.js of the installed package, as it is and compressed by gzip."""
    plain = _package_file("plotly", "package_data", "plotly.min.js").read_bytes()
    return plain, gzip.compress(plain, 6)


@cache
def viser_client() -> str:
    """The HTML of viser's client, one file that needs no other."""
    return _package_file("viser", "client", "build", "index.html").read_text(encoding="utf-8")
