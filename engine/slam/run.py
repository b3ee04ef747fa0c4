"""Runs one algorithm over a mission's trials: the graph grows, beliefs are kept as they come."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.special import bdtrc, chdtrc

from engine.notes import Example, Most, Note
from engine.registry import Progress
from engine.slam.building import Plan, growths, name
from engine.slam.densities import fit, from_gaussian
from engine.slam.factors.synthetic_aperture import SyntheticAperture
from engine.slam.log import SlamLog, thinned
from engine.slam.misfit import Misfit
from engine.slam.mission import SlamMission
from engine.slam.reckoning import drifted
from engine.slam.solver import Solver
from engine.slam.story import told_array, told_beliefs, told_errors, told_factors, told_tree
from engine.tracks import Belief, Samples, Series, Tracks

#: Chance below which a graph's residuals are said not to fit its model.
UNLIKELY = 1e-6


class Options(BaseModel):
    """What a scenario may choose for a kernel-based estimator, under [options.NAME]."""

    model_config = ConfigDict(extra="forbid")
    kernels: int = Field(100, ge=20, le=5000, description="kernels of each belief")
    sweeps: int = Field(4, ge=1, le=100, description="moves of the kernels each time their weights are uneven")
    measurements: int | None = Field(
        None, ge=1, le=5000, description="ranges or arrays used, evenly spread over those of the mission (none: all)"
    )
    lag: int | None = Field(None, ge=20, le=5000, description="poses kept; older ones are marginalized (none: all)")


@dataclass(frozen=True)
class Moment:
    """What is believed once a pose was reached: of that pose, `here`, and of the beacons heard, each (N, 2).

    track (K, 2) are the means of all poses so far. In the end there are all poses in `last` (P, N, 2), what speaks
    against the model, where the solver knows it, and against each array, by its first pose. `told` is what of the
    story only the solver knows.
    """

    pose: int
    here: np.ndarray
    track: np.ndarray
    beacons: dict[str, np.ndarray]
    done: float
    last: np.ndarray | None = None
    misfit: Misfit | None = None
    cautions: dict[int, tuple[str, ...]] = field(default_factory=dict)
    told: dict[str, Any] = field(default_factory=dict)


#: From a trial's log, its mission and its number to the moments of its solution.
Solve = Callable[[SlamLog, SlamMission, int], Iterator[Moment]]


def by_kernels(algorithm: str, plan: Plan) -> Callable[[SlamMission, Progress], Tracks]:
    """An algorithm that grows the graph of a plan with the kernel solver."""

    def solve(log: SlamLog, mission: SlamMission, trial: int) -> Iterator[Moment]:
        options = Options.model_validate(dict(mission.options.get(algorithm, {})))
        log = thinned(log, options.measurements)
        seed = np.random.SeedSequence([mission.scenario.seed, trial])
        solver = Solver(options.kernels, seed, options.sweeps, options.lag)
        total = len(log.arrays) if plan.measurements == "arrays" else len(log.pings) + len(log.readings)
        done = 0
        for growth in growths(log, plan, mission.time_s, mission.scenario.outlier_share):
            step = solver.extend(growth.kinds, growth.factors)
            done += growth.measurements
            beliefs = solver.beliefs()
            here, places = beliefs[name(growth.pose)][:, :2], {b: beliefs[b] for b in solver.beacons}
            track = np.stack([beliefs[name(k)][:, :2].mean(0) for k in range(growth.pose + 1)])
            told: dict[str, Any] = {}
            if trial == mission.trials[0]:
                told["tree"] = told_tree(step.tree, step.reused)
                numbers = {name(k): k for k in range(growth.pose + 1)}
                told["factors"] = told_factors(growth.factors, numbers, mission.beacons)
            for factor in growth.factors if told else ():
                if isinstance(factor, SyntheticAperture):
                    at = np.stack([beliefs[v][:, :2].mean(0) for v in factor.variables[:-1]])
                    told["array"] = told_array(factor.array, at)
            if done < total:
                yield Moment(growth.pose, here, track, places, done / total, told=told)
                continue
            poses = np.stack([beliefs[name(k)][:, :2] for k in range(log.poses)])
            cautions = log.cautions if plan.measurements == "arrays" else {}
            yield Moment(growth.pose, here, track, places, 1.0, poses, solver.misfit(), cautions, told)

    return over_trials(solve)


def _doubts(ends: list[Moment]) -> list[Note]:
    """What the trials' last moments say against the answer, each kind once."""
    notes = []
    doubtful = [(pose, said) for end in ends for pose, said in end.cautions.items() if said]
    if doubtful:
        pose, said = doubtful[0]
        example = Example(f"the one from pose {pose}: {'; '.join(said)}")
        notes.append(Note("{} arrays are not what the beamformer takes them for, such as {}", len(doubtful), example))
    known = [end.misfit for end in ends if end.misfit is not None]
    unlikely = [m for m in known if m.freedom > 0 and chdtrc(m.freedom, m.squares) < UNLIKELY]
    if unlikely:
        words = (
            "residuals do not fit the model in {} trials: their squares sum to {:.1f} times what is expected in the "
            "worst; is a clock, the sound speed or a noise wrong?"
        )
        notes.append(Note(words, len(unlikely), Most(max(m.squares / m.freedom for m in unlikely))))
    refusing = [m for m in known if bdtrc(m.refused - 1, m.ranges, m.doubt) < UNLIKELY]
    if refusing:
        words = (
            "ranges do not fit each other in {} trials: {:.0%} of them were refused in the worst where about {:.0%} "
            "was expected; is a clock, the sound speed or the direct path wrong?"
        )
        worst = max(refusing, key=lambda m: m.refused / m.ranges)
        notes.append(Note(words, len(refusing), Most(worst.refused / worst.ranges), Most(worst.doubt)))
    return notes


def over_trials(solve: Solve) -> Callable[[SlamMission, Progress], Tracks]:
    """An algorithm that solves trial by trial."""

    def run(mission: SlamMission, progress: Progress) -> Tracks:
        histories, track = [], np.empty((0, 2))
        for k, trial in enumerate(mission.trials):
            history, log = [], mission.log(k)
            if k == 0:
                track = drifted(log)
            for moment in solve(log, mission, trial):
                partial = _partial(mission, moment) if k == 0 else None
                progress((k + moment.done) / len(mission.trials), partial)
                history.append(moment)
            histories.append(history)
        return _tracks(mission, histories, track)

    return run


def _partial(mission: SlamMission, moment: Moment) -> dict[str, Any]:
    """The first trial's new beliefs for someone watching; None in the rows of a beacon that was not heard yet."""
    found = {mission.vehicle: moment.here} | moment.beacons
    subjects = [mission.vehicle, *mission.beacons]
    return {
        "time_s": [float(mission.time_s[moment.pose])],
        "mean": {s: [found[s].mean(0).tolist() if s in found else [None] * 2] for s in subjects},
        "cov": {s: [_packed(np.cov(found[s].T)) if s in found else [None] * 3] for s in subjects},
    }


def _packed(cov: np.ndarray) -> list[float]:
    return [float(cov[0, 0]), float(cov[0, 1]), float(cov[1, 1])]


def _moments(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean (T, 2) and covariance (T, 2, 2) of draws (T, N, 2)."""
    mean = points.mean(-2)
    d = points - mean[..., None, :]
    return mean, np.einsum("...ni,...nj->...ij", d, d) / (points.shape[-2] - 1) + 1e-9 * np.eye(2)


def _tracks(mission: SlamMission, histories: list[list[Moment]], track: np.ndarray) -> Tracks:
    T = len(mission.time_s)
    ends = [_moments(h[-1].last) for h in histories if h[-1].last is not None]
    beliefs = {mission.vehicle: Belief(np.stack([m for m, _ in ends]), np.stack([c for _, c in ends]))}
    samples: dict[str, Samples] = {}
    series: dict[str, Series] = {}
    silent: list[str] = []
    for beacon in mission.beacons:
        heard = [[m for m in h if beacon in m.beacons] for h in histories]
        if not all(heard):
            silent.append(f"{beacon} was not heard by what this algorithm listens to; it has no belief")
            continue
        poses = [m.pose for m in heard[0]]
        points = np.stack([[m.beacons[beacon] for m in h] for h in heard])
        samples[beacon] = Samples(mission.time_s[poses], points)
        # A belief holds until the next one; what is asked of before the first is answered by the first.
        held = np.maximum(np.searchsorted(poses, np.arange(T), side="right") - 1, 0)
        mean, cov = _moments(points)
        beliefs[beacon] = Belief(mean[:, held], cov[:, held])
        series |= _curves(mission, beacon, points, held)
    series |= _misfit(mission.vehicle, [h[-1] for h in histories], T)
    notes = _doubts([h[-1] for h in histories])
    story = {
        "moments": [_story(mission, moment) for moment in histories[0]],
        "drifted": {"time_s": mission.time_s.tolist(), "points_m": track.tolist()},
    }
    return Tracks(beliefs, samples=samples, series=series, notes=(*mission.notes, *silent, *notes), graph=story)


def _story(mission: SlamMission, moment: Moment) -> dict[str, Any]:
    when = {
        "time_s": float(mission.time_s[moment.pose]),
        "pose": moment.pose,
        "tree": None,
        "array": None,
        "factors": [],
    }
    beliefs = told_beliefs(moment.beacons, moment.pose)
    truth = {name: place[0] for name, place in mission.truth.items()}
    errors = told_errors(moment.track, truth.get(mission.vehicle), beliefs["beacons"], truth, moment.pose)
    return when | beliefs | {"errors": errors} | moment.told


def _curves(mission: SlamMission, beacon: str, points: np.ndarray, held: np.ndarray) -> dict[str, Series]:
    """Errors of the mean and of the mode (C19 eq. 5.2), and the divergence from a Gaussian (eq. 5.3)."""
    trials, K = points.shape[:2]
    modes, apart = np.empty((trials, K, 2)), np.empty((trials, K))
    for t in range(trials):
        for k in range(K):
            kde = fit(points[t, k])
            modes[t, k] = kde.mode
            apart[t, k] = from_gaussian(kde, np.random.default_rng([t, k]))
    curves = {f"divergence/{beacon}": Series("Divergence from a Gaussian", "nats", apart[:, held], (beacon,))}
    truth = mission.truth.get(beacon)
    if truth is None:
        return curves
    off = np.linalg.norm(modes[:, held] - truth, axis=-1)
    curves[f"mode_error_m/{beacon}"] = Series("Densest place's error", "m", off, (beacon,))
    return curves


def _misfit(vehicle: str, ends: list[Moment], T: int) -> dict[str, Series]:
    """Squared residuals over their expected sum, at the end: about 1 where the model holds."""
    value = np.full((len(ends), T), np.nan)
    for row, end in zip(value, ends):
        if end.misfit is not None and end.misfit.freedom > 0:
            row[-1] = end.misfit.squares / end.misfit.freedom
    if not np.isfinite(value).any():
        return {}
    return {f"misfit/{vehicle}": Series("Squared residuals over those expected", "1", value, (vehicle,))}
