"""3D panes: a session's websocket, and every pane's page and websocket under its secret path."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from fastapi.responses import HTMLResponse

from server.problems import Refusal
from server.scenes import relay
from server.site import Here
from server.wire import dumps

router = APIRouter(tags=["scenes"])

#: A session's messages are short.
LONGEST = 64 * 1024


@router.get("/api/scenes")
def limits(here: Here) -> dict[str, Any]:
    """How many panes are open and may be; panes are opened through the websocket /api/scenes/session."""
    settings = here.settings
    return {
        "open": len(here.scenes.panes),
        "at_most": settings.panes_altogether,
        "per_session": settings.panes_per_session,
        "session": "/api/scenes/session",
    }


@router.websocket("/api/scenes/session")
async def session(socket: WebSocket, here: Here) -> None:
    await socket.accept()
    sending = asyncio.Lock()

    async def send(message: dict[str, Any]) -> None:
        async with sending:
            with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                await socket.send_text(dumps(message))

    mine = here.scenes.open(send)
    try:
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                break
            text = message.get("text") or ""
            if len(text) > LONGEST:
                await socket.close(1009)
                break
            await mine.take(text)
    finally:
        await here.scenes.shut(mine)


@router.get("/scenes/{id}/", include_in_schema=False)
def pane(id: str, here: Here) -> HTMLResponse:
    if id not in here.scenes.panes:
        raise Refusal(404, "unknown-scene", "this 3D pane is closed")
    headers = {"content-security-policy": relay.POLICY, "cache-control": "no-store"}
    return HTMLResponse(relay.page(), headers=headers)


@router.websocket("/scenes/{id}")  # viser's client leaves the last slash of its own address out
async def pane_socket(socket: WebSocket, id: str, here: Here) -> None:
    found = here.scenes.panes.get(id)
    if found is None:
        await socket.close(1008)
        return
    await relay.relay(socket, found)
