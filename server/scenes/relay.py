"""The way to a pane's viser server: its client page, and its websocket passed through our own port."""

from __future__ import annotations

import asyncio
import contextlib
import math

import msgspec
import websockets
from fastapi import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import connect
from websockets.typing import Subprotocol

from server.assets import viser_client
from server.scenes import inner
from server.scenes.cameras import pose_of
from server.scenes.pane import Pane

LARGEST = 4096
Three = tuple[float, float, float]


class Camera(msgspec.Struct, tag_field="type", tag="ViewerCameraMessage", forbid_unknown_fields=True):
    """All that a viewer of a pane has to say; above all it may not ask viser for a public share tunnel."""

    wxyz: tuple[float, float, float, float]
    position: Three
    fov: float
    near: float
    far: float
    image_height: int
    image_width: int
    look_at: Three
    up_direction: Three

    def finite(self) -> bool:
        numbers = (*self.wxyz, *self.position, *self.look_at, *self.up_direction, self.fov, self.near, self.far)
        return all(map(math.isfinite, numbers))


POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:; "
    "worker-src blob: data:; style-src 'unsafe-inline'; img-src 'self' data: blob:; font-src data:; "
    "connect-src 'self' data: blob:; frame-ancestors 'self'; base-uri 'none'"
)

#: An unfocused pane must reconnect too; and a pane shows its scene alone.
HEAD = """<script>document.hasFocus = () => true;</script><script src="/static/frames/behind.js"></script>
<script src="/static/frames/pace.js"></script><style>
.mantine-Paper-root, .mantine-Notifications-root, .mantine-Affix-root { display: none !important; }
</style>"""


def page() -> str:
    """viser's client as panes use it."""
    before, head, after = viser_client().partition("<head>")
    return before + head + HEAD + after


_camera = msgspec.msgpack.Decoder(Camera)


def permitted(data: bytes) -> Camera | None:
    """What a viewer says, if it may reach viser."""
    try:
        said = _camera.decode(data) if len(data) <= LARGEST else None
    except (msgspec.DecodeError, RecursionError):
        return None
    return said if said is not None and said.finite() else None


async def relay(viewer: WebSocket, pane: Pane) -> None:
    """Pass a viewer's websocket on to a pane's viser on its loopback port, both ways, until either ends."""
    offered = [Subprotocol(p) for p in viewer.scope.get("subprotocols", [])]
    try:
        upstream = await connect(
            f"ws://127.0.0.1:{pane.port}/",
            additional_headers={inner.HEADER: pane.secret},
            subprotocols=offered or None,
            max_size=None,
            compression=None,
            proxy=None,
        )
    except (OSError, websockets.InvalidHandshake):
        await viewer.close(1013)
        return
    async with upstream:
        await viewer.accept(subprotocol=upstream.subprotocol)

        async def down() -> None:
            async for data in upstream:
                await viewer.send_bytes(data if isinstance(data, bytes) else data.encode())

        async def up() -> None:
            while True:
                message = await viewer.receive()
                if message["type"] == "websocket.disconnect":
                    return
                data = message.get("bytes") or b""
                said = permitted(data)
                if said is not None:
                    pane.said = pose_of(said.position, said.look_at, said.wxyz)
                    await upstream.send(data)

        ways = [asyncio.create_task(down()), asyncio.create_task(up())]
        try:
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for way in ways:
                way.cancel()
            await asyncio.gather(*ways, return_exceptions=True)
            with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                await viewer.close()
