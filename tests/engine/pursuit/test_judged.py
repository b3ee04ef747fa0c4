"""The update against Stone Soup's unscented filter."""

from __future__ import annotations

import numpy as np
import pytest
from stonesoup.base import Property
from stonesoup.models.measurement.nonlinear import NonLinearGaussianMeasurement
from stonesoup.types.array import StateVector, StateVectors
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.prediction import GaussianStatePrediction
from stonesoup.updater.kalman import UnscentedKalmanUpdater

from engine.gaussian.forms import Moments
from engine.pursuit.arrivals import update
from engine.pursuit.formation import inner, line, outer
from engine.pursuit.sigma_points import unscented

SIGMA = 0.2


class Differences(NonLinearGaussianMeasurement):
    """Differences of the arrivals at the second and third receiver to the first."""

    places: np.ndarray = Property()

    @property
    def ndim_meas(self) -> int:
        return 2

    def function(self, state, noise=False, **kwargs):
        points = np.atleast_2d(np.asarray(state.state_vector, float)[:2].T)
        distance = np.linalg.norm(points[:, None] - self.places, axis=-1)
        z = (distance[:, 1:] - distance[:, :1]).T
        return StateVectors(z) if z.shape[1] > 1 else StateVector(z)


@pytest.mark.parametrize("places", [inner(90.0), outer(90.0), line(75.0)], ids=["inner", "outer", "line"])
@pytest.mark.parametrize("spread_m", [1.0, 5.0, 20.0])
def test_an_update_is_that_of_stone_soups_unscented_filter(places, spread_m):
    """kappa = 0 for three dimensions, beta = 0: the plain rule of Julier and Uhlmann; R = sigma^2 (I + 1 1')."""
    rng = np.random.default_rng(11)
    root = np.diag([spread_m, 0.7 * spread_m, 0.5]) @ (np.eye(3) + 0.2 * rng.normal(size=(3, 3)))
    prior = Moments(np.array([2.0, -1.0, 0.8]), root @ root.T)
    arrivals = np.linalg.norm(places - [3.0, 1.0], axis=-1) + SIGMA * rng.standard_normal(3)
    ours, surprise = update(prior, arrivals, np.ones(3, bool), places, SIGMA, unscented)

    R = SIGMA**2 * (np.eye(2) + 1.0)
    model = Differences(ndim_state=3, mapping=(0, 1), noise_covar=R, places=places)
    prediction = GaussianStatePrediction(StateVector(prior.mean), prior.cov)
    detection = Detection(StateVector(arrivals[1:] - arrivals[0]), measurement_model=model)
    updater = UnscentedKalmanUpdater(model, alpha=1.0, beta=0.0, kappa=0.0)
    expected = updater.predict_measurement(prediction)
    theirs = updater.update(SingleHypothesis(prediction, detection, expected))
    np.testing.assert_allclose(ours.mean, np.ravel(theirs.state_vector).astype(float), atol=1e-8)
    np.testing.assert_allclose(ours.cov, np.asarray(theirs.covar, float), atol=1e-8)

    innovation = np.ravel(detection.state_vector - expected.state_vector).astype(float)
    nis = innovation @ np.linalg.solve(np.asarray(expected.covar, float), innovation)
    assert surprise.nis == pytest.approx(nis, rel=1e-9)
