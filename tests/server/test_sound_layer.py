"""What a pane draws of localization by sound, against the estimator's own beliefs and the array's geometry."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from engine.registry import algorithm, silent
from engine.slam.mission import fly
from server.scenes import palette, sound
from server.scenes.footage import Footage, Track
from server.scenes.geometry import chart
from tests.engine.slam.missions import scenario

NAMES = ["auv", "beacon"]
CHART = chart(np.array([[-100.0, -100.0], [100.0, 100.0]]), 0.0)


@pytest.fixture(scope="module")
def told():
    """A run of straight arrays that pass a beacon, with what it tells as it is after a file."""
    path = {"kind": "waypoints", "points_m": [[-30.0, -40.0], [30.0, -40.0]], "speed_mps": 1.0}
    tables = {"vehicle": {"path": path}, "ranging": {"count": 0}, "arrays": {"count": 2}}
    mission = fly(scenario(duration_s=45.0, odometry={"drift_mps": 0.02}, **tables), [0])
    tracks = algorithm("sas_static").run(mission, silent)
    return mission, tracks, json.loads(json.dumps(tracks.graph))


def drawing(told, moment_s: float) -> sound.Drawing:
    return sound.drawing(sound.read(told[2]), moment_s, CHART, palette.LIGHT, NAMES, {"beacon": 0.0}, 200.0)


def unplaced(points: np.ndarray) -> np.ndarray:
    """Back from the scene to metres."""
    return points[..., :2] / CHART.scale + CHART.centre


def test_nothing_is_drawn_before_the_first_measurement(told):
    first = told[2]["moments"][0]["time_s"]
    drawn = drawing(told, first - 1.0)
    assert not drawn.levels and not drawn.beams
    assert drawing(told, 0.0) == sound.Drawing([], [], [], [], [], [])


def test_the_drifted_track_follows_odometry_from_fix_to_fix(told):
    mission = told[0]
    log = mission.log(0)
    expected = [log.fix_m[0]]
    for k, step in enumerate(log.steps, start=1):
        expected.append(log.fix_m[k] if k in log.fixed else expected[-1] + step)
    read = sound.read(told[2])
    np.testing.assert_allclose(read.drifted, expected)
    drawn = drawing(told, mission.time_s[20])
    ends = unplaced(drawn.drifts[0])
    assert np.abs(ends[0, 0] - read.drifted[0]).max() < 1e-6
    assert np.linalg.norm(ends[:, 1] - read.drifted[20], axis=1).min() < 10.0
    assert np.linalg.norm(ends[:, 1] - read.drifted[-1], axis=1).min() > 10.0


def test_one_straight_array_draws_both_mirror_images_and_the_beam_points_at_them(told):
    moment = told[2]["moments"][0]
    drawn = drawing(told, moment["time_s"])
    assert len(drawn.levels) == len(sound.SHARES)
    widest = unplaced(np.concatenate(drawn.levels[0]))
    beacon = np.array([3.0, -2.0])
    for image in (beacon, np.array([3.0, -78.0])):
        assert np.linalg.norm(widest - image, axis=1).min() < 6.0
    rim = unplaced(drawn.beams[0][:, 0])
    centre = np.mean(moment["array"]["places_m"], axis=0)
    reach = np.linalg.norm(rim - centre, axis=1)
    strongest = (rim - centre)[reach.argmax()] / reach.max()
    towards = (beacon - centre) / np.linalg.norm(beacon - centre)
    assert np.abs(strongest @ [1, 0]) == pytest.approx(abs(towards[0]), abs=0.1)
    assert reach.max() == pytest.approx(sound.BEAM * 200.0, rel=1e-3)


def test_lines_hold_their_share_of_the_belief(told):
    """The innermost line is about the densest places: all of it is inside the outermost one's extent."""
    moment = told[2]["moments"][-1]
    drawn = drawing(told, moment["time_s"])
    outer, inner = (unplaced(np.concatenate(drawn.levels[i])) for i in (0, -1))
    assert (inner.min(0) >= outer.min(0) - 1e-9).all() and (inner.max(0) <= outer.max(0) + 1e-9).all()


def test_the_densest_place_is_one_of_those_believed_in(told):
    found = sound.read(told[2])
    assert found.modes(-1.0) == {}
    mode = found.modes(float(found.time_s[-1]))["beacon"]
    assert np.linalg.norm(np.concatenate(found.clouds()) - mode, axis=1).min() < 1.0


def test_arrays_before_stay_faint(told):
    drawn = drawing(told, told[2]["moments"][-1]["time_s"])
    assert len(drawn.beams) == 4
    assert drawn.beam_colours[2] == palette.LIGHT.truth != drawn.beam_colours[0]


def test_the_story_names_what_was_added_and_reused(told):
    first, last = told[2]["moments"]
    assert [f for f in first["factors"] if f[2]] == [[0, 7, "beacon"]]
    assert [f for f in last["factors"] if f[2]] == [[38, 45, "beacon"]]
    assert [0, 0, None] in first["factors"] and [45, 45, None] in last["factors"]
    assert not any(first["tree"]["reused"])
    tree = last["tree"]
    assert len(tree["parents"]) == len(tree["cliques"]) == len(tree["reused"])
    for clique, parent in zip(tree["cliques"], tree["parents"]):
        message = clique.partition(" | ")[2].split()
        assert (parent < 0) == (not message)
        assert set(message) <= set(tree["cliques"][parent].replace("|", "").split())


def test_the_story_tells_errors_against_the_truth(told):
    """Of beacons by mean and densest place, of the poses until then on average; the last as the tracks have it."""
    mission, tracks, story = told
    errors = [m["errors"] for m in story["moments"]]
    belief, track = tracks.beliefs["beacon"], tracks.beliefs["auv"]
    off = np.linalg.norm(belief.mean[0, -1] - mission.truth["beacon"][0, -1])
    assert errors[-1]["beacons"]["beacon"]["mean_m"] == pytest.approx(off, abs=0.02)
    mode = tracks.series["mode_error_m/beacon"].value[0, -1]
    assert errors[-1]["beacons"]["beacon"]["mode_m"] == pytest.approx(mode, abs=0.02)
    poses = np.linalg.norm(track.mean[0] - mission.truth["auv"][0], axis=-1).mean()
    assert errors[-1]["poses_m"] == pytest.approx(poses, abs=0.02)
    assert errors[0]["beacons"]["beacon"]["mean_m"] > 20.0, "between two mirror images"


def test_a_wild_belief_does_not_shrink_the_scene(told):
    mission, tracks, story = told
    found = sound.read(story)
    cloud = {"points_m": [[4000.0, 0.0]] * 4, "bandwidth_m": [1.0, 1.0], "mode_m": [4000.0, 0.0]}
    wild = dataclasses.replace(found, moments=[{**found.moments[0], "beacons": {"beacon": cloud}}, *found.moments[1:]])
    truth = {name: place[0] for name, place in mission.truth.items()}
    mean = {"beacon": np.array([[0.0, 0.0], [-3000.0, 0.0], [np.nan, 0.0]])}
    tracks = {"sas_static": Track(mean=mean)}
    points = Footage(mission.time_s, [], truth, [], tracks, sounds={"sas_static": wild}).points()
    assert np.isfinite(points).all() and np.abs(points).max() < 300.0
    mirrored = Footage(mission.time_s, [], truth, [], {}, sounds={"sas_static": found}).points()
    assert np.linalg.norm(mirrored - [3.0, -78.0], axis=1).min() < 6.0, "the mirror image is shown"


@pytest.mark.parametrize("name", ["sas_dynamic", "range_only"])
def test_others_tell_their_measurements_too(name):
    mission = fly(scenario(duration_s=45.0, ranging={"count": 5}, arrays={"count": 2}), [0])
    moments = algorithm(name).run(mission, silent).graph["moments"]
    told = [f for m in moments for f in m["factors"]]
    assert sum(f[2] == "beacon" for f in told) == (2 if name == "sas_dynamic" else 5)
    assert sorted(f[:2] for f in told if f[2] is None) == [[0, 0], [45, 45]]


@pytest.mark.parametrize(
    "name", ["range_only", "gaussian_range", "sas_all_priors", "sas_static", "sas_dynamic", "beamform_only"]
)
def test_one_that_hears_nothing_reckons_on_and_says_so(name):
    counts = {"count": 3} if "range" not in name else {"count": 0}
    mission = fly(scenario(duration_s=45.0, ranging=counts, arrays={"count": 0 if counts["count"] else 2}), [0, 1])
    tracks = algorithm(name).run(mission, silent)
    assert set(tracks.beliefs) == {"auv"} and np.isfinite(tracks.beliefs["auv"].cov).all()
    assert any("beacon was not heard" in str(note) for note in tracks.notes)


def test_what_is_streamed_has_a_row_of_every_subject_at_every_moment(told):
    partials = []
    algorithm("sas_static").run(told[0], lambda _, partial: partials.append(partial))
    for partial in partials:
        assert set(partial["mean"]) == set(partial["cov"]) == set(NAMES)
        assert all(len(rows) == len(partial["time_s"]) for what in ("mean", "cov") for rows in partial[what].values())
    assert [p["time_s"][0] for p in partials] == [m["time_s"] for m in told[2]["moments"]]
