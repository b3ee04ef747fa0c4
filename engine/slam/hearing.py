"""From filtered records to what a vehicle makes of them: range densities of single pings, and synthetic arrays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from engine.acoustics.cautions import cautions
from engine.acoustics.density import noise_power
from engine.acoustics.range_density import amplitude_density, range_density
from engine.acoustics.sonar import Sonar, linear_chirp
from engine.acoustics.synthetic_array import synthesize
from engine.scenario.slam import SlamScenario, SonarSettings, array_starts
from engine.slam.log import Aperture, Ping, evenly


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


def hear(
    scenario: SlamScenario,
    beacon: str,
    reckoned: np.ndarray,
    sonar: Sonar,
    interval_s: float,
    listen: Callable[[np.ndarray], np.ndarray],
) -> tuple[tuple[Ping, ...], tuple[Aperture, ...]]:
    """The pings and arrays that a scenario asks for, of a vehicle at dead-reckoned positions (P, 2), m.

    listen gives the matched filter's complex output (K, n) at poses of these numbers (K,).
    """
    heard = evenly(scenario.ranging.count, len(reckoned))
    starts, m = array_starts(scenario, len(reckoned)), scenario.arrays.elements
    wanted = np.unique(np.array([*heard, *(s + i for s in starts for i in range(m))], dtype=int))
    filtered, place = listen(wanted), {int(k): n for n, k in enumerate(wanted)}
    arrays = []
    for start in starts:
        poses, shape = tuple(range(start, start + m)), reckoned[start : start + m]
        array = synthesize(filtered[[place[k] for k in poses]], shape, sonar, scenario.sonar.floor)
        arrays.append(Aperture(poses, beacon, array, tuple(cautions(shape, array.focus_m, interval_s, sonar))))
    pings = tuple(ping(k, beacon, filtered[place[k]], sonar, scenario.sonar) for k in heard)
    return pings, tuple(arrays)


def ping(pose: int, beacon: str, filtered: np.ndarray, sonar: Sonar, settings: SonarSettings) -> Ping:
    """What one filtered record (n,), complex, says of the range."""
    density = (amplitude_density if settings.weight == "amplitude" else range_density)(filtered, settings.floor)
    strength = np.abs(filtered)
    best = int(strength.argmax())
    snr_db = 10 * np.log10(strength[best] ** 2 / noise_power(filtered))
    some = np.flatnonzero(density > 1e-9)
    window = slice(some[0], some[-1] + 1)
    return Ping(pose, beacon, sonar.ranges_m[window], density[window], best * sonar.metres_per_sample, float(snr_db))
