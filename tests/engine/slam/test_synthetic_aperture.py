"""The SAS factor: draws both ways, its expansion about the peak, and its density."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from engine.acoustics.matched_filter import matched_filter
from engine.acoustics.synthetic_array import synthesize
from engine.scenario import library, toml
from engine.slam import sas_dynamic
from engine.slam.building import growths
from engine.slam.factors.factor import Factor
from engine.slam.factors.synthetic_aperture import SyntheticAperture, synthetic_aperture
from engine.slam.mission import fly
from engine.slam.solver import Solver
from tests.engine.acoustics.waters import SONAR, at, heard, line

ELEMENTS = 8
PLACES = line(ELEMENTS)
BEACON = at(60.0, 1.1)


@pytest.fixture(scope="module")
def factor() -> SyntheticAperture:
    rng = np.random.default_rng(1)
    array = synthesize(matched_filter(heard(PLACES, BEACON, rng, snr_db=20.0), SONAR), PLACES, SONAR)
    return synthetic_aperture(tuple(f"x{i}" for i in range(ELEMENTS)), "beacon", array, 1.0, 0.2)


def values(count: int, dimension: int = 2) -> list[np.ndarray]:
    """The true poses and beacon, `count` times; what a pose has beside its place is 7."""
    poses = [np.concatenate([p, np.full(dimension - 2, 7.0)]) for p in PLACES]
    return [np.tile(v, (count, 1)) for v in [*poses, BEACON]]


def test_at_its_peak_the_density_curves_as_its_residual_says(factor):
    """Second differences along 300 random directions of all variables, extrapolated to a step of zero."""
    rng = np.random.default_rng(2)
    here = values(300)
    way = [rng.standard_normal(v.shape) for v in here]
    _, jacobians = factor.linearize(*here)
    slope = sum(np.einsum("nij,nj->ni", J, d) for J, d in zip(jacobians, way, strict=True))

    def bend(step: float) -> np.ndarray:
        low, mid, high = (
            factor.log_density(*[v + sign * step * d for v, d in zip(here, way, strict=True)]) for sign in (-1, 0, 1)
        )
        return -(high - 2 * mid + low) / step**2

    near, far = bend(0.03), bend(0.05)
    exact = near + (near - far) * 0.03**2 / (0.05**2 - 0.03**2)
    said = np.square(slope).sum(-1)
    assert said.mean() == pytest.approx(exact.mean(), rel=0.1)
    assert np.corrcoef(said, exact)[0, 1] > 0.9


@pytest.mark.parametrize("dimension", [2, 4])
def test_jacobians_are_those_of_the_residual(factor, dimension):
    rng = np.random.default_rng(3)
    here = [v + 0.02 * rng.standard_normal(v.shape) for v in values(3, dimension)]
    e, jacobians = factor.linearize(*here)
    _, numeric = Factor.linearize(factor, *here)
    information = [np.swapaxes(J, -1, -2) @ J for J in jacobians]
    for exact, difference in zip(information, [np.swapaxes(J, -1, -2) @ J for J in numeric], strict=True):
        np.testing.assert_allclose(exact, difference, atol=1e-3 * np.abs(difference).max())
    assert e.shape == (3, ELEMENTS + 1)


def test_forward_draws_go_around_at_the_range_and_tell_their_density(factor):
    rng = np.random.default_rng(4)
    strata = (np.arange(4000) + 0.5) / 4000
    drawn = factor.sample(ELEMENTS, values(4000), strata, rng)
    bearing = np.arctan2(drawn[:, 1], drawn[:, 0]) % (2 * np.pi)
    assert np.all(np.diff(bearing) > -1e-9)
    assert abs(np.linalg.norm(drawn, axis=1).mean() - 60.0) < 0.5
    # Over draws, f / q is an estimate of the integral of f: here of a Gaussian on the ring, which is 1.
    told = factor.log_proposal(ELEMENTS, [*values(4000)[:-1], drawn])
    spread = np.hypot(0.15, 1.0)
    centre = at(factor.array.focus_m, 0.4)
    wanted = np.exp(-0.5 * np.square(drawn - centre).sum(-1) / spread**2) / (2 * np.pi * spread**2)
    normal = np.exp(told) / ((2 * np.pi) ** 1.5 * spread)
    assert np.mean(wanted / normal) == pytest.approx(1.0, abs=0.1)
    assert factor.log_proposal(0, values(3)) is None


def test_backward_draws_an_element_at_its_range_and_leaves_the_rest_of_its_pose(factor):
    rng = np.random.default_rng(5)
    here = values(500, 4)
    here[2][:, :2] += 0.8 * rng.standard_normal((500, 2))
    drawn = factor.sample(2, here, rng.random(500), rng)
    truth = np.linalg.norm(PLACES[2] - BEACON)
    off = np.linalg.norm(drawn[:, :2] - BEACON, axis=1) - truth
    assert np.mean(np.abs(off) < 0.37) > 0.9
    np.testing.assert_array_equal(drawn[:, 2:], 7.0)
    before, after = here[2][:, :2] - BEACON, drawn[:, :2] - BEACON
    assert np.allclose(before[:, 0] * after[:, 1], before[:, 1] * after[:, 0]), "the bearing stays"


def test_the_density_prefers_the_beacon_and_its_mirror_image(factor):
    look = np.radians(np.arange(0, 360, 2))
    ring = np.stack([60 * np.cos(look), 60 * np.sin(look)], axis=-1)
    level = factor.log_density(*values(len(ring))[:-1], ring)
    best = np.degrees(look[np.argsort(level)[-2:]])
    assert sorted(best) == pytest.approx([63, 297], abs=1.5)


def test_an_array_has_as_many_poses_as_records(factor):
    with pytest.raises(ValueError, match="8 elements cannot have 3 poses"):
        synthetic_aperture(("a", "b", "c"), "beacon", factor.array, 1.0, 0.2)


@pytest.mark.parametrize("trial", [5, 8])
def test_kernels_move_on_after_every_array(trial: int):
    """Poses between two fixes settle slowly; kernels whose evidence were taken before they have would never be left."""
    changes = {"arrays.count": 10, "fixes.count": 2, "ranging.count": 2, "options": {}}
    mission = fly(toml.override(library.find("cheung2019-drifting"), changes), [trial])
    solver = Solver(100, trial)
    for growth in islice(growths(mission.log(0), sas_dynamic.PLAN, mission.time_s, 0.0), 5):
        step = solver.extend(growth.kinds, growth.factors)
        assert np.isnan(step.accepted) or step.accepted > 0.05
        assert len(np.unique(solver.beliefs(["beacon"])["beacon"], axis=0)) > 50
