"""The conventional beamformer over azimuth, by its definition and by tabulated correlations (C19 section 4.2.4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from engine.acoustics.sonar import Sonar
from engine.acoustics.zoom import band_frequencies, chirp_z

#: Spacing of the tabulated correlations, s: their cubic interpolation is then off by less than 5e-7 at 2050 Hz.
LAG_STEP_S = 8e-6


def azimuths(count: int = 180) -> np.ndarray:
    """Look angles (count,) over the full circle, radians from x counter-clockwise."""
    return 2 * np.pi / count * np.arange(count)


def look_delays(offsets: np.ndarray, azimuth: np.ndarray, sound_speed_mps: float, range_m=np.inf) -> np.ndarray:
    """How much later than at the reference a wave from each azimuth (A,) comes to elements: (..., m, A), s.

    offsets (..., m, 2) from the reference, m. A plane wave (C19 eq. 4.44), or with a finite `range_m` from the
    reference the circle around a source there, which also holds in the near field.
    """
    u = np.stack([np.cos(azimuth), np.sin(azimuth)])
    along = offsets @ u
    if np.isinf(range_m):
        return -along / sound_speed_mps
    squared = (offsets**2).sum(-1)[..., None]
    return (squared - 2 * range_m * along) / (
        (np.sqrt(np.maximum(range_m**2 - 2 * range_m * along + squared, 0.0)) + range_m) * sound_speed_mps
    )


def direct_power(spectra: np.ndarray, delays: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    """Beam power (..., A) of element spectra (m, K) delayed by (..., m, A), s, bin by bin (C19 eq. 4.52, 4.53)."""
    power = np.zeros((*delays.shape[:-2], delays.shape[-1]))
    for F, f in zip(spectra.T, frequencies, strict=True):
        Y = np.einsum("m,...ma->...a", F, np.exp(2j * np.pi * f * delays))
        power += Y.real**2 + Y.imag**2
    return power / len(frequencies)


@dataclass(frozen=True, eq=False)
class Correlations:
    """Band-limited cross-correlations of the elements' records: R_ij(lag) = mean over bins of F_i F_j* exp(j w lag).

    energy (m,) is R_ii(0); table (pairs, G, 4) has, pair by pair i < j, the cubic of the real part in the fraction of
    each step of LAG_STEP_S from -reach_s on. Beyond the reach nothing correlates: there the table answers zero.
    """

    energy: np.ndarray
    table: np.ndarray
    reach_s: float

    @property
    def elements(self) -> int:
        """Number of elements m."""
        return len(self.energy)

    @cached_property
    def pairs(self) -> list[tuple[int, int]]:
        """The pairs i < j in the table's order."""
        m = self.elements
        return [(i, j) for i in range(m) for j in range(i + 1, m)]

    @cached_property
    def _row(self) -> dict[tuple[int, int], int]:
        return {pair: n for n, pair in enumerate(self.pairs)}

    def at(self, i: int, j: int, lag_s: np.ndarray) -> np.ndarray:
        """Real part of R_ij at lags (...), s."""
        if i > j:
            i, j, lag_s = j, i, -lag_s
        steps = self.table.shape[1]
        place = (lag_s + self.reach_s) * (1.0 / LAG_STEP_S)
        outside = (place < 0) | (place >= steps)
        place = np.where(outside, 0.0, place)
        k = place.astype(np.int64)
        x = (place - k).astype(self.table.dtype)
        a = self.table[self._row[i, j]][k]
        value = ((a[..., 3] * x + a[..., 2]) * x + a[..., 1]) * x + a[..., 0]
        return np.where(outside, 0.0, value)

    def power(self, delays: np.ndarray) -> np.ndarray:
        """Beam power (..., A) at element delays (..., m, A), s: sum over i and j of R_ij(tau_i - tau_j)."""
        total = np.full((*delays.shape[:-2], delays.shape[-1]), self.energy.sum())
        for i, j in self.pairs:
            total += 2.0 * self.at(i, j, delays[..., i, :] - delays[..., j, :])
        return total


def correlate(spectra: np.ndarray, sonar: Sonar, reach_s: float) -> Correlations:
    """Tabulate the cross-correlations of element spectra (m, K), as of `zoom_transform`, to lags of reach_s."""
    m, K = spectra.shape
    f = band_frequencies(sonar, K)
    half = int(np.ceil(reach_s / LAG_STEP_S)) + 1
    reach_s = half * LAG_STEP_S
    i, j = np.triu_indices(m, 1)
    cross = spectra[i] * np.conj(spectra[j])
    to_lags = chirp_z(K, 2 * half + 1, w=np.exp(2j * np.pi * (f[1] - f[0]) * LAG_STEP_S), a=1.0)
    lag = LAG_STEP_S * np.arange(-half, half + 1)
    back = np.exp(-2j * np.pi * (f - f[0]) * reach_s)
    carrier = np.exp(2j * np.pi * f[0] * lag)
    value = (to_lags(cross * back) * carrier).real / K
    slope = (to_lags(2j * np.pi * f * cross * back) * carrier).real / K * LAG_STEP_S
    v0, v1, s0, s1 = value[:, :-1], value[:, 1:], slope[:, :-1], slope[:, 1:]
    cubic = np.stack([v0, s0, 3 * (v1 - v0) - 2 * s0 - s1, 2 * (v0 - v1) + s0 + s1], axis=-1)
    energy = (np.abs(spectra) ** 2).mean(-1)
    return Correlations(energy, cubic.astype(np.float32), reach_s)
