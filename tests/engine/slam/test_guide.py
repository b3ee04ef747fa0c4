"""The factor that CONTRIBUTING.md prints, against a grid."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import numpy as np

from engine.slam.factors.prior import prior
from engine.slam.solver import Solver
from engine.slam.variables import POINT2


def test_two_bearings_of_the_guides_factor_cross_where_a_grid_says(tmp_path, monkeypatch):
    text = (Path(__file__).resolve().parents[3] / "CONTRIBUTING.md").read_text()
    printed = re.search(r"```python\n(# engine/slam/factors/bearing.py\n.*?)```", text, re.S)
    assert printed is not None
    (tmp_path / "guides_bearing.py").write_text(printed.group(1))
    monkeypatch.syspath_prepend(tmp_path)
    guide = importlib.import_module("guides_bearing")
    places, sigma = np.array([[0.0, 0.0], [100.0, 0.0]]), 0.1
    true = np.array([60.0, 80.0])
    azimuth = [float(np.arctan2(*(true - at)[::-1])) for at in places]
    solver = Solver(1000, 1)
    for k, at in enumerate(places):
        pose = prior(f"x{k}", POINT2, at, 1e-6 * np.eye(2))
        seen = guide.Bearing((f"x{k}", "beacon"), azimuth[k], sigma)
        solver.extend({f"x{k}": POINT2} | ({"beacon": POINT2} if k == 0 else {}), [pose, seen])
    drawn = solver.beliefs(["beacon"])["beacon"]

    x = np.linspace(-20, 140, 321)
    grid = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1)
    density = np.ones(grid.shape[:2])
    for at, seen in zip(places, azimuth, strict=True):
        d = grid - at
        off = np.angle(np.exp(1j * (np.arctan2(d[..., 1], d[..., 0]) - seen)))
        density *= np.exp(-0.5 * np.square(off / sigma))
    density /= density.sum()
    mean = np.einsum("ij,ijk->k", density, grid)
    cov = np.einsum("ij,ijk,ijl->kl", density, grid - mean, grid - mean)
    # A thousand kernels of a Markov chain whose moves leave some alike: half as many independent ones at least.
    assert (np.abs(drawn.mean(0) - mean) < 4 * np.sqrt(np.diag(cov) / 500)).all()
    np.testing.assert_allclose(np.cov(drawn.T), cov, atol=0.2 * np.trace(cov))
