"""Tracking scenarios flown: independent trials, lossy links, and the paper's figures by way of the common runner."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from engine import runner
from engine.registry import algorithm, silent
from engine.scenario import library, toml
from engine.tracking import simulate
from engine.tracking.mission import fly
from engine.tracking.rules import RULES


def test_a_block_of_trials_is_those_trials_of_all():
    scenario = library.find("tracking-lossy-link")
    whole, part = fly(scenario, range(6)), fly(scenario, [3, 4])
    np.testing.assert_array_equal(whole.draws.target[3:5], part.draws.target)
    np.testing.assert_array_equal(whole.heard[3:5], part.heard)
    for a, b in zip(whole.draws.z, part.draws.z):
        np.testing.assert_array_equal(a[3:5], b)


def test_the_common_runner_meets_figure_6b():
    """Believed variances in closed form; the naive's actual one within the 99.9 % interval of its trials."""
    scenario = library.find("rui-chitre-steady-dangerous").model_copy(update={"trials": 300})
    told = runner.run(scenario, workers=1).to_json()["algorithms"]
    for name, variance in (
        ("single_sensor", 2.701562),
        ("centralized_fusion", 2.129956),
        ("distributed_fusion", 2.428719),
        ("naive_fusion", 0.788475),
    ):
        assert told[name]["subjects"]["target-first"]["final_sigma_m"] ** 2 == pytest.approx(variance, rel=1e-6)
    # x and y are independent, so 300 trials are 600 squares; RMSE is of the distance.
    square = told["naive_fusion"]["subjects"]["target-first"]["final_rmse_m"] ** 2 / 2
    low, high = 3.9123 * chi2.ppf([0.0005, 0.9995], 600) / 600
    assert low < square < high


@pytest.mark.parametrize("loss", [0.0, 0.3, 0.6, 0.9])
def test_state_vector_fusion_tracks_its_covariance_through_any_loss(loss):
    """Consistent at every node, and between the central filter and a node alone."""
    scenario = toml.override(library.find("tracking-lossy-link"), {"network.loss": loss, "duration_s": 20})
    trials = 400
    mission = fly(scenario, range(trials))
    tracks = {
        name: algorithm(name).run(mission, silent)
        for name in ("state_vector_fusion", "centralized_fusion", "single_sensor")
    }
    low, high = chi2.ppf([0.0005, 0.9995], 2 * trials) / trials
    for subject, truth in mission.truth.items():
        belief = tracks["state_vector_fusion"].beliefs[subject]
        error = (belief.mean - truth)[:, -1]
        nees = np.einsum("ti,tij,tj->t", error, np.linalg.inv(belief.cov[:, -1]), error)
        assert low < nees.mean() < high
        volume = {name: np.linalg.det(t.beliefs[subject].cov[:, -1]) for name, t in tracks.items()}
        assert np.all(volume["centralized_fusion"] <= volume["state_vector_fusion"] * (1 + 1e-9))
        assert np.all(volume["state_vector_fusion"] <= volume["single_sensor"] * (1 + 1e-9))


@pytest.mark.parametrize("name", ["covariance_intersection", "inverse_covariance_intersection"])
def test_conservative_fusions_stay_so_when_packets_are_lost(name):
    """The believed covariance covers the actual one of every trial's pattern of losses."""
    mission = fly(toml.override(library.find("tracking-lossy-link"), {"duration_s": 30}), range(60))
    answer = simulate.estimate(mission.model, mission.draws, RULES[name], mission.heard)
    assert np.linalg.eigvalsh(answer.believed - answer.actual).min() > -1e-9


@pytest.mark.parametrize("name", ["single_sensor", "centralized_fusion", *RULES])
def test_a_target_that_never_moves_is_tracked_for_long(name):
    """The naive's claims shrink by half each step, below what numbers hold, and stay numbers."""
    still = {"target.process_variance_m2": 0, "duration_s": 1200, "claims": []}
    mission = fly(toml.override(library.find("rui-chitre-steady-safe"), still), range(3))
    for belief in algorithm(name).run(mission, silent).beliefs.values():
        assert np.isfinite(belief.mean).all() and np.isfinite(belief.cov).all()
        assert np.linalg.eigvalsh(belief.cov).min() >= 0


def test_packets_are_counted_as_sent_and_heard():
    mission = fly(library.find("tracking-lossy-link"), range(20))
    packets = algorithm("naive_fusion").run(mission, silent).packets
    assert packets.sent == 20 * 80 * 3
    offdiagonal = ~np.eye(3, dtype=bool)
    assert packets.received == int(mission.heard[:, :, offdiagonal].sum())
    assert algorithm("single_sensor").run(mission, silent).packets.sent == 0
