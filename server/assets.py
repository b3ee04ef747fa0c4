"""Files the page is made of: our own, plotly's and viser's, all from this machine."""

from __future__ import annotations

import base64
import gzip
import hashlib
import os
import re
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path

TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".ico": "image/x-icon",
    ".json": "application/json",
    ".woff2": "font/woff2",
}
#: A style sheet of the page's, and what a module imports.
STYLE = re.compile(r'<link rel="stylesheet" href="/static/([^"]+)">')
IMPORT = re.compile(r'^import .*"(\.[^"]+)";$', re.MULTILINE)
#: Types that are compressed already.
DENSE = {".png", ".ico", ".woff2"}


@dataclass(frozen=True)
class Asset:
    """A file as it is sent: media type, bytes, the same compressed by gzip (None: no smaller), a tag of its content."""

    media_type: str
    plain: bytes
    gzipped: bytes | None
    tag: str


@cache
def static_directory() -> Path:
    """The page's files: beside this package in an installed wheel, at the top of a checkout otherwise."""
    here = Path(__file__).resolve().parent
    inside = here / "static"
    return (inside if inside.is_dir() else here.parent / "static").resolve()


def static_file(path: str) -> Asset | None:
    """A file of the page by its path in the folder, as it is now; None where there is none."""
    root = static_directory()
    file = root if "\0" in path else (root / path).resolve()
    if not file.is_relative_to(root) or file.suffix not in TYPES or not file.is_file():
        return None
    return _read(file, file.stat().st_mtime_ns)


def index() -> Asset:
    """The page itself with its styles, naming all modules: a browser asks for few files, and for all at once.

    Those come first that main.js imports before it draws anything.
    """
    root = static_directory()
    scripts = sorted(file.relative_to(root).as_posix() for file in root.rglob("*.js"))
    first = _imported("main.js")
    modules = (*first, *(path for path in scripts if path not in first and not path.startswith("frames/")))
    written = STYLE.sub(lambda link: f"<style>\n{_text(link[1])}</style>", _text("index.html"))
    return _index(written, modules)


def _imported(start: str) -> list[str]:
    """The paths of a module and of all that it imports, and they import, at its top; nearest first."""
    found = [start]
    for path in found:
        for name in IMPORT.findall(_text(path)):
            imported = os.path.normpath(f"{Path(path).parent}/{name}")
            if imported not in found:
                found.append(imported)
    return found


def _text(path: str) -> str:
    asset = static_file(path)
    return asset.plain.decode() if asset else ""


@cache
def plotly_js() -> Asset:
    """plotly.min.js of the installed package."""
    return _asset(_package_file("plotly", "package_data", "plotly.min.js").read_bytes(), ".js")


@cache
def viser_client() -> str:
    """The HTML of viser's client, one file that needs no other."""
    return _package_file("viser", "client", "build", "index.html").read_text(encoding="utf-8")


@lru_cache(maxsize=1000)
def _read(file: Path, changed_ns: int) -> Asset:
    return _asset(file.read_bytes(), file.suffix)


@lru_cache(maxsize=4)
def _index(written: str, modules: tuple[str, ...]) -> Asset:
    links = "".join(f'  <link rel="modulepreload" href="/static/{path}">\n' for path in modules)
    return _asset(written.replace("</head>", f"{links}</head>", 1).encode(), ".html")


def _asset(plain: bytes, suffix: str) -> Asset:
    gzipped = None if suffix in DENSE else gzip.compress(plain, 6, mtime=0)
    tag = base64.urlsafe_b64encode(hashlib.sha256(plain).digest()[:9]).decode()
    return Asset(TYPES[suffix], plain, gzipped if gzipped and len(gzipped) < len(plain) else None, tag)


def _package_file(package: str, *parts: str) -> Path:
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        raise RuntimeError(f"the package {package} is not installed completely")
    return Path(spec.origin).parent.joinpath(*parts)
