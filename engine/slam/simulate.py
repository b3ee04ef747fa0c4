"""Simulated missions: true paths, drifting odometry, and waveforms through the water and the whole sonar chain."""

from __future__ import annotations

import numpy as np

from engine.acoustics.matched_filter import matched_filter
from engine.acoustics.noise import Noise
from engine.acoustics.propagation import Wall, Water, record
from engine.mission.routes import route
from engine.mission.streams import stream
from engine.scenario.slam import SlamScenario, WaterSettings
from engine.slam.hearing import hear, sonar_of
from engine.slam.log import SlamLog, evenly

#: Records processed at once, to bound memory.
CHUNK = 128


def water_of(settings: WaterSettings) -> Water:
    """The water that a scenario describes."""
    walls = []
    for wall in settings.walls:
        angle = np.radians(wall.heading_deg)
        x, y = wall.point_m
        walls.append(Wall((x, y), (float(np.cos(angle)), float(np.sin(angle))), wall.reflection))
    return Water(
        settings.sound_speed_mps,
        settings.spreading,
        settings.surface_reflection,
        tuple(walls),
        settings.clock_offset_s,
        settings.outlier_m,
        settings.outlier_gain,
    )


def truth(scenario: SlamScenario) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (P,), s, and the true positions (P, 2) of vehicle and beacon at them, the same in every trial."""
    assert scenario.vehicle is not None and scenario.beacon is not None
    time_s = scenario.sonar.interval_s * np.arange(scenario.poses)
    vehicle = route(scenario.vehicle.path, scenario.seed, scenario.vehicle.name)(time_s).position
    beacon = route(scenario.beacon.path, scenario.seed, scenario.beacon.name)(time_s).position
    return time_s, vehicle + beacon if scenario.vehicle.around_beacon else vehicle, beacon


def records(scenario: SlamScenario, poses: np.ndarray, trial: int) -> np.ndarray:
    """What the hydrophone records at some poses (K,) of a trial: (K, record_samples), float32.

    Every pose has its own stream of noise, so a record does not depend on which others are wanted.
    """
    assert scenario.vehicle is not None and scenario.beacon is not None and scenario.water is not None
    _, vehicle, beacon = truth(scenario)
    water, sonar = scenario.water, sonar_of(scenario.sonar)
    fading = stream(scenario.seed, trial, scenario.beacon.name, "fading").standard_normal(scenario.poses)
    noise = Noise(motor_db=water.motor_db)
    out = np.empty((len(poses), sonar.record_samples), dtype=np.float32)
    for row, k in zip(out, poses):
        row[:] = record(
            np.array([*beacon[k], -scenario.beacon.depth_m]),
            np.array([*vehicle[k], -scenario.vehicle.depth_m]),
            sonar,
            water_of(water),
            noise,
            snr_db=water.snr_db + water.snr_spread_db * fading[k],
            reference_m=water.reference_m,
            rng=stream(scenario.seed, trial, scenario.vehicle.name, f"noise {k}"),
        )
    return out


def listen(scenario: SlamScenario, poses: np.ndarray, trial: int) -> np.ndarray:
    """The matched filter's output (K, record_samples), complex, for the records at some poses (K,) of a trial."""
    sonar = sonar_of(scenario.sonar)
    parts = []
    for first in range(0, len(poses), CHUNK):
        chunk = records(scenario, poses[first : first + CHUNK], trial)
        parts.append(matched_filter(chunk, sonar, phat=scenario.sonar.phat))
    return np.concatenate(parts) if parts else np.zeros((0, sonar.record_samples), dtype=np.complex64)


def fly_trial(scenario: SlamScenario, trial: int) -> SlamLog:
    """One trial's log."""
    assert scenario.vehicle is not None and scenario.beacon is not None
    _, vehicle, _ = truth(scenario)
    P, name = scenario.poses, scenario.vehicle.name
    drift = scenario.odometry.drift_mps * scenario.sonar.interval_s
    steps = np.diff(vehicle, axis=0) + drift * stream(scenario.seed, trial, name, "drift").standard_normal((P - 1, 2))
    stated = scenario.odometry.sigma_m if scenario.odometry.sigma_m is not None else max(drift, 1e-3)
    fixes = vehicle + scenario.fixes.sigma_m * stream(scenario.seed, trial, name, "fixes").standard_normal((P, 2))
    pings, arrays = hear(
        scenario,
        scenario.beacon.name,
        np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)]),
        sonar_of(scenario.sonar),
        scenario.sonar.interval_s,
        lambda poses: listen(scenario, poses, trial),
    )
    return SlamLog(
        steps=steps,
        step_cov=np.tile(stated**2 * np.eye(2), (P - 1, 1, 1)),
        fix_m=fixes,
        fix_sigma_m=scenario.fixes.sigma_m,
        fixed=tuple(evenly(scenario.fixes.count, P)),
        pings=pings,
        arrays=arrays,
    )
