"""One operating point from every side: Fig. 3's curve, Fig. 6's histories, Monte Carlo, and a verdict in words."""

from __future__ import annotations

from typing import Any

import numpy as np

from engine.evaluation.consistency import interval
from engine.tracking import recursion, simulate
from engine.tracking.model import Model, make
from engine.tracking.rules import RULES
from engine.tracking.steady import settle, settle_centrally

MOST_STEPS, MOST_TRIALS, MOST_SENSORS = 500, 20_000, 8
#: Measurements simulated at most, steps x trials x sensors, and without trials: together about three seconds.
MOST_DRAWS, MOST_UPDATES = 2_000_000, 1_000
WEIGHTS = 101


def analyse(
    process: float,
    sensors: list[float],
    prior: float,
    *,
    steps: int = 30,
    trials: int = 2000,
    seed: int = 1,
) -> dict[str, Any]:
    """Everything about one operating point in one dimension, in JSON's own types; variances in m^2.

    weights: error variance of the distributed fusion of the first two sensors against its weight, one step from the
    prior (RC Fig. 3). histories: believed and actual variance of every fuser after 0..steps steps (Fig. 6), with the
    Monte Carlo mean square error and its 95 % interval. steady: the same in the steady state. Raises ValueError,
    naming the argument, for input out of bounds.
    """
    for name, value, most in (("steps", steps, MOST_STEPS), ("trials", trials, MOST_TRIALS)):
        if not 1 <= value <= most:
            raise ValueError(f"{name}: {value} is not between 1 and {most}")
    if len(sensors) > MOST_SENSORS:
        raise ValueError(f"sensors: {len(sensors)} given, at most {MOST_SENSORS}")
    if steps * len(sensors) > MOST_UPDATES:
        raise ValueError(f"steps: {steps} with {len(sensors)} sensors; at most {MOST_UPDATES} in all")
    if steps * trials * len(sensors) > MOST_DRAWS:
        raise ValueError(f"trials: {trials} over {steps} steps and {len(sensors)} sensors; at most {MOST_DRAWS} in all")
    model = make(process, sensors, prior)
    draws = simulate.draw(model, steps, trials, np.random.default_rng(seed))
    best = int(np.argmin(sensors))
    histories = {"single_sensor": _history(model, draws, None, best), "centralized_fusion": _central(model, draws)}
    histories |= {name: _history(model, draws, rule, 0) for name, rule in RULES.items()}
    steady = _steady(model, best)
    return {
        "operating_point": {"process": process, "sensors": list(sensors), "prior": prior},
        "weights": _weights(model),
        "histories": histories,
        "steady": steady,
        "verdict": verdict(model, best, steady),
    }


def _history(model: Model, draws: simulate.Draws, rule: recursion.Rule | None, node: int) -> dict[str, Any]:
    answer = simulate.estimate(model, draws, rule)
    return {
        "believed": answer.believed[0, :, node, 0, 0].tolist(),
        "actual": answer.actual[0, :, node, 0, 0].tolist(),
        **_monte_carlo(answer.mean[:, :, node, 0] - draws.target[..., 0]),
    }


def _central(model: Model, draws: simulate.Draws) -> dict[str, Any]:
    answer = simulate.estimate_centrally(model, draws)
    variances = answer.believed[0, :, 0, 0, 0].tolist()
    errors = answer.mean[:, :, 0, 0] - draws.target[..., 0]
    return {"believed": variances, "actual": variances, **_monte_carlo(errors)}


def _monte_carlo(errors: np.ndarray) -> dict[str, Any]:
    """Mean square of errors (trials, T) and the 95 % interval of the variance it estimates."""
    trials = errors.shape[0]
    square = (errors**2).mean(axis=0)
    low, high = interval(1, trials)
    return {
        "monte_carlo": square.tolist(),
        "monte_carlo_interval": np.stack([square / high, square / low], axis=-1).tolist(),
    }


def _weights(model: Model) -> dict[str, Any]:
    nodes, _ = recursion.observe(model, recursion.predict(model, recursion.start(model)))
    P11, P22, P12 = (float(nodes.actual[a, 0, b, 0]) for a, b in ((0, 0), (1, 1), (0, 1)))
    weight = np.linspace(0, 1, WEIGHTS)
    curve = (1 - weight) ** 2 * P11 + weight**2 * P22 + 2 * weight * (1 - weight) * P12
    two = Model(model.F, model.Q, model.H[:2], model.R[:2], model.prior)
    optimal = recursion.history(two, RULES["distributed_fusion"], 1)[-1]
    naive = recursion.history(two, RULES["naive_fusion"], 1)[-1]
    r1, r2 = float(model.R[0][0, 0]), float(model.R[1][0, 0])
    return {
        "weight": weight.tolist(),
        "distributed": curve.tolist(),
        "optimal_weight": r1 / (r1 + r2),
        "optimal": float(optimal.actual_of(0)[0, 0]),
        "single": min(P11, P22),
        "central": float(recursion.central(two, model.prior)[0, 0]),
        "naive_weight": P11 / (P11 + P22) if P11 + P22 > 0 else 0.5,
        "naive": float(naive.actual_of(0)[0, 0]),
        "naive_believed": float(naive.believed[0, 0, 0]),
    }


def _steady(model: Model, best: int) -> dict[str, Any]:
    """Believed and actual variance of every fuser after infinitely many steps; None where it has no such state."""
    steady: dict[str, Any] = {}
    for name, rule in [("single_sensor", None), *RULES.items()]:
        nodes, settled = settle(model, rule)
        node = best if rule is None else 0
        figures = {"believed": float(nodes.believed[node, 0, 0]), "actual": float(nodes.actual_of(node)[0, 0])}
        steady[name] = figures if settled else None
    central, settled = settle_centrally(model)
    steady["centralized_fusion"] = (
        {"believed": float(central[0, 0]), "actual": float(central[0, 0])} if settled else None
    )
    return steady


def verdict(model: Model, best: int, steady: dict[str, Any], steps: int = 200) -> str:
    """Whether one may fuse naively here, in a sentence, from the closed form."""
    naive, alone = recursion.history(model, RULES["naive_fusion"], steps), recursion.history(model, None, steps)
    worse = [bool(a.actual_of(0)[0, 0] > b.actual_of(best)[0, 0] * (1 + 1e-12)) for a, b in zip(naive, alone)]
    last, single = steady["naive_fusion"], steady["single_sensor"]
    if last is None or single is None:
        last = {"believed": float(naive[-1].believed[0, 0, 0]), "actual": float(naive[-1].actual_of(0)[0, 0])}
        in_the_end = worse[-1]
    else:
        in_the_end = last["actual"] > single["actual"] * (1 + 1e-12)
    doubt = f"it believes {last['believed']:.3g} m² and has {last['actual']:.3g} m²"
    if in_the_end:
        safe = [k for k, bad in enumerate(worse) if not bad]
        if safe[-1] == steps:
            when = f"though only after more than {steps} steps"
        else:
            when = f"after {safe[-1] + 1} steps" if safe[-1] else "from the first step"
        return f"Do not: naive fusion is worse than one sensor alone here, {when}; {doubt}."
    if any(worse):
        return f"Naive fusion is worse than one sensor alone at first and better in the long run; {doubt}."
    return f"You may: naive fusion stays better than one sensor alone here, though it is too sure of itself; {doubt}."
