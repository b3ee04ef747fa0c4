"""The smoothers on whole missions: hand-made ones, and the recorded logs."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine import runner
from engine.evaluation.consistency import judge, nees
from engine.navigation.mission import prepare
from engine.registry import algorithms, silent
from engine.scenario import library
from engine.smoothing.fidelity import curves
from engine.smoothing.fleet import make_nodes
from engine.smoothing.paull import Options as PaullOptions
from engine.smoothing.paull import make_nodes as make_paull
from engine.smoothing.paull import packet_size
from engine.smoothing.sender import choose_best, choose_last
from engine.tracks import Tracks

sys.path.insert(0, str(Path(__file__).parent))
from chainlab import surfacing_mission
from loglab import make_log, make_mission

EVERYONE = [(a, b) for a in range(3) for b in range(3) if a != b]
ALL = ["k_last", "k_best", "paull", "centralized_smoother"]


def run(mission, name: str) -> Tracks:
    return algorithms()[name].run(mission, silent)


def sigma(tracks: Tracks, subject: str) -> np.ndarray:
    return (np.linalg.det(tracks.beliefs[subject].cov) ** 0.25).mean(axis=0)


def test_one_silent_client_knows_in_the_end_what_the_centralized_smoother_knows():
    """Without fixes and losses the reconstructed chain is exact, and nobody else measured a range: the same to 5 cm,
    and in uncertainty to the velocities dropped at launches."""
    mission = make_mission([(0, 1)], trials=6, seed=3, fixed_by_gps=())
    ours, benchmark = run(mission, "k_best").beliefs["v1"], run(mission, "centralized_smoother").beliefs["v1"]
    np.testing.assert_allclose(ours.mean[:, -1], benchmark.mean[:, -1], atol=0.05)
    np.testing.assert_allclose(ours.cov[:, -1], benchmark.cov[:, -1], rtol=0.02, atol=0.02)


@pytest.mark.parametrize("name", ALL)
def test_no_smoother_is_overconfident_over_a_lossy_channel(name):
    mission = make_mission(EVERYONE, vehicles=3, trials=12, loss=0.4, seed=5)
    tracks = run(mission, name)
    for subject in ("v0", "v1", "v2"):
        assert judge(nees(mission.truth[subject], tracks.beliefs[subject])).name != "overconfident"
        assert np.linalg.eigvalsh(tracks.beliefs[subject].cov).min() > 0


def test_sharing_priors_orders_the_methods_as_in_the_paper():
    """A vehicle that surfaces guides one that does not: centralized, k-best, k-last, Paull (W15 Fig. 6, trial 2)."""
    mission = surfacing_mission(trials=8, loss=0.5, seed=11)
    spread = {name: sigma(run(mission, name), "v1").mean() for name in ALL}
    assert spread["centralized_smoother"] < spread["k_best"] <= 1.001 * spread["k_last"] < spread["paull"]


def test_ranges_both_ways_help_paull_where_there_are_no_priors():
    """W15 Fig. 6, trial 1."""
    mission = surfacing_mission((), trials=8, loss=0.4, seed=2)
    spread = {name: sigma(run(mission, name), "v1").mean() for name in ALL}
    assert spread["centralized_smoother"] < spread["paull"] < spread["k_best"]
    assert abs(spread["k_best"] / spread["k_last"] - 1) < 1e-9


def test_packets_are_one_frame_while_paulls_grow_with_the_network():
    """W15 section V-A: for three vehicles 4 composed links, 2 ranges and a prior against 3 links and 2 priors."""
    mission = make_mission(EVERYONE, vehicles=3, trials=2)
    assert run(mission, "k_best").packets.largest_bytes == 64
    assert packet_size(3) == {
        "links": 4,
        "ranges": 2,
        "priors": 1,
        "bytes": run(mission, "paull").packets.largest_bytes,
    }
    sizes = [packet_size(n)["bytes"] for n in range(2, 11)]
    assert np.all(np.diff(np.diff(sizes)) <= 1) and sizes[-1] > 200


def test_an_unknown_sound_speed_is_estimated():
    log = make_log([(0, 1)], trials=4, seed=1)
    mission = prepare(replace(log, sound_speed_sigma_mps=15.0))
    for name in ("k_last", "centralized_smoother"):
        assert judge(nees(mission.truth["v1"], run(mission, name).beliefs["v1"])).name != "overconfident"


def test_reconstruction_over_reception_rates_keeps_the_papers_order():
    """Fig. 5 on two chains: equal without priors; with them k-best no worse than k-last, both far below Paull."""
    makers = lambda mission: {  # noqa: E731
        "k_last": make_nodes(mission, 2, choose_last),
        "k_best": make_nodes(mission, 2, choose_best(0.5)),
        "paull": make_paull(mission, PaullOptions()),
    }
    rates = (0.1, 0.4, 0.7, 1.0)
    many = tuple((t, t + 20.0) for t in (100.0, 250.0, 400.0, 550.0, 700.0))
    mission = surfacing_mission(many, trials=1)
    found = curves(mission, makers(mission), rates, 30, np.random.default_rng(0))["algorithms"]
    with_priors = {name: found[name]["v0"]["kld"] for name in found}
    without = {name: np.array(found[name]["v1"]["kld"]["mean"]) for name in found}
    last, best = (np.array(with_priors[name]["mean"]) for name in ("k_last", "k_best"))
    assert (best <= np.array(with_priors["k_last"]["high"])).all()
    assert last[-1] == pytest.approx(best[-1])
    assert (10 * np.maximum(best, last)[1:] < np.array(with_priors["paull"]["mean"])[1:]).all()
    np.testing.assert_allclose(without["k_last"], without["k_best"], rtol=1e-9)
    assert max(value.max() for value in without.values()) < 0.05


@pytest.mark.recorded
@pytest.mark.parametrize(
    ("scenario", "log", "subject", "rmse_m"),
    [("marine-diver", "marine", "diver", 3.5), ("plaza1-two-beacons", "plaza1", "robot", 0.5)],
)
def test_the_centralized_smoother_on_recorded_logs(recorded_data, scenario, log, subject, rmse_m):
    recorded_data(log)
    mission = runner.prepare(library.find(scenario).model_copy(update={"trials": 1}), (0,))
    belief = run(mission, "centralized_smoother").beliefs[subject]
    error = np.linalg.norm(belief.mean[0] - mission.truth[subject][0], axis=-1)
    assert np.sqrt(np.nanmean(error**2)) < rmse_m


@pytest.mark.recorded
def test_gross_ranges_of_a_real_auv_are_refused(recorded_data):
    """GOATS has no independent truth: what is left after refusing must look like the stated noise."""
    recorded_data("goats")
    mission = runner.prepare(library.find("goats-auv").model_copy(update={"trials": 1}), (0,))
    ranges = run(mission, "centralized_smoother").innovations["auv"]
    refused = ~ranges.accepted[0]
    assert 50 < refused.sum() < 300
    assert np.abs(ranges.value[0, refused]).max() > 100
    nis = ranges.value[0, ~refused] ** 2 / ranges.variance[0, ~refused]
    assert 0.5 < nis.mean() < 1.2


@pytest.mark.recorded
def test_a_diver_smooths_what_a_beacon_tells_it(recorded_data):
    """The one-client, one-server case with real ranges, while it happens: no worse than the centralized filter."""
    recorded_data("marine")
    mission = runner.prepare(library.find("marine-diver").model_copy(update={"trials": 1}), (0,))
    truth = mission.truth["diver"][0]
    rmse = {
        name: np.sqrt(np.nanmean(((run(mission, name).beliefs["diver"].mean[0] - truth) ** 2).sum(-1)))
        for name in ("k_last", "cekf")
    }
    assert rmse["k_last"] < 1.05 * rmse["cekf"] < 4.5


@pytest.mark.recorded
def test_robots_in_se2_keep_every_range_they_measure(recorded_data):
    """The first minutes of five robots: fixes between launches tie headings to places, and leave a direction free."""
    recorded_data("mrclam6")
    short = library.find("mrclam6-five-robots").model_copy(update={"trials": 1, "duration_s": 150.0, "claims": []})
    mission = runner.prepare(short, (0,))
    tracks = run(mission, "k_last")
    assert not [note for note in tracks.notes if "left out" in str(note)]
    for subject, belief in tracks.beliefs.items():
        error = np.linalg.norm(belief.mean[0] - mission.truth[subject][0], axis=-1)
        assert np.sqrt(np.nanmean(error**2)) < 1.5
