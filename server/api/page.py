"""The page, its files, and plotly from the installed package."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from server import assets
from server.assets import Asset
from server.problems import Refusal

router = APIRouter(include_in_schema=False)

#: Asked for anew each time, for it has no version in its name; kept for a day.
FRESH, A_DAY = "no-cache", "public, max-age=86400"


@router.get("/")
async def index(request: Request) -> Response:
    return _answer(request, assets.index(), FRESH)


@router.get("/favicon.ico")
async def icon(request: Request) -> Response:
    return await static(request, "icon.svg")


@router.get("/static/{path:path}")
async def static(request: Request, path: str) -> Response:
    """A file of the page."""
    asset = assets.static_file(path)
    if asset is None:
        raise Refusal(404, "unknown", "there is no such file")
    return _answer(request, asset, FRESH)


@router.get("/vendor/plotly.min.js")
def plotly(request: Request) -> Response:
    return _answer(request, assets.plotly_js(), A_DAY)


def _answer(request: Request, asset: Asset, caching: str) -> Response:
    """An asset as the browser takes it; nothing where the browser says that it has it."""
    packed = asset.gzipped if "gzip" in request.headers.get("accept-encoding", "") else None
    tag = f'"{asset.tag}-gzip"' if packed else f'"{asset.tag}"'
    headers = {"cache-control": caching, "vary": "accept-encoding", "etag": tag}
    if tag in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    if packed:
        headers["content-encoding"] = "gzip"
    return Response(packed or asset.plain, media_type=asset.media_type, headers=headers)
