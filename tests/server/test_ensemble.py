"""Clouds of trials: envelopes and lines of equal density against what they are known to hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.scenes.ensemble import DENSITIES, WITHIN, contours, envelope, level_line, read


def gaussian(n: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).multivariate_normal([5.0, -3.0], [[9.0, 4.0], [4.0, 4.0]], n)


@given(st.integers(3, 200), st.integers(0, 1000))
def test_the_envelope_holds_its_share_of_the_trials(n: int, seed: int):
    points = gaussian(n, seed)
    found = envelope(points)
    assert found is not None
    mean, (xx, xy, yy) = found
    away = points - mean
    inside = np.einsum("ni,ij,nj->n", away, np.linalg.inv([[xx, xy], [xy, yy]]), away) <= 1 + 1e-9
    assert WITHIN - 1 / n <= inside.mean() <= WITHIN + 1 / n + 1e-9


def test_too_few_trials_or_trials_on_a_line_have_no_envelope():
    assert envelope(np.zeros((2, 2))) is None
    assert envelope(np.stack([np.arange(9.0), 2 * np.arange(9.0)], axis=-1)) is None


def test_a_level_line_of_a_cone_is_a_circle():
    x = y = np.linspace(-2.0, 2.0, 81)
    line = level_line(x, y, np.hypot(x[:, None], y[None, :]), 1.3)
    np.testing.assert_allclose(np.hypot(line[..., 0], line[..., 1]), 1.3, atol=2e-3)
    length = np.linalg.norm(line[:, 1] - line[:, 0], axis=-1).sum()
    assert length == pytest.approx(2 * np.pi * 1.3, rel=2e-3)


def test_lines_of_equal_density_hold_their_share_of_a_gaussian():
    """The shares are of the points; the estimate widens the true ellipses of a Gaussian a little."""
    points = gaussian(4000)
    for line, share in zip(contours(points), DENSITIES, strict=True):
        away = line.reshape(-1, 2) - [5.0, -3.0]
        distance = np.einsum("ni,ij,nj->n", away, np.linalg.inv([[9.0, 4.0], [4.0, 4.0]]), away)
        np.testing.assert_allclose(distance.mean(), -2 * np.log(1 - share), rtol=0.12)


def test_trials_with_truths_of_their_own_are_drawn_by_their_errors(tmp_path: Path):
    time_s = np.array([0.0, 10.0])
    truth = np.array([[[0.0, 0.0], [10.0, 0.0]], [[0.0, 5.0], [0.0, 15.0]]])
    np.savez(tmp_path / "arrays.npz", **{"time_s": time_s, "truth/auv": truth, "cekf/auv/mean": truth + [1.0, 2.0]})
    shown = {"auv": (time_s, truth[0])}
    found = read(tmp_path / "arrays.npz", ["cekf"], shown)["cekf"]
    np.testing.assert_allclose(found.at("auv", 10.0), [[11.0, 2.0], [11.0, 2.0]])
    assert found.at("auv", -1.0).shape == (0, 2) and found.at("ship", 10.0).shape == (0, 2)
