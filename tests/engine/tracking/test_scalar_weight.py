"""The weights of covariance intersection and its inverse, against a fine grid."""

from __future__ import annotations

import numpy as np
import pytest

from engine.tracking.covariance_intersection import weight as intersection_weight
from engine.tracking.inverse_covariance_intersection import weight as inverse_weight

GRID = np.linspace(0, 1, 20_001)[:, None, None]


def spd(rng: np.random.Generator, n: int) -> np.ndarray:
    root = rng.normal(size=(n, n))
    return root @ root.T + 0.02 * np.eye(n)


@pytest.mark.parametrize("seed", range(20))
def test_no_weight_makes_the_volume_smaller(seed):
    rng = np.random.default_rng(seed)
    n = 1 + seed % 3
    P1, P2 = spd(rng, n), spd(rng, n)
    A, B = np.linalg.inv(P1), np.linalg.inv(P2)
    for weight, information in (
        (intersection_weight, lambda w: w * A + (1 - w) * B),
        (inverse_weight, lambda w: A + B - np.linalg.inv(w * P1 + (1 - w) * P2)),
    ):
        found = np.linalg.slogdet(information(weight(P1, P2)))[1]
        assert found >= np.linalg.slogdet(information(GRID))[1].max() - 1e-12
        assert found <= np.linalg.slogdet(information(GRID))[1].max() + 1e-6


def test_equals_weigh_the_same():
    """Round-off does not choose between estimates of equal covariance."""
    P = np.array([[3.0, 1.0], [1.0, 2.0]])
    assert intersection_weight(P, P) == inverse_weight(P, P) == 0.5
