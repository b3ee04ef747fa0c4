"""The batch smoother against GTSAM on the same graphs, and what it does with outliers and bad starts."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from engine.smoothing.smoother import smooth

sys.path.insert(0, str(Path(__file__).parent))
from graphlab import gtsam_solution, random_graph


@pytest.mark.parametrize("seed", range(50))
def test_gtsam_agrees_on_means_and_marginals(seed):
    """Two or three vehicles, in the plane or in SE(2), every fifth with a beacon of uncertain position."""
    rng = np.random.default_rng(seed)
    d = 2 + seed // 2 % 2
    vehicles = 2 + seed % 2
    graph, facts = random_graph(rng, vehicles=vehicles, dimension=d, beacon=seed % 5 == 0)
    ours = smooth(graph, settled=1e-9)
    assert ours.status == "converged"
    idx = np.arange(20 * vehicles)[:, None] * d + np.arange(2)
    cov = ours.inverse().blocks(idx)
    for k, (mean, P) in gtsam_solution(facts, graph.reference[: graph.banded].reshape(-1, d), d).items():
        np.testing.assert_allclose(ours.x[idx[k]], mean, atol=1e-6)
        np.testing.assert_allclose(cov[k], P, rtol=1e-6, atol=1e-6 * np.abs(P).max())
