"""Simulated missions: true paths, drifting odometry, and waveforms through the water and the whole sonar chain."""

from __future__ import annotations

import numpy as np

from engine.acoustics.cautions import cautions
from engine.acoustics.density import noise_power
from engine.acoustics.matched_filter import matched_filter
from engine.acoustics.noise import Noise
from engine.acoustics.propagation import Wall, Water, record
from engine.acoustics.range_density import amplitude_density, range_density
from engine.acoustics.sonar import Sonar, linear_chirp
from engine.acoustics.synthetic_array import synthesize
from engine.mission.routes import route
from engine.mission.streams import stream
from engine.scenario.slam import SlamScenario, SonarSettings, WaterSettings, array_starts
from engine.slam.log import Aperture, Ping, SlamLog

#: Records processed at once, to bound memory.
CHUNK = 128


def sonar_of(settings: SonarSettings) -> Sonar:
    """The receiver that a scenario describes."""
    chirp = linear_chirp(settings.low_hz, settings.high_hz, settings.chirp_samples, settings.sampling_hz)
    return Sonar(
        chirp,
        settings.low_hz,
        settings.high_hz,
        settings.sampling_hz,
        settings.record_samples,
        settings.sound_speed_mps,
    )


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


def evenly(count: int, poses: int) -> list[int]:
    """Numbers of `count` poses from the first to the last, evenly spread."""
    if count == 1:
        return [0]
    return [round(k * (poses - 1) / (count - 1)) for k in range(count)]


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
    interval, odometry = scenario.sonar.interval_s, scenario.odometry
    drift = odometry.drift_mps * interval
    steps = np.diff(vehicle, axis=0) + drift * stream(scenario.seed, trial, name, "drift").standard_normal((P - 1, 2))
    stated = odometry.sigma_m if odometry.sigma_m is not None else max(drift, 1e-3)
    fixes = vehicle + scenario.fixes.sigma_m * stream(scenario.seed, trial, name, "fixes").standard_normal((P, 2))

    heard = evenly(scenario.ranging.count, P) if scenario.ranging.count else []
    starts, m = array_starts(scenario), scenario.arrays.elements
    wanted = np.unique(np.array([*heard, *(s + i for s in starts for i in range(m))], dtype=int))
    filtered = listen(scenario, wanted, trial)
    sonar, place = sonar_of(scenario.sonar), {int(k): n for n, k in enumerate(wanted)}
    reckoned = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])

    arrays = []
    for start in starts:
        poses = tuple(range(start, start + m))
        shape = reckoned[start : start + m]
        array = synthesize(filtered[[place[k] for k in poses]], shape, sonar, scenario.sonar.floor)
        warned = tuple(cautions(shape, array.focus_m, interval, sonar))
        arrays.append(Aperture(poses, scenario.beacon.name, array, warned))
    return SlamLog(
        steps=steps,
        step_cov=np.tile(stated**2 * np.eye(2), (P - 1, 1, 1)),
        fix_m=fixes,
        fix_sigma_m=scenario.fixes.sigma_m,
        fixed=tuple(evenly(scenario.fixes.count, P)),
        pings=tuple(ping(k, scenario.beacon.name, filtered[place[k]], sonar, scenario.sonar) for k in heard),
        arrays=tuple(arrays),
    )


def ping(pose: int, beacon: str, filtered: np.ndarray, sonar: Sonar, settings: SonarSettings) -> Ping:
    """What one filtered record (n,), complex, says of the range."""
    density = (amplitude_density if settings.weight == "amplitude" else range_density)(filtered, settings.floor)
    strength = np.abs(filtered)
    best = int(strength.argmax())
    snr_db = 10 * np.log10(strength[best] ** 2 / noise_power(filtered))
    some = np.flatnonzero(density > 1e-9)
    window = slice(some[0], some[-1] + 1)
    return Ping(pose, beacon, sonar.ranges_m[window], density[window], best * sonar.metres_per_sample, float(snr_db))
