"""Where the panes of a session look at their scenes from: all from one place, or each from its own."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from server.scenes.geometry import SPAN
from server.scenes.pane import Pane

if TYPE_CHECKING:
    import viser

OBLIQUE = np.concatenate([np.array([0.0, -0.9, 1.12]) * SPAN, np.zeros(3)])
ABOVE = np.concatenate([np.array([0.0, -0.01, 1.45]) * SPAN, np.zeros(3)])

#: While one pane's camera moves, and this long after, the others follow and do not lead.
LEAD_S = 0.3
#: A viewer that is not at the pose it was given is told again this often; one that has not come to it by the
#: deadline, however busy its machine, is being moved by its user.
TELL_S, SETTLE_S = 0.3, 20.0
#: The same for a viewer that was there before it was turned by us.
TURN_S = 3.0
#: Poses closer than this (scene units) are the same.
SAME = 0.01
#: A pose is at least this far (of its distance) aside of straight above or below, so that it has a heading.
STEEPEST = 0.01


def pose_of(position: Sequence[float], look_at: Sequence[float], wxyz: Sequence[float]) -> np.ndarray:
    """A viewer's pose (6,) from what it says of its camera: orientation `wxyz` of axes right, down and forward.

    Of one that looks straight down only the orientation says which way is up on the screen: it is put a little aside.
    """
    offset = np.subtract(position, look_at)
    least = STEEPEST * float(np.linalg.norm(offset))
    if np.linalg.norm(offset[:2]) < least:
        w, x, y, z = wxyz
        up = np.array([w * z - x * y, x * x + z * z - 0.5])  # on the screen, east and north
        length = float(np.linalg.norm(up))
        if length > 0:
            offset[:2] = -np.sign(offset[2]) * least / length * up
    return np.concatenate([look_at + offset, look_at])


class Cameras:
    """Position and point looked at, (6,) scene units, of every pane's viewers; where linked, the one moved last leads.

    `moved(pose)` is told when a person has moved a camera and it rests.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, moved: Callable[[np.ndarray], None]) -> None:
        self._loop, self._told = loop, moved
        self._poses: dict[Pane, np.ndarray] = {}
        self._leader: Pane | None = None
        self._moved = 0.0
        self._again: asyncio.TimerHandle | None = None
        self._turns = 0
        self.linked = True
        self.pose = OBLIQUE

    def join(self, pane: Pane) -> None:
        """Give a pane's viewers the shared pose and let them lead.

        A viewer starts where viser's client puts it and says so, more than once, and one that we turn goes on for a
        while to say where it was: it is heard only when it has come to the pose it was given.
        """
        self._poses[pane] = self.pose
        pane.begin_at(self.pose)

        @pane.server.on_client_connect
        def connected(client: viser.ClientHandle) -> None:
            settled, turns, deadline = False, self._turns, time.monotonic() + SETTLE_S

            def turn() -> None:
                """Tell it until it is there: what it is told while it starts it may forget, and then say no more."""
                if settled or time.monotonic() > deadline or client.client_id not in pane.server.get_clients():
                    return
                _turn(client, self._poses.get(pane, self.pose))
                self._loop.call_later(TELL_S, turn)

            @client.camera.on_update
            def moved(_: viser.CameraHandle) -> None:
                nonlocal settled, turns, deadline
                pose, now = pane.said, time.monotonic()
                if settled and turns != self._turns:
                    settled, deadline = False, now + TURN_S
                    self._loop.call_soon_threadsafe(turn)
                turns = self._turns
                if settled:
                    self._loop.call_soon_threadsafe(self._lead, pane, pose)
                    return
                settled = np.allclose(pose, self._poses.get(pane, self.pose), atol=SAME) or now > deadline

            self._loop.call_soon_threadsafe(turn)

    def leave(self, pane: Pane) -> None:
        self._poses.pop(pane, None)
        if self._leader is pane:
            self._leader = None

    def look(self, pose: np.ndarray) -> None:
        """Turn all viewers to a pose (6,)."""
        self.pose, self._leader, self._moved = pose, None, time.monotonic()
        self._poses = dict.fromkeys(self._poses, pose)
        self._turns += 1
        for pane in self._poses:
            pane.begin_at(pose)
        self._follow()

    def shift(self, step: np.ndarray) -> None:
        """Move all viewers and what they look at by a step (3,)."""
        both = np.concatenate([step, step])
        self.pose, self._leader, self._moved = self.pose + both, None, time.monotonic()
        self._poses = {pane: pose + both for pane, pose in self._poses.items()}
        self._turns += 1
        self._follow()

    def link(self, linked: bool) -> None:
        """Let the viewers move together, all to where the one moved last is; or each by itself."""
        if linked and not self.linked:
            self.look(self.pose)
        self.linked = linked

    def _lead(self, pane: Pane, pose: np.ndarray) -> None:
        now = time.monotonic()
        if pane not in self._poses or np.allclose(pose, self._poses[pane], atol=SAME):
            return
        if self.linked and self._leader is not pane and now - self._moved < LEAD_S:
            return
        self.pose, self._leader, self._moved = pose, pane, now
        if self.linked:
            self._poses = dict.fromkeys(self._poses, pose)
        else:
            self._poses[pane] = pose
        self._follow()
        if self._again is not None:
            self._again.cancel()
        self._again = self._loop.call_later(LEAD_S, self._rest)

    def _rest(self) -> None:
        self._follow()
        self._told(self.pose)

    def _follow(self) -> None:
        for pane, pose in self._poses.items():
            if pane is not self._leader and (self.linked or self._leader is None):
                for client in pane.server.get_clients().values():
                    _turn(client, pose)


def _turn(client: viser.ClientHandle, pose: np.ndarray) -> None:
    with client.atomic():
        client.camera.position = pose[:3]
        client.camera.look_at = pose[3:]
