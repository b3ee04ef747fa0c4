"""The page, its files, and plotly from the installed package."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Header
from fastapi.responses import FileResponse, Response

from server import assets
from server.problems import Refusal

router = APIRouter(include_in_schema=False)

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


@router.get("/")
async def index() -> FileResponse:
    return await static("index.html")


@router.get("/favicon.ico")
async def icon() -> FileResponse:
    return await static("icon.svg")


@router.get("/static/{path:path}")
async def static(path: str) -> FileResponse:
    """A file of the page, asked for anew each time, for it has no version in its name."""
    root = assets.static_directory().resolve()
    file = root if "\0" in path else (root / path).resolve()
    if not file.is_relative_to(root) or not file.is_file() or file.suffix not in TYPES:
        raise Refusal(404, "unknown", "there is no such file")
    headers = {"cache-control": "no-cache"}
    return FileResponse(file, media_type=TYPES[file.suffix], headers=headers, stat_result=file.stat())


@router.get("/vendor/plotly.min.js")
def plotly(accept_encoding: Annotated[str, Header()] = "") -> Response:
    plain, compressed = assets.plotly_js()
    headers = {"cache-control": "public, max-age=86400", "vary": "accept-encoding"}
    if "gzip" in accept_encoding:
        return Response(compressed, media_type=TYPES[".js"], headers=headers | {"content-encoding": "gzip"})
    return Response(plain, media_type=TYPES[".js"], headers=headers)
