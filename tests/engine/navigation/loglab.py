"""Small logs made by hand for estimator tests: a few vehicles on smooth paths, everything drawn from one seed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engine.mission.log import AcousticLog, Fixes, Heading, InitialBelief, Log, VehicleLog, Velocity
from engine.navigation.mission import NavigationMission, prepare

C = 1500.0
HEADING_SIGMA = np.radians(2.0)


def path(vehicle: int, time: np.ndarray) -> np.ndarray:
    """A slow weave, different for every vehicle, (N, 2)."""
    w = 0.012 + 0.003 * vehicle
    x = 150.0 * vehicle + 0.9 * time * (1 if vehicle % 2 else -0.2)
    return np.stack([x, 40 * np.sin(w * time + vehicle) + 120 * vehicle], axis=-1)


def make_log(
    links: Sequence[tuple[int, int]],
    *,
    vehicles: int = 2,
    trials: int = 4,
    seed: int = 0,
    duration_s: float = 600.0,
    period_s: float = 15.0,
    fixed_by_gps: Sequence[int] = (0,),
    loss: float | dict[int, float] = 0.0,
    range_sigma_m: float = 1.0,
    report_s: float = 10.0,
    silent_s: tuple[float, float] | None = None,
) -> Log:
    """Vehicles take turns to broadcast; `links` (from, to) says who hears whom.

    loss: the part of receptions lost, for all or by sender; silent_s: an interval in which nothing is heard by anybody.
    """
    rng = np.random.default_rng(seed)
    logs = []
    for v in range(vehicles):
        time = np.arange(1, int(duration_s * 3) + 1) / 3.0
        step = 1e-3
        velocity = (path(v, time + step) - path(v, time - step)) / (2 * step)
        heading = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
        speed = np.linalg.norm(velocity, axis=-1)
        body = np.zeros((trials, len(time), 2))
        body[..., 0] = speed
        start_velocity = velocity[0]
        gps = v in fixed_by_gps
        fix_time = np.arange(1.0, duration_s + 0.5)
        logs.append(
            VehicleLog(
                name=f"v{v}",
                kind="surface" if gps else "auv",
                initial=InitialBelief(
                    position_m=path(v, np.zeros(1)) + rng.normal(size=(trials, 2)) * 3.0,
                    position_cov=np.eye(2) * 9.0,
                    velocity_mps=start_velocity + rng.normal(size=(trials, 2)) * 0.1,
                    velocity_sigma_mps=0.1,
                    heading_rad=np.zeros(trials),
                    heading_sigma_rad=0.0,
                ),
                acceleration_psd=1e-3,
                range_sigma_m=range_sigma_m,
                velocity=None
                if gps
                else Velocity(
                    time, body + rng.normal(size=body.shape) * 0.05, along_sigma_mps=0.05, cross_sigma_mps=0.05
                ),
                heading=None
                if gps
                else Heading(time, heading + rng.normal(size=(trials, len(time))) * HEADING_SIGMA, HEADING_SIGMA),
                fixes=Fixes(
                    fix_time,
                    path(v, fix_time) + rng.normal(size=(trials, len(fix_time), 2)) * 3.0,
                    np.tile(np.eye(2) * 9.0, (len(fix_time), 1, 1)),
                )
                if gps
                else None,
            )
        )
    return Log(
        duration_s=duration_s,
        trials=trials,
        time_s=np.arange(0.0, duration_s + 0.1, report_s),
        truth={f"v{v}": path(v, np.arange(0.0, duration_s + 0.1, report_s))[None] for v in range(vehicles)},
        vehicles=tuple(logs),
        acoustics=_acoustics(rng, links, vehicles, trials, duration_s, period_s, loss, range_sigma_m, silent_s),
        sound_speed_mps=C,
    )


def _acoustics(rng, links, vehicles, trials, duration_s, period_s, loss, sigma, silent_s) -> AcousticLog:
    tol = np.arange(7.0, duration_s - 5, period_s)
    sender = np.arange(len(tol)) % vehicles
    rows = []
    for b, (t, s) in enumerate(zip(tol, sender)):
        for receiver in (to for source, to in links if source == s):
            toa = t
            for _ in range(5):
                distance = float(np.linalg.norm(path(receiver, np.array([toa])) - path(s, np.array([t]))))
                toa = t + distance / C
            travel = toa - t + rng.normal(size=trials) * sigma / C
            rate = loss[int(s)] if isinstance(loss, dict) else loss
            silent = silent_s is not None and silent_s[0] <= t <= silent_s[1]
            travel[(rng.random(trials) < rate) | silent] = np.nan
            rows.append((toa, b, receiver, travel))
    rows.sort(key=lambda r: r[0])
    return AcousticLog(
        sender=sender,
        tol_s=tol,
        broadcast=np.array([r[1] for r in rows], int),
        receiver=np.array([r[2] for r in rows], int),
        toa_s=np.array([r[0] for r in rows]),
        travel_time_s=np.stack([r[3] for r in rows], axis=-1) if rows else np.zeros((trials, 0)),
    )


def make_mission(links: Sequence[tuple[int, int]], options: dict | None = None, **settings) -> NavigationMission:
    """The same, prepared for estimators."""
    return prepare(make_log(links, **settings), options)
