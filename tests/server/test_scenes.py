"""3D panes over the wire: a session, its panes' pages, and the relay to viser."""

from __future__ import annotations

import asyncio
import itertools
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
import viser
from scipy.spatial.transform import Rotation
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from server.problems import Refusal
from server.scenes import palette, relay
from server.scenes.cameras import ABOVE, OBLIQUE, pose_of
from server.scenes.sessions import Sessions
from tests.server.living import PATIENCE_S, SHORT, Live, until


class Session:
    """A browser's end of the session websocket."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket

    def say(self, **message: Any) -> None:
        self.socket.send(json.dumps(message))

    def hear(self, kind: str, patience_s: float = PATIENCE_S) -> dict[str, Any]:
        """The next message of a kind; those of other kinds are passed over."""
        while True:
            message = json.loads(self.socket.recv(timeout=patience_s))
            if message["type"] == kind:
                return message
            assert message["type"] != "error", message

    def show(self, job: str, *panes: str) -> dict[str, str]:
        self.say(type="show", job=job, panes=panes)
        return self.hear("scenes")["panes"]


@contextmanager
def session(live: Live) -> Iterator[Session]:
    with connect(f"{live.ws}/api/scenes/session", origin=live.url) as socket:
        yield Session(socket)


@contextmanager
def viewer(live: Live, path: str) -> Iterator[ClientConnection]:
    """What viser's client does: it leaves the last slash out."""
    protocol = f"viser-v{viser.__version__}"
    with connect(live.ws + path.rstrip("/"), subprotocols=[protocol], origin=live.url, max_size=None) as socket:
        assert socket.subprotocol == protocol
        yield socket


@pytest.fixture(scope="module")
def job(live: Live) -> str:
    return live.done(SHORT)["id"]


def test_every_pane_has_its_own_page_and_scene(live: Live, job: str):
    with session(live) as mine:
        panes = mine.show(job, "cekf", "nekf")
        assert len(set(panes.values())) == 2
        mine.say(type="seek", time_s=60.0)
        until(lambda: mine.hear("at")["time_s"] == 60.0, "the moment asked for")
        for path in panes.values():
            page = live.http.get(path)
            assert page.status_code == 200 and "document.hasFocus" in page.text
            with viewer(live, path) as socket:
                assert isinstance(socket.recv(timeout=PATIENCE_S), bytes)


def test_what_a_pane_is_sent_holds_the_tracks_the_ellipses_and_the_vehicles(live: Live, job: str):
    with session(live) as mine:
        path = mine.show(job, "nekf")["nekf"]
        mine.say(type="seek", time_s=100.0)
        until(lambda: mine.hear("at")["time_s"] == 100.0, "the moment asked for")
        server = live.app.state.site.scenes.panes[path.split("/")[2]].server
        for name in (
            "/surface",
            "/truth",
            "/trails",
            "/ellipses",
            "/present",
            "/rays",
            "/vehicle/0",
            "/vehicle/1/name",
        ):
            assert server.scene.get_handle_by_name(name) is not None, name
        trail = server.scene.get_handle_by_name("/trails").points
        before = len(trail)
        mine.say(type="seek", time_s=20.0)
        until(lambda: mine.hear("at")["time_s"] == 20.0, "the moment asked for")
        assert 0 < len(server.scene.get_handle_by_name("/trails").points) < before


def test_the_panes_of_a_running_job_grow(live: Live):
    with session(live) as mine:
        id = live.submit(SHORT | {"set": {"duration_s": 600}, "trials": 100})["id"]
        mine.show(id, "cekf")
        times = [mine.hear("at")["time_s"]]
        until(lambda: times.append(mine.hear("at")["time_s"]) or times[-1] == 600.0, "the last estimate")
        assert times == sorted(times)
        live.finished(id)


def test_the_panes_of_a_running_job_stay_when_its_beliefs_by_sound_arrive(live: Live):
    """The chart is made anew with what is believed: the same again where nothing lies outside of it."""
    with session(live) as mine:
        changes = {"trials": 2, "duration_s": 60, "arrays.count": 3}
        id = live.submit({"scenario": "sas-two-modes", "algorithms": ["sas_static"], "set": changes})["id"]
        mine.show(id, "sas_static")
        live.finished(id)
        (pane,) = live.app.state.site.scenes.panes.values()

        def drawn() -> bool:
            mine.say(type="seek", time_s=60.0)
            mine.hear("at")
            lines = pane.server.scene.get_handle_by_name("/sound/density")
            return lines is not None and len(lines.points) > 1

        until(drawn, "lines of density")


def test_a_viewer_may_move_its_camera_and_nothing_else(live: Live, job: str):
    assert relay.permitted(camera(position=(1.0, 2.0, 3.0)))
    for place in ((1.0, 2.0), (1.0, 2.0, float("nan")), (1.0, 2.0, "x"), "abc"):
        assert not relay.permitted(camera(position=place))  # type: ignore[arg-type]
    for kind in (
        "ShareUrlRequest",
        "ShareUrlDisconnect",
        "GuiUpdateMessage",
        "FileTransferStartUpload",
        "ViewerCameraMessage",
        None,
        1,
    ):
        assert not relay.permitted(msgspec.msgpack.encode({"type": kind}))
    for junk in (b"", b"\xc1", b"\x91" * 5000, msgspec.msgpack.encode([1]), msgspec.msgpack.encode("x")):
        assert not relay.permitted(junk)


def test_a_request_for_a_public_tunnel_does_not_get_through(live: Live, job: str, monkeypatch: pytest.MonkeyPatch):
    asked: list[str] = []
    monkeypatch.setattr(viser.ViserServer, "request_share_url", lambda self: asked.append("tunnel"))
    with session(live) as mine:
        path = mine.show(job, "cekf")["cekf"]
        server = live.app.state.site.scenes.panes[path.split("/")[2]].server
        with viewer(live, path) as socket:
            socket.recv(timeout=PATIENCE_S)
            socket.send(camera(position=(3.0, 3.0, 3.0)))
            until(lambda: server.get_clients(), "the viewer")
            socket.send(msgspec.msgpack.encode({"type": "ShareUrlRequest"}))
            socket.send(camera(position=(1.0, 2.0, 3.0)))
            (client,) = server.get_clients().values()
            until(lambda: tuple(client.camera.position) == (1.0, 2.0, 3.0), "the camera, sent after the request")
    assert asked == []


def camera(position: tuple[float, float, float]) -> bytes:
    message = {
        "type": "ViewerCameraMessage",
        "wxyz": (1.0, 0.0, 0.0, 0.0),
        "position": position,
        "fov": 1.0,
        "near": 0.01,
        "far": 1000.0,
        "image_height": 100,
        "image_width": 100,
        "look_at": (0.0, 0.0, 0.0),
        "up_direction": (0.0, 0.0, 1.0),
    }
    return msgspec.msgpack.encode(message)


def test_the_other_panes_follow_the_camera_of_one(live: Live, job: str):
    start, place = OBLIQUE[:3].tolist(), [4.0, 5.0, 6.0]
    with session(live) as mine:
        panes = mine.show(job, "cekf", "nekf")
        servers = [live.app.state.site.scenes.panes[p.split("/")[2]].server for p in panes.values()]
        with viewer(live, panes["cekf"]) as one, viewer(live, panes["nekf"]) as other:
            clients = []
            for socket, server in ((one, servers[0]), (other, servers[1])):
                socket.send(camera(position=(3.0, 3.0, 3.0)))
                clients += until(lambda server=server: list(server.get_clients().values()), "the viewer")
            for client in clients:
                until(lambda client=client: client.camera.position.tolist() == start, "the common start")

            def dragged() -> bool:
                """A viewer is heard once it has been seen where it was sent to."""
                for there in (start, place):
                    one.send(camera(position=tuple(there)))
                    time.sleep(0.1)
                return clients[1].camera.position.tolist() == place

            until(dragged, "the other pane's camera")


@pytest.mark.parametrize("height", [9.0, -9.0])
@pytest.mark.parametrize("heading_deg", [0.0, 75.0, 180.0, 290.0])
def test_a_view_from_straight_above_or_below_keeps_its_heading(heading_deg: float, height: float):
    heading = np.array([np.sin(np.radians(heading_deg)), np.cos(np.radians(heading_deg)), 0.0])
    target, forward = np.array([2.0, -3.0, 0.5]), np.array([0.0, 0.0, -np.sign(height)])
    axes = np.column_stack([np.cross(forward, heading), -heading, forward])
    wxyz = Rotation.from_matrix(axes).as_quat(scalar_first=True)
    pose = pose_of(target + [0.0, 0.0, height], target, wxyz)
    assert np.abs(pose - [*target + [0.0, 0.0, height], *target]).max() < 0.1, "next to where it is"
    looking = pose[3:] - pose[:3]
    upright = [0.0, 0.0, 1.0] - looking * looking[2] / (looking @ looking)
    np.testing.assert_allclose(upright[:2] / np.linalg.norm(upright[:2]), heading[:2], atol=1e-6)
    aside = target + [1.0, -2.0, height]
    np.testing.assert_array_equal(pose_of(aside, target, wxyz), [*aside, *target])


def test_panes_close_with_their_session(live: Live, job: str):
    with session(live) as mine:
        path = mine.show(job, "cekf")["cekf"]
        assert live.http.get(path).status_code == 200
    until(lambda: live.http.get(path).status_code == 404, "the pane's end")
    with pytest.raises((InvalidStatus, ConnectionClosed)), viewer(live, path):
        pass
    assert live.http.get("/scenes/guess/").status_code == 404


def test_two_sessions_share_nothing(live: Live, job: str):
    with session(live) as mine, session(live) as yours:
        assert mine.show(job, "cekf")["cekf"] != yours.show(job, "cekf")["cekf"]


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        "3",
        '{"type": "dance"}',
        '{"type": "show"}',
        '{"type": "show", "job": "nosuchjob", "panes": []}',
        '{"type": "seek", "time_s": NaN}',
        '{"type": "seek", "time_s": "x"}',
        '{"type": "seek", "time_s": 1' + "0" * 400 + "}",
        '{"type": "camera", "pose": [0, 0, 0, 0, 0, 1' + "0" * 400 + "]}",
        '{"type": "options", "trails": 3}',
        '{"type": "options", "glitter": true}',
        '{"type": "options", "sigma": 4}',
        '{"type": "options", "depth": 1e9}',
        '{"type": "options", "colours": {"cekf": [1, 2]}}',
        '{"type": "camera", "pose": [1, 2, 3]}',
        '{"type": "camera", "pose": [1, 2, 3, 4, 5, 1e300]}',
        "[" * 5000,
    ],
)
def test_a_message_not_understood_is_answered_and_the_session_lives(live: Live, job: str, text: str):
    with session(live) as mine:
        mine.socket.send(text)
        answer = json.loads(mine.socket.recv(timeout=PATIENCE_S))
        assert answer["type"] == "error" and answer["detail"]
        assert mine.show(job, "cekf")


def test_panes_are_limited(live: Live, job: str):
    with session(live) as mine:
        mine.say(type="show", job=job, panes=[f"a{n}" for n in range(7)])
        assert "at most 6" in json.loads(mine.socket.recv(timeout=PATIENCE_S))["detail"]
        mine.say(type="show", job=job, panes=["teleportation"])
        assert "teleportation" in json.loads(mine.socket.recv(timeout=PATIENCE_S))["detail"]


def test_panes_are_limited_altogether_however_many_ask_at_once(live: Live):
    scenes = Sessions(replace(live.settings, panes_altogether=3), live.app.state.site.jobs)

    async def ask() -> list[Any]:
        answers = await asyncio.gather(*(scenes.add(2) for _ in range(4)), return_exceptions=True)
        for id in list(scenes.panes):
            await scenes.remove(id)
        return answers

    answers = asyncio.run(ask())
    refused = [a for a in answers if isinstance(a, Refusal)]
    assert len(refused) == 3 and all(r.status == 429 for r in refused)


def test_a_page_of_another_site_opens_no_session(live: Live):
    with pytest.raises(InvalidStatus), connect(f"{live.ws}/api/scenes/session", origin="http://evil.example"):
        pass


def test_the_camera_goes_along_with_the_vehicle_followed_and_looks_from_above(live: Live, job: str):
    with session(live) as mine:
        path = mine.show(job, "cekf")["cekf"]
        server = live.app.state.site.scenes.panes[path.split("/")[2]].server
        with viewer(live, path) as socket:
            socket.send(camera(position=(3.0, 3.0, 3.0)))
            until(lambda: server.get_clients(), "the viewer")
            (client,) = server.get_clients().values()
            mine.say(type="options", top=True)
            until(lambda: tuple(client.camera.position) == tuple(ABOVE[:3]), "the view from above")
            mine.say(type="options", follow="scout")
            mine.say(type="seek", time_s=100.0)
            until(lambda: mine.hear("at")["time_s"] == 100.0, "the moment asked for")
            until(lambda: abs(client.camera.look_at[0]) > 0.1, "the vehicle in the middle")
            assert client.camera.position[0] == pytest.approx(client.camera.look_at[0])


def pane_of(live: Live, path: str):
    return live.app.state.site.scenes.panes[path.split("/")[2]].server


#: Moments that are asked for once only.
MOMENTS = itertools.count(100.0, 0.25)


def drawn(live: Live, mine, path: str, node: str, **options):
    """A node's points once the panes have been drawn with these options."""
    moment = next(MOMENTS)
    mine.say(type="options", **options)
    mine.say(type="seek", time_s=moment)
    until(lambda: mine.hear("at")["time_s"] == moment, "the moment asked for")
    return pane_of(live, path).scene.get_handle_by_name(node).points


def test_algorithms_are_laid_over_each_other_in_their_colours(live: Live, job: str):
    with session(live) as mine:
        path = mine.show(job, "overlay")["overlay"]
        one = drawn(live, mine, path, "/present", colours={"cekf": [200, 0, 0]})
        both = drawn(live, mine, path, "/present", colours={"cekf": [200, 0, 0], "nekf": [0, 0, 200]})
        assert len(both) > 1.5 * len(one)
        tints = pane_of(live, path).scene.get_handle_by_name("/present").colors.reshape(-1, 3)
        assert {(147, 0, 0), (0, 0, 147)} <= {tuple(c) for c in tints.tolist()}


def test_ellipses_have_the_size_asked_for(live: Live, job: str):
    with session(live) as mine:
        path = mine.show(job, "dead_reckoning")["dead_reckoning"]
        width = {}
        for sigma in (1, 3):
            points = drawn(live, mine, path, "/present", sigma=sigma)
            width[sigma] = float(np.ptp(points[:24, 0, 0]))
        assert width[3] == pytest.approx(3 * width[1], rel=1e-3)


def test_all_trials_are_a_cloud_with_its_envelope_and_densities(live: Live):
    id = live.done(SHORT | {"trials": 40})["id"]
    with session(live) as mine:
        path = mine.show(id, "cekf")["cekf"]
        assert len(drawn(live, mine, path, "/trials/cloud", cloud=True)) == 2 * 40
        scene = pane_of(live, path).scene
        assert len(scene.get_handle_by_name("/trials/envelope").points) > 24
        assert len(drawn(live, mine, path, "/trials/density", contours=True)) > 24
        assert len(drawn(live, mine, path, "/trials/cloud", cloud=False, contours=False)) == 1


def test_depth_and_dark_water_are_staged_again(live: Live, job: str):
    with session(live) as mine:
        path = mine.show(job, "cekf")["cekf"]
        drawn(live, mine, path, "/trails")
        depth = {}
        for stretch in (1.0, 4.0):
            drawn(live, mine, path, "/trails", depth=stretch, dark=True)
            depth[stretch] = float(pane_of(live, path).scene.get_handle_by_name("/vehicle/0").position[2])
        assert depth[4.0] == pytest.approx(4 * depth[1.0])
        grid = pane_of(live, path).scene.get_handle_by_name("/surface")
        assert tuple(grid.cell_color) == palette.DARK.grid
        assert "depths × 4" in pane_of(live, path).scene.get_handle_by_name("/bearings/scale").text


def test_free_cameras_do_not_follow_and_a_camera_at_rest_is_told(live: Live, job: str):
    with session(live) as mine:
        panes = mine.show(job, "cekf", "nekf")
        servers = [pane_of(live, p) for p in panes.values()]
        mine.say(type="options", linked=False)
        with viewer(live, panes["cekf"]) as one, viewer(live, panes["nekf"]) as other:
            clients = []
            for socket, server in ((one, servers[0]), (other, servers[1])):
                socket.send(camera(position=(3.0, 3.0, 3.0)))
                clients += until(lambda server=server: list(server.get_clients().values()), "the viewer")
            start = OBLIQUE[:3].tolist()
            for client in clients:
                until(lambda client=client: client.camera.position.tolist() == start, "the common start")

            def told() -> bool:
                """A viewer is heard once it has been seen where it was sent to."""
                for place in (start, [4.0, 5.0, 6.0]):
                    one.send(camera(position=tuple(place)))
                    time.sleep(0.1)
                with suppress(TimeoutError):
                    return mine.hear("camera", patience_s=1.0)["pose"][:3] == [4.0, 5.0, 6.0]
                return False

            until(told, "the camera's place")
            assert clients[1].camera.position.tolist() == start
            mine.say(type="options", linked=True)
            until(lambda: clients[1].camera.position.tolist() == [4.0, 5.0, 6.0], "the other pane's camera")
            mine.say(type="camera", pose=[1.0, 2.0, 9.0, 0.0, 0.0, 0.0])
            until(lambda: clients[0].camera.position.tolist() == [1.0, 2.0, 9.0], "the place told by the page")
