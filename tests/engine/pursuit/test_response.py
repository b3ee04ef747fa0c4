"""The empirical transfer function against systems whose break is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter

from engine.pursuit.response import break_frequency, response


def lagged(turn: np.ndarray, step_s: float, gain: float, break_rps: float) -> np.ndarray:
    """A first-order lag, by Tustin's rule."""
    b, a = bilinear([gain * break_rps], [1.0, break_rps], fs=1 / step_s)
    return lfilter(b, a, turn, axis=1)


@pytest.mark.parametrize("break_rps", [0.02, 0.047, 0.08])
def test_the_break_of_a_first_order_lag_is_found(break_rps):
    rng = np.random.default_rng(2)
    turn = 0.1 * rng.standard_normal((60, 5400))
    moments = np.arange(0.0, 5400.0, 10.0)
    error = 30.0 + lagged(turn, 1.0, 40.0, break_rps)[:, ::10]
    found = response(turn, 1.0, moments, error)
    assert found is not None
    assert np.median(break_frequency(found)) == pytest.approx(break_rps, rel=0.15)
    low = found.smoothed[(found.frequency_rps > 0.25 * break_rps) & (found.frequency_rps < 0.5 * break_rps)]
    assert np.median(low) == pytest.approx(40.0, rel=0.2)


def test_missing_updates_leave_the_break_where_it_is():
    rng = np.random.default_rng(3)
    turn = 0.1 * rng.standard_normal((60, 5400))
    moments = np.arange(0.0, 5400.0, 10.0)
    error = lagged(turn, 1.0, 40.0, 0.03)[:, ::10]
    error[rng.random(error.shape) < 0.05] = np.nan
    found = response(turn, 1.0, moments, error)
    assert np.median(break_frequency(found)) == pytest.approx(0.03, rel=0.2)


def test_a_handful_of_updates_has_no_spectrum():
    turn = np.random.default_rng(4).standard_normal((2, 400))
    error = np.full((2, 14), 1.0)
    assert response(turn, 1.0, 28.0 * np.arange(14), error) is None
