"""The SAS factor: records along a synthetic array tie its poses and the beacon (C19 §4.4).

Its density is that of the known signal at the elements' distances r_i from the beacon. Backward, it draws an element's
distance by correlation with all the others (leave one out); near a point it is Gaussian in the distances; forward,
the solver weighs places all around by that, with the poses integrated out, where the thesis draws them from the beam
of given poses (SyntheticArray.sample_beacon, which is what `beamform_only` does).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.acoustics.beamformer import azimuths
from engine.acoustics.density import draw
from engine.acoustics.synthetic_array import DOUBT_NATS, SyntheticArray
from engine.slam.factors.factor import Factor

#: Peaks of each record that may be the direct path, and the least of the strongest's height that one has.
PEAKS, LEAST_HEIGHT = 6, 0.5
#: Leave-one-out rounds that bring each element's distance to the sum's peak, and the places they look at, m.
ROUNDS, STEPS_M = 1, np.linspace(-0.18, 0.18, 7)
#: Look angles of a beam drawn from.
LOOKS = 180


@dataclass(frozen=True, eq=False)
class SyntheticAperture(Factor):
    """Variables: the elements' poses (m), then the beacon.

    slack_m is the standard deviation of what all elements may be off together, relative_m of one against the next.
    peak_m, gain (m, K) are the distances at which each record's filter output peaks, and their log likelihoods; -inf
    where a record has fewer than K.
    """

    array: SyntheticArray
    slack_m: float
    relative_m: float
    peak_m: np.ndarray
    gain: np.ndarray

    def log_density(self, *values: np.ndarray) -> np.ndarray:
        *poses, beacon = values
        return self.array.log_likelihood(np.stack(np.broadcast_arrays(*(p[..., :2] for p in poses)), -2), beacon)

    def residual(self, *values: np.ndarray) -> np.ndarray:
        e, _ = self.linearize(*values)
        return e

    def linearize(self, *values: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """The density's second-order expansion in the distances about its peak near the points."""
        *poses, beacon = values
        at = np.stack(np.broadcast_arrays(*(p[..., :2] for p in poses)), -2)
        d = at - beacon[..., None, :]
        r = np.sqrt(np.square(d).sum(-1))
        u = d / np.maximum(r, 1e-9)[..., None]
        peak = self._peak(r)
        Lam, level = self._curvature(peak)
        value, basis = np.linalg.eigh(Lam)
        root = np.sqrt(np.maximum(value, 0.0))[..., None] * np.swapaxes(basis, -1, -2)
        e = np.einsum("...ij,...j->...i", root, r - peak)
        penalty = np.sqrt(2.0 * np.maximum(-level, 0.0))[..., None]
        e = np.concatenate([e, penalty], axis=-1)
        jacobians = []
        total = np.zeros((*e.shape, beacon.shape[-1]))
        for i, pose in enumerate(poses):
            J = np.zeros((*e.shape, pose.shape[-1]))
            J[..., :-1, :2] = root[..., :, i, None] * u[..., None, i, :]
            total[..., :2] -= J[..., :2]
            jacobians.append(J)
        return e, [*jacobians, total]

    def sample(
        self, towards: int, values: list[np.ndarray], strata: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        *poses, beacon = values
        elements = [p[..., :2] for p in poses]
        if towards == len(poses):
            # All around: a beam of poses that odometry has bent points astray, and the other side must have its chance.
            centre = np.mean([np.broadcast_to(p, (*strata.shape, 2)) for p in elements], axis=0)
            angle = 2 * np.pi * strata
            r = self.array.focus_m + self._ring_m * rng.standard_normal(strata.shape)
            return centre + r[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        at = np.stack(np.broadcast_arrays(*(np.broadcast_to(p, (*strata.shape, 2)) for p in elements)), -2)
        source = np.broadcast_to(beacon[..., :2], (*strata.shape, 2))
        r = self.array.sample_range(source, at, towards, rng, strata)
        d = at[..., towards, :] - source
        far = np.maximum(np.sqrt(np.square(d).sum(-1)), 1e-9)
        drawn = np.array(np.broadcast_to(values[towards], (*strata.shape, values[towards].shape[-1])))
        drawn[..., :2] = source + d * (r / far)[..., None]
        return drawn

    def log_proposal(self, towards: int, values: list[np.ndarray]) -> np.ndarray | None:
        *poses, beacon = values
        if towards != len(poses):
            return None
        centre = np.mean(np.broadcast_arrays(*(p[..., :2] for p in poses)), axis=0)
        r = np.sqrt(np.square(beacon - centre).sum(-1))
        return -0.5 * np.square((r - self.array.focus_m) / self._ring_m) - np.log(r)

    @property
    def _ring_m(self) -> float:
        """Spread of the range with which beacons are drawn, m."""
        return float(np.hypot(0.15, self.slack_m))

    def beam(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Look angles (A,) and the beam pattern (A,) of elements at (m, 2), its largest 1."""
        theta = azimuths(LOOKS)
        power = self.array.power(positions[None], theta)[0]
        return theta, power / power.max()

    def bearings(self, positions: np.ndarray, strata: np.ndarray) -> np.ndarray:
        """Bearings (N, ...) drawn from the beams of elements at (N, m, 2), at their quantiles strata (N, ...)."""
        density = self.array.bearing_density(positions, azimuths(LOOKS))
        flat = strata.reshape(len(strata), -1)
        drawn = np.stack([draw(density, u) for u in flat.T], axis=-1)
        return (2 * np.pi / LOOKS * drawn).reshape(strata.shape)

    def _peak(self, r: np.ndarray) -> np.ndarray:
        """The likeliest distances (..., m) near r (..., m): one peak of each record, then the peak of their sum.

        Peaks are chosen together (Viterbi): how far one is from r changes from element to element as odometry does.
        """
        off = self.peak_m - r[..., None]
        score = self.gain[0] - 0.5 * np.square(off[..., 0, :] / self.slack_m)
        chosen = []
        for i in range(1, r.shape[-1]):
            change = off[..., i, None, :] - off[..., i - 1, :, None]
            paths = score[..., :, None] - 0.5 * np.square(change / self.relative_m)
            chosen.append(paths.argmax(-2))
            score = paths.max(-2) + self.gain[i]
        k = score.argmax(-1)
        peak = np.empty(r.shape)
        for i in range(r.shape[-1] - 1, -1, -1):
            peak[..., i] = self.peak_m[i][k]
            if i > 0:
                k = np.take_along_axis(chosen[i - 1], k[..., None], -1)[..., 0]
        return self._focused(peak)

    def _focused(self, peak: np.ndarray) -> np.ndarray:
        elements = np.arange(peak.shape[-1])
        for _ in range(ROUNDS):
            output = self.array.output(elements, peak)
            moved = self.array.output(elements[:, None], peak[..., None] + STEPS_M)
            whole = output.sum(-1)
            for i in elements:
                chosen = np.abs((whole - output[..., i])[..., None] + moved[..., i, :]).argmax(-1)
                alone = np.take_along_axis(moved[..., i, :], chosen[..., None], -1)[..., 0]
                whole = whole - output[..., i] + alone
                peak[..., i] += STEPS_M[chosen]
        return peak

    def _curvature(self, peak: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Information (..., m, m) about the distances at a peak (..., m), and the log likelihood there (...,)."""
        m, h = peak.shape[-1], 0.04
        shifted = peak + np.array([-h, 0.0, h]).reshape(3, *(1,) * peak.ndim)
        low, mid, high = self.array.output(np.arange(m), shifted)
        total, slope = mid.sum(-1), (high - low) / (2 * h)
        Lam = -2.0 * self._scale * np.real(np.conj(slope)[..., :, None] * slope[..., None, :])
        bend = -2.0 * self._scale * np.real(np.conj(total)[..., None] * (high - 2 * mid + low) / h**2)
        Lam[..., np.arange(m), np.arange(m)] += bend
        most = self.array.loudest
        below = self._scale * (np.square(np.abs(total)) - most)
        level = np.logaddexp(below, -DOUBT_NATS)
        # What the likelihood's bound has levelled off tells less of the distances, too.
        share = np.exp(np.minimum(below - level, 0.0))
        return Lam * share[..., None, None], level

    @property
    def _scale(self) -> float:
        return self.array.temper / self.array.elements


def synthetic_aperture(
    poses: tuple[str, ...], beacon: str, array: SyntheticArray, slack_m: float, relative_m: float
) -> SyntheticAperture:
    """The SAS factor of an array whose elements are these poses, in its order."""
    if len(poses) != array.elements:
        raise ValueError(f"an array of {array.elements} elements cannot have {len(poses)} poses")
    strength = np.abs(array.envelope)
    peak_m = np.zeros((len(poses), PEAKS))
    gain = np.full((len(poses), PEAKS), -np.inf)
    for i, h in enumerate(strength):
        inner = np.flatnonzero((h[1:-1] >= h[:-2]) & (h[1:-1] > h[2:]) & (h[1:-1] >= LEAST_HEIGHT * h.max())) + 1
        best = inner[np.argsort(h[inner])[::-1][:PEAKS]] if len(inner) else np.array([h.argmax()])
        peak_m[i, : len(best)] = array.ranges_m[best]
        gain[i, : len(best)] = array.temper * np.square(h[best])
    return SyntheticAperture((*poses, beacon), array, slack_m, relative_m, peak_m, gain, costly=True)
