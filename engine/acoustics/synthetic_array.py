"""A synthetic array of one moving hydrophone: forward to the beacon, backward to an element (C19 sections 4.4.1-2)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import maximum_filter1d

from engine.acoustics.beamformer import Correlations, azimuths, correlate, look_delays
from engine.acoustics.cautions import aperture_m
from engine.acoustics.density import draw, floored, likely, noise_power
from engine.acoustics.sonar import Sonar
from engine.acoustics.zoom import zoom_transform

#: How far beyond the aperture elements may turn out to be apart, m: the reach of the tabulated correlations.
SLACK_M = 12.0
#: Quantile below which power and correlation are taken for noise (C19: 0.6 to 0.8).
FLOOR = 0.8
#: Look angles at which a new array is focused once.
SCAN = 120
#: Samples from range to range where one is drawn along a bearing: 0.12 m, a fraction of the chirp's resolution.
COARSE = 3
#: The most that an array may say for one place against another, as a log likelihood ratio. Loud records would say
#: more, but echoes and bent wave fronts, which no likelihood of noise knows, grow with them.
MOST_NATS = 30.0
#: How far below its best place an array can put any other: the chance left to what all records misheard alike.
DOUBT_NATS = 12.0


@dataclass(frozen=True, eq=False)
class SyntheticArray:
    """What m records tell of a beacon and of the elements' positions, whatever these turn out to be.

    envelope (m, W) complex output of the matched filter over the range window ranges_m (W,), divided by the root mean
    square of its noise; outside of the window there is nothing that several records agree on. focus_m is the range the
    beam is focused on, loudest the power there if the elements are where they were believed to be. Log likelihoods are
    those of a known signal in noise (C19 eq. 4.26), its amplitude and phase estimated, times `temper`.
    """

    sonar: Sonar
    correlations: Correlations
    envelope: np.ndarray
    ranges_m: np.ndarray
    focus_m: float
    loudest: float
    temper: float
    floor: float = FLOOR

    @property
    def elements(self) -> int:
        """Number of elements m."""
        return len(self.envelope)

    def power(self, positions: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
        """Beam power (..., A) over look angles (A,) from the centre of elements at (..., m, 2) (C19 eq. 4.114).

        In units of one element's noise power, the mean over the band's independent bins summed over them.
        """
        delays = look_delays(positions - _centre(positions), azimuth, self.sonar.sound_speed_mps, self.focus_m)
        return self.correlations.power(delays)

    def bearing_density(self, positions: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
        """Density (..., A) over look angles, above its quantile floor (C19 eq. 4.115, Algorithm 2).

        The likelihood of an unknown sound from there, which is the exponential of the power: the power itself, as
        (4.115) has it, leaves most samples on the noise between the beams.
        """
        return floored(likely(self.temper / self.elements * self.power(positions, azimuth)), self.floor)

    def sample_beacon(
        self, positions: np.ndarray, rng: np.random.Generator, strata: np.ndarray | None = None, looks: int = 180
    ) -> np.ndarray:
        """Beacon positions (..., 2) for sets of element positions (..., m, 2): forward (C19 eq. 4.116-4.119).

        The bearing is drawn from the beam, at its quantiles `strata` (...,) where given, and the range from the output
        of the filter summed over the elements along it. The leading axes of positions and strata broadcast: sets with
        an axis of length 1 have their beam formed once for all draws along it.
        """
        quantile = rng.random(positions.shape[:-2]) if strata is None else strata
        theta = 2 * np.pi / looks * draw(self.bearing_density(positions, azimuths(looks)), quantile)
        u = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
        weight = likely(self.temper / self.elements * self.power_along(positions, u, COARSE))
        bins = draw(floored(weight, self.floor), rng.random(theta.shape))
        return _centre(positions)[..., 0, :] + self._range_at(COARSE * bins)[..., None] * u

    def power_along(self, positions: np.ndarray, direction: np.ndarray, every: int = 1) -> np.ndarray:
        """Power (..., W) of the summed filter output for a beacon at `every` so many ranges_m from the centre.

        positions (..., m, 2) and unit vectors direction (..., 2) broadcast.
        """
        beacon = _centre(positions) + self.ranges_m[::every, None] * direction[..., None, :]
        return self.focused_power(positions[..., None, :, :], beacon)

    def focused_power(self, positions: np.ndarray, beacon: np.ndarray) -> np.ndarray:
        """Power (...,) of the filter output summed over elements (..., m, 2) at their ranges from a beacon (..., 2).

        In units of one element's noise power; the beam's power where it is focused, without what comes elsewhere.
        """
        x, y = beacon[..., 0], beacon[..., 1]
        total: np.ndarray | float = 0.0
        for i in range(self.elements):
            dx, dy = x - positions[..., i, 0], y - positions[..., i, 1]
            total = total + self.output(i, np.sqrt(dx * dx + dy * dy))
        return np.abs(total) ** 2

    def log_likelihood(self, positions: np.ndarray, beacon: np.ndarray) -> np.ndarray:
        """Of elements at (..., m, 2) with a beacon at (..., 2): (...,), 0 where it was loudest, above -DOUBT_NATS."""
        below = self.temper / self.elements * (self.focused_power(positions, beacon) - self.loudest)
        return np.logaddexp(below, -DOUBT_NATS)

    def leave_one_out(self, beacon: np.ndarray, positions: np.ndarray, i: int) -> np.ndarray:
        """Power (N, W) of the others' summed output plus element i's as if at ranges_m from the beacon (C19 eq. 4.124).

        beacon (N, 2); positions (N, m, 2), of which element i's is not looked at. Algorithm 6 on the filter's output
        where the beacon's sound arrives, instead of on all of the records.
        """
        others = np.zeros(len(beacon), dtype=self.envelope.dtype)
        for j in range(self.elements):
            if j != i:
                others += self.output(j, np.linalg.norm(beacon - positions[:, j], axis=-1))
        return np.abs(others[:, None] + self.envelope[i]) ** 2

    def range_density(self, beacon: np.ndarray, positions: np.ndarray, i: int) -> np.ndarray:
        """Density (N, W) over ranges_m of element i from the beacon, above its quantile floor: `leave_one_out`'s."""
        power = self.leave_one_out(beacon, positions, i)
        return floored(likely(self.temper / self.elements * power), self.floor)

    def sample_range(
        self,
        beacon: np.ndarray,
        positions: np.ndarray,
        i: int,
        rng: np.random.Generator,
        strata: np.ndarray | None = None,
    ) -> np.ndarray:
        """One range (N,) of element i from each beacon (N, 2), given the other elements: backward (C19 Algorithm 6).

        Across the line of sight the sonar says nothing of an element (C19 Fig. 4-36): only its range is drawn.
        """
        quantile = rng.random(len(beacon)) if strata is None else strata
        return self._range_at(draw(self.range_density(beacon, positions, i), quantile))

    def _range_at(self, bin_: np.ndarray) -> np.ndarray:
        return self.ranges_m[0] + bin_ * (self.ranges_m[1] - self.ranges_m[0])

    def output(self, i: int | np.ndarray, range_m: np.ndarray) -> np.ndarray:
        """Output (...,) of element i's matched filter at ranges (...,) from the beacon; zero outside the window.

        i may be an array of elements that broadcasts with the ranges.
        """
        value, slope = self._tables
        spacing = self.ranges_m[1] - self.ranges_m[0]
        place = (range_m - self.ranges_m[0]) / spacing + 1.0
        place = np.clip(place, 0.0, value.shape[1] - 1.0)
        k = place.astype(np.intp)
        here = k + np.asarray(i) * value.shape[1]
        return value.take(here) + slope.take(here) * (place - k).astype(np.float32)

    @cached_property
    def _tables(self) -> tuple[np.ndarray, np.ndarray]:
        """The envelope with a zero on either side, and its differences: (m, W + 2) each, complex64."""
        value = np.pad(self.envelope, ((0, 0), (1, 1)))
        return value, np.diff(value, axis=1, append=0).astype(np.complex64)


def _centre(positions: np.ndarray) -> np.ndarray:
    return positions.mean(-2, keepdims=True)


def agreed_window(filtered: np.ndarray, reach_samples: int) -> np.ndarray:
    """Mask (n,) of the delays around which several filtered records (m, n) have their strongest outputs.

    A source at any bearing is within reach_samples of the same delay in all records: the mean over records of the
    largest output within that reach stands out there, as it does not for the outputs that noise throws up anywhere.
    """
    strongest = maximum_filter1d(np.abs(filtered), 2 * reach_samples + 1, axis=-1).mean(0)
    level = np.median(strongest)
    return strongest >= level + 0.5 * (strongest.max() - level)


def synthesize(filtered: np.ndarray, positions: np.ndarray, sonar: Sonar, floor: float = FLOOR) -> SyntheticArray:
    """The synthetic array of filtered records (m, n), complex, at elements roughly at positions (m, 2).

    The positions only say how far apart elements may be; the array is then asked about any others.
    Raises ValueError for fewer than two records.
    """
    if len(filtered) < 2 or len(filtered) != len(positions):
        raise ValueError(f"{len(filtered)} records at {len(positions)} positions: an array has two or more, one each")
    reach_m = 2 * float(aperture_m(positions)) + SLACK_M
    mask = agreed_window(filtered, int(reach_m / 2 / sonar.metres_per_sample))
    inside = np.flatnonzero(mask)
    window = slice(inside[0], inside[-1] + 1)
    gated = np.where(mask, filtered / np.sqrt(noise_power(filtered)).mean(), 0.0)
    band = (sonar.high_hz - sonar.low_hz) / sonar.sampling_hz
    correlations = correlate(2 * band * zoom_transform(np.real(gated), sonar), sonar, reach_m / sonar.sound_speed_mps)
    ranges = sonar.ranges_m[window]
    array = SyntheticArray(sonar, correlations, gated[:, window].astype(np.complex64), ranges, 0.0, 0.0, 1.0, floor)
    looks = azimuths(SCAN)
    around = np.stack([np.cos(looks), np.sin(looks)], axis=-1)
    loudness = array.power_along(np.broadcast_to(positions, (SCAN, *positions.shape)), around)
    loudest, best = float(loudness.max()), int(loudness.max(0).argmax())
    temper = min(1.0, MOST_NATS * len(filtered) / loudest)
    return replace(array, focus_m=float(ranges[best]), loudest=loudest, temper=temper)
