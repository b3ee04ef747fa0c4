"""Panes of a session that look at their scenes from the same place."""

from __future__ import annotations

import asyncio
import time

import numpy as np
import viser

from server.scenes.pane import Pane

#: While one pane's camera moves, and this long after, the others follow and do not lead.
LEAD_S = 0.3


class Cameras:
    """Passes one pane's camera on to the others; the pane moved last leads until it rests."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._panes: list[Pane] = []
        self._leader: Pane | None = None
        self._moved = 0.0
        self._again: asyncio.TimerHandle | None = None

    def join(self, pane: Pane) -> None:
        """Let a pane's viewers lead and follow; a viewer's first message is where it started, not a movement."""
        self._panes.append(pane)

        @pane.server.on_client_connect
        def connected(client: viser.ClientHandle) -> None:
            started = False

            @client.camera.on_update
            def moved(camera: viser.CameraHandle) -> None:
                nonlocal started
                if started:
                    pose = np.concatenate([camera.position, camera.look_at])
                    self._loop.call_soon_threadsafe(self._lead, pane, pose)
                started = True

    def leave(self, pane: Pane) -> None:
        self._panes.remove(pane)
        if self._leader is pane:
            self._leader = None

    def _lead(self, pane: Pane, pose: np.ndarray) -> None:
        now = time.monotonic()
        if self._leader is not pane and now - self._moved < LEAD_S:
            return
        self._leader, self._moved = pane, now
        self._follow(pose)
        if self._again is not None:
            self._again.cancel()
        self._again = self._loop.call_later(LEAD_S / 2, self._follow, pose)

    def _follow(self, pose: np.ndarray) -> None:
        for pane in self._panes:
            if pane is self._leader:
                continue
            for client in pane.server.get_clients().values():
                if not np.allclose(np.concatenate([client.camera.position, client.camera.look_at]), pose, atol=1e-4):
                    self._moved = time.monotonic()
                    with client.atomic():
                        client.camera.position = pose[:3]
                        client.camera.look_at = pose[3:]
