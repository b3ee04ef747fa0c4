"""The solver against exact posteriors: dense solves, grids, nested sampling."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from engine.slam.factors.mixture import mixture
from engine.slam.factors.odometry import displacement, pose_odometry
from engine.slam.factors.prior import prior
from engine.slam.factors.range import ranging
from engine.slam.graph import Graph
from engine.slam.solver import Solver
from engine.slam.variables import LABEL, POINT2, POSE2, REAL, Kind
from tests.engine.slam.gaussians import chain, exact


def solved(graph: Graph, kernels: int, seed: int) -> dict[str, np.ndarray]:
    solver = Solver(kernels, seed)
    solver.extend(graph.kinds, graph.factors)
    return solver.beliefs()


@pytest.mark.parametrize("kernels", [100, 500])
def test_a_chain_of_fifty_keeps_its_variance_from_end_to_end(kernels: int):
    graph = chain(50, np.random.default_rng(1))
    means, covs = exact(graph)
    drawn = [solved(graph, kernels, seed) for seed in range(20)]
    excess = []
    for name, cov in covs.items():
        found = np.mean([np.cov(d[name].T) for d in drawn], axis=0)
        excess.append(np.trace(found) / np.trace(cov))
        error = np.mean([d[name].mean(0) for d in drawn], axis=0) - means[name]
        assert (np.abs(error) < 5 * np.sqrt(np.diag(cov) / (20 * kernels))).all()
    # 20 seeds of `kernels` independent draws: a relative error of a variance near sqrt(2 / (20 kernels)).
    assert np.abs(np.array(excess) - 1).max() < 6 * np.sqrt(2 / (20 * kernels))
    assert abs(np.mean(excess[40:]) - np.mean(excess[:10])) < 0.1


def test_random_graphs_with_loops_have_the_exact_moments():
    rng = np.random.default_rng(2)
    for _ in range(50):
        graph = chain(int(rng.integers(3, 12)), rng, closures=int(rng.integers(1, 5)))
        means, covs = exact(graph)
        drawn = solved(graph, 4000, 3)
        for name, cov in covs.items():
            assert (np.abs(drawn[name].mean(0) - means[name]) < 5.5 * np.sqrt(np.diag(cov) / 4000)).all()
            np.testing.assert_allclose(np.cov(drawn[name].T), cov, atol=0.2 * np.trace(cov))


@pytest.mark.parametrize("kernels", [100, 500])
def test_random_graphs_keep_their_variances_with_few_kernels(kernels: int):
    """Fifty graphs, half of them with loops, twenty seeds each: variances over the exact ones, averaged over seeds."""
    rng = np.random.default_rng(6)
    ratios = []
    for number in range(50):
        graph = chain(int(rng.integers(3, 9)), rng, closures=int(rng.integers(1, 5)) if number % 2 else 0)
        means, covs = exact(graph)
        drawn = [solved(graph, kernels, seed) for seed in range(20)]
        for name, cov in covs.items():
            found = np.mean([np.diag(np.cov(d[name].T)) for d in drawn], axis=0)
            ratios += list(found / np.diag(cov))
            error = np.mean([d[name].mean(0) for d in drawn], axis=0) - means[name]
            assert (np.abs(error) < 5.5 * np.sqrt(np.diag(cov) / (20 * kernels))).all()
    # Of independent draws each ratio has a standard deviation of sqrt(2 / (20 kernels)): 0.014 of 500, 0.032 of 100.
    assert np.abs(np.array(ratios) - 1).max() < 0.2
    assert np.std(ratios) < 1.3 * np.sqrt(2 / (20 * kernels)) and abs(np.mean(ratios) - 1) < 0.02


def test_what_is_added_later_counts_as_if_it_had_been_there():
    graph = chain(12, np.random.default_rng(4), closures=3)
    means, covs = exact(graph)
    solver = Solver(3000, 5)
    known: set[str] = set()
    for name, kind in graph.kinds.items():
        known.add(name)
        ready = [f for f in graph.factors if name in f.variables and set(f.variables) <= known]
        solver.extend({name: kind}, ready)
    drawn = solver.beliefs()
    for name, cov in covs.items():
        assert (np.abs(drawn[name].mean(0) - means[name]) < 5.5 * np.sqrt(np.diag(cov) / 3000)).all()


def bimodal_chain() -> tuple[dict[str, Kind], list]:
    """Three numbers in a row; two of them have two modes each, of different weight and width."""
    kinds = {"a": REAL, "i": LABEL, "b": REAL, "c": REAL, "k": LABEL}
    first = mixture(
        "i", [(0.7, -np.log(0.5), prior("a", REAL, [0.0], [[0.25]])), (0.3, 0.0, prior("a", REAL, [4.0], [[1.0]]))]
    )
    last = mixture(
        "k",
        [
            (0.5, -np.log(0.7), prior("c", REAL, [5.0], [[0.49]])),
            (0.5, -np.log(0.3), prior("c", REAL, [2.0], [[0.09]])),
        ],
    )
    steps = [displacement("a", "b", REAL, [1.0], [[0.64]]), displacement("b", "c", REAL, [0.5], [[0.36]])]
    return kinds, [first, *steps, last]


def on_a_grid() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The posterior of the bimodal chain by sums over a grid."""
    x = np.linspace(-4, 10, 701)

    def normal(at: np.ndarray, mean: float, var: float) -> np.ndarray:
        return np.exp(-0.5 * (at - mean) ** 2 / var) / np.sqrt(2 * np.pi * var)

    a = 0.7 * normal(x, 0, 0.25) + 0.3 * normal(x, 4, 1.0)
    c = 0.5 * normal(x, 5, 0.49) + 0.5 * normal(x, 2, 0.09)
    ab, bc = normal(x[None] - x[:, None], 1, 0.64), normal(x[None] - x[:, None], 0.5, 0.36)
    forward = a @ ab
    backward = bc @ c
    found = {"a": a * (ab @ backward), "b": forward * backward, "c": c * (forward @ bc)}
    return x, {k: v / v.sum() for k, v in found.items()}


@pytest.mark.parametrize("together", [True, False])
def test_a_bimodal_chain_has_the_grids_answer(together: bool):
    kinds, factors = bimodal_chain()
    solver = Solver(2000, 7, sweeps=8)
    if together:
        solver.extend(kinds, factors)
    else:
        solver.extend({v: kinds[v] for v in ("a", "i")}, factors[:1])
        solver.extend({"b": REAL}, factors[1:2])
        solver.extend({v: kinds[v] for v in ("c", "k")}, factors[2:])
    x, expected = on_a_grid()
    edges = np.linspace(-4, 10, 29)
    for name, mass in expected.items():
        found = np.histogram(solver.beliefs([name])[name][:, 0], edges)[0] / 2000
        true = np.histogram(x, edges, weights=mass)[0]
        assert 0.5 * np.abs(found - true).sum() < 0.1


@pytest.mark.parametrize("seed", range(6))
def test_random_bimodal_loops_have_the_grids_answer(seed: int):
    """Three numbers, tied all to all; one or two have a prior of two modes. Against sums over a grid of 141^3."""
    rng = np.random.default_rng(seed)
    names = ["a", "b", "c"]
    x = np.linspace(-7, 7, 141)
    grids = dict(zip(names, np.meshgrid(x, x, x, indexing="ij"), strict=True))
    log = np.zeros((141, 141, 141))
    kinds: dict[str, Kind] = dict.fromkeys(names, REAL)
    factors: list = []
    for v in names[: 1 + seed % 2]:
        weight, sigmas = rng.uniform(0.3, 0.7), rng.uniform(0.3, 0.9, 2)
        means = np.array([-2.0, 2.0]) + rng.normal(scale=0.4, size=2)
        shares = [weight, 1 - weight]
        parts = [prior(v, REAL, [m], [[s**2]]) for m, s in zip(means, sigmas, strict=True)]
        said = [(p, -np.log(s), f) for p, s, f in zip(shares, sigmas, parts, strict=True)]
        kinds[f"which_{v}"] = LABEL
        factors.append(mixture(f"which_{v}", said))
        density = [
            p / s * np.exp(-0.5 * ((grids[v] - m) / s) ** 2) for p, s, m in zip(shares, sigmas, means, strict=True)
        ]
        log += np.log(sum(density))
    for one, other in (("a", "b"), ("b", "c"), ("a", "c")):
        step, sigma = rng.normal(scale=0.5), rng.uniform(0.5, 1.5)
        factors.append(displacement(one, other, REAL, [step], [[sigma**2]]))
        log += -0.5 * ((grids[other] - grids[one] - step) / sigma) ** 2
    mass = np.exp(log - log.max())
    mass /= mass.sum()
    solver = Solver(2000, seed, sweeps=8)
    solver.extend(kinds, factors)
    edges = np.linspace(-7, 7, 29)
    for axis, name in enumerate(names):
        true = np.histogram(x, edges, weights=mass.sum(tuple({0, 1, 2} - {axis})))[0]
        found = np.histogram(solver.beliefs([name])[name][:, 0], edges)[0] / 2000
        assert 0.5 * np.abs(found - true).sum() < 0.1


def test_one_range_gives_a_ring_two_give_two_modes_three_give_one():
    kinds = {"x0": POINT2, "x1": POINT2, "x2": POINT2, "l": POINT2}
    tight = 1e-4 * np.eye(2)
    fixes = [prior(n, POINT2, p, tight) for n, p in (("x0", [0, 0]), ("x1", [20, 0]), ("x2", [20, 15]))]
    beacon = np.array([12.0, 30.0])
    ranges = [ranging(f.variables[0], "l", float(np.linalg.norm(beacon - f.mean)), 0.3) for f in fixes]
    solver = Solver(200, 1)
    solver.extend({v: kinds[v] for v in ("x0", "l")}, [fixes[0], ranges[0]])
    ring = solver.beliefs(["l"])["l"]
    assert np.abs(np.hypot(*ring.T) - np.linalg.norm(beacon)).max() < 1.5
    angles = np.sort(np.arctan2(ring[:, 1], ring[:, 0]))
    assert np.diff(angles).max() < 0.5, "all around the ring"
    solver.extend({"x1": POINT2}, [fixes[1], ranges[1]])
    above = solver.beliefs(["l"])["l"][:, 1] > 0
    assert 0.35 < above.mean() < 0.65, "two mirror places, as likely as each other"
    solver.extend({"x2": POINT2}, [fixes[2], ranges[2]])
    last = solver.beliefs(["l"])["l"]
    assert np.linalg.norm(last - beacon, axis=1).max() < 2.0


def test_what_says_nothing_of_a_beacon_leaves_its_kernels_alone():
    solver = Solver(100, 3)
    solver.extend({"x0": POINT2, "l": POINT2}, [prior("x0", POINT2, [0, 0], np.eye(2)), ranging("x0", "l", 20.0, 0.3)])
    before = solver.beliefs(["l"])["l"]
    for k in range(3):
        step = solver.extend(
            {f"x{k + 1}": POINT2}, [displacement(f"x{k}", f"x{k + 1}", POINT2, [1, 0], 0.01 * np.eye(2))]
        )
        assert step.effective == pytest.approx(100) and np.isnan(step.accepted)
    np.testing.assert_array_equal(solver.beliefs(["l"])["l"], before)


@pytest.mark.parametrize("seed", range(4))
def test_what_is_counted_is_counted_once(seed: int):
    """Wide ranges that come one by one, weighed rather than moved, have the moments of their sum over a grid."""
    places, ranges, sigma = np.array([[0, 0], [8, 2], [16, -3], [24, 4]]), np.array([25.0, 22.0, 18.0, 21.0]), 4.0
    solver = Solver(3000, seed, sweeps=1)
    for k, (place, r) in enumerate(zip(places, ranges, strict=True)):
        kinds = {f"x{k}": POINT2} | ({"l": POINT2} if k == 0 else {})
        solver.extend(kinds, [prior(f"x{k}", POINT2, place, 1e-6 * np.eye(2)), ranging(f"x{k}", "l", r, sigma)])
    axis = np.arange(-60.0, 80.0, 0.25)
    at = np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2)
    off = np.linalg.norm(at[:, None] - places, axis=-1) - ranges
    mass = np.exp(-0.5 * np.square(off / sigma).sum(-1))
    mass /= mass.sum()
    drawn, mean = solver.beliefs(["l"])["l"], mass @ at
    spread = np.sqrt(mass @ np.square(at - mean))
    assert (np.abs(drawn.mean(0) - mean) < 0.15 * spread).all()
    np.testing.assert_allclose(drawn.std(0), spread, rtol=0.08)


def test_a_variable_that_nothing_places_is_named():
    with pytest.raises(ValueError, match="x1"):
        Solver(10).extend({"x0": POINT2, "x1": POINT2}, [prior("x0", POINT2, [0, 0], np.eye(2))])


def rotated(cov: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return R @ cov @ R.T


def nested_sampling_graph(folder: Path) -> list[tuple[dict[str, Kind], list]]:
    """Its steps: one pose each. The file's covariances are in the axes of the pose that a factor predicts."""
    steps: dict[str, tuple[dict[str, Kind], list]] = {}
    seen = set()
    for line in (folder / "factor_graph.fg").read_text().splitlines():
        word, kind, *rest = line.split()
        if word != "Factor":
            continue
        numbers = [float(w) for w in rest if w[0] in "-0123456789"]
        if kind.startswith("Unary"):
            mean, cov = numbers[:3], np.reshape(numbers[3:], (3, 3))
            steps[rest[0]] = ({rest[0]: POSE2}, [prior(rest[0], POSE2, np.array(mean), rotated(cov, mean[2]))])
        elif kind.startswith("SE2Relative"):
            delta, cov = numbers[:3], np.reshape(numbers[3:], (3, 3))
            odometry = pose_odometry(rest[0], rest[1], np.array(delta), rotated(cov, delta[2]))
            steps[rest[1]] = ({rest[1]: POSE2}, [odometry])
        else:
            kinds, factors = steps[rest[0]]
            factors.append(ranging(rest[0], rest[1], numbers[0], numbers[1]))
            if rest[1] not in seen:
                seen.add(rest[1])
                kinds[rest[1]] = POINT2
    return list(steps.values())


def test_posteriors_of_nested_sampling_are_met(recorded_data):
    """Means, spreads and masses of modes, but the spreads of the poses, of which the samples have too little.

    At step 3 theirs is 10 to 14 % below what odometry alone leaves, though ranges to unknown beacons hardly narrow
    it: by importance sampling with the beacons integrated on a grid 4000 draws of the poses keep an effective 3998.
    """
    folder = recorded_data("nested-sampling")
    solver = Solver(500, 11, sweeps=12)
    dead_reckoned: dict[str, np.ndarray] = {}
    for k, (kinds, factors) in enumerate(nested_sampling_graph(folder)):
        solver.extend(kinds, factors)
        if k > 3:
            continue
        dead_reckoned |= alone(factors[0], dead_reckoned)
        drawn = solver.beliefs()
        reference = np.loadtxt(folder / f"step{k}.sample")
        column = 0
        for name in (folder / f"step{k}_ordering").read_text().split():
            theirs, ours = reference[:, column : column + drawn[name].shape[1]], drawn[name]
            column += theirs.shape[1]
            scale = np.maximum(np.abs(theirs.mean(0)), theirs.std(0))
            np.testing.assert_array_less(np.abs(ours.mean(0) - theirs.mean(0)), 0.15 * scale, err_msg=f"{k} {name}")
            if not name.startswith("X"):
                assert discrepancy(ours, theirs) < 0.1, f"{name} at step {k}"
            spread = dead_reckoned[name].std(0) if name.startswith("X") else theirs.std(0)
            np.testing.assert_allclose(ours.std(0), spread, rtol=0.15, err_msg=f"{k} {name}")
            if name.startswith("L"):
                for axis, middle in ((0, 30.0 if name == "L1" else 60.0), (1, 0.0)):
                    share = (ours[:, axis] > middle).mean() - (theirs[:, axis] > middle).mean()
                    assert abs(share) < 0.1, f"mass of {name} at step {k}"


def test_later_steps_agree_with_a_long_run_from_nothing(recorded_data):
    """Steps 4 and 5, of which there are no samples: grown step by step, against four times the kernels at once."""
    kinds: dict[str, Kind] = {}
    factors: list = []
    solver = Solver(500, 11, sweeps=12)
    for k, (more, said) in enumerate(nested_sampling_graph(recorded_data("nested-sampling"))):
        solver.extend(more, said)
        kinds |= more
        factors += said
        if k < 4:
            continue
        long = Solver(2000, 5, sweeps=20)
        long.extend(kinds, factors)
        drawn = solver.beliefs()
        for name, theirs in long.beliefs().items():
            ours = drawn[name]
            scale = np.maximum(np.abs(theirs.mean(0)), theirs.std(0))
            np.testing.assert_array_less(np.abs(ours.mean(0) - theirs.mean(0)), 0.15 * scale, err_msg=f"{k} {name}")
            np.testing.assert_allclose(ours.std(0), theirs.std(0), rtol=0.15, err_msg=f"{k} {name}")
            assert discrepancy(ours, theirs) < 0.1, f"{name} at step {k}"


def discrepancy(a: np.ndarray, b: np.ndarray) -> float:
    """Maximum mean discrepancy of the places in two sets of draws; Gaussian kernel as wide as their median distance.

    Independent draws of the same, 500 and 2000, have one of about sqrt(1/500 + 1/2000) = 0.05.
    """
    rng = np.random.default_rng(0)  # nested sampling writes its samples in order
    a, b = (rng.permutation(x)[:2000, :2] for x in (a, b))
    width = np.median(cdist(a, b))

    def near(x: np.ndarray, y: np.ndarray) -> float:
        return np.exp(-0.5 * (cdist(x, y) / width) ** 2).mean()

    return float(np.sqrt(max(near(a, a) + near(b, b) - 2 * near(a, b), 0.0)))


def alone(factor, known: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Draws of a pose by its prior or odometry and nothing else."""
    *before, name = factor.variables
    values = [known[v] for v in before] + [np.zeros((4000, 3))]
    return {name: factor.sample(len(before), values, np.zeros(4000), np.random.default_rng(len(name) + len(known)))}


def test_what_an_extension_does_not_touch_is_not_done_again():
    """Messages from the far end of a chain stay; in the first extension there is nothing to stay."""
    solver = Solver(20, seed=1)
    cov = 0.01 * np.eye(2)
    steps = [displacement(f"x{k}", f"x{k + 1}", POINT2, np.ones(2), cov) for k in range(30)]
    begun = solver.extend({f"x{k}": POINT2 for k in range(30)}, [prior("x0", POINT2, np.zeros(2), cov), *steps[:29]])
    assert not begun.reused
    grown = solver.extend({"x30": POINT2}, [steps[29]])
    home = grown.tree.home
    assert {home[f"x{k}"] for k in range(10)} <= grown.reused
    assert home["x30"] not in grown.reused


def test_odometry_is_not_asked_again_as_the_poses_around_it_move():
    """Between two poses that were ranged from the chain is one message, wherever those move; it counts as ever."""
    rng = np.random.default_rng(8)
    beacon, cov = np.array([20.0, 30.0]), 0.05 * np.eye(2)
    solver = Solver(60, seed=2)
    at = np.zeros(2)
    solver.extend(
        {"x0": POINT2, "l": POINT2},
        [prior("x0", POINT2, at, 0.01 * np.eye(2)), ranging("x0", "l", float(np.linalg.norm(beacon)), 0.3)],
    )
    reached = 0
    for leg in (np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.array([-1.0, 0.5])):
        steps = leg + 0.2 * rng.standard_normal((20, 2))
        names = [f"x{reached + k}" for k in range(21)]
        factors: list = [displacement(a, b, POINT2, s, cov) for a, b, s in zip(names, names[1:], steps, strict=False)]
        at, reached = at + 20 * leg, reached + 20
        factors.append(ranging(names[-1], "l", float(np.linalg.norm(at - beacon)), 0.3))
        made = solver._propagation.made
        grown = solver.extend(dict.fromkeys(names[1:], POINT2), factors)
    for first in (1, 21):
        # All but what shares its clique with a pose that heard the beacon.
        again = [k for k in range(first, first + 19) if grown.tree.home[f"x{k}"] not in grown.reused]
        assert len(again) <= 2, f"poses {again} were done again"
    # Twenty new cliques of odometry, and in each of at most 30 passes those of the four poses that heard the beacon.
    assert solver._propagation.made - made < 20 + 4 * 30
    whole = Solver(60, seed=3)
    whole.extend(solver.graph.kinds, solver.graph.factors)
    for v in ("l", "x30", "x60"):
        ours, anew = solver.beliefs([v])[v], whole.beliefs([v])[v]
        assert np.linalg.norm(ours.mean(0) - anew.mean(0)) < 5 * np.sqrt(2 / 60) * np.hypot(*anew.std(0)) + 0.05
