"""One-way travel time ranging: from a travel time to a horizontal range, and the EKF update with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.gaussian.forms import Moments, apply, symmetric

#: Closer than this (m) the direction between two vehicles is unknown and a range says nothing of it.
NEAREST_M = 1e-3


@dataclass(frozen=True)
class Innovation:
    """What a range update saw, per trial: value (m) and variance (m^2) NaN where nothing was heard."""

    value: np.ndarray
    variance: np.ndarray
    accepted: np.ndarray


def horizontal_range(slant_m: np.ndarray, depth_difference_m: np.ndarray) -> np.ndarray:
    """Project slant ranges to the local-level plane (W11 section II); NaN where depth alone exceeds the range."""
    square = slant_m**2 - depth_difference_m**2
    return np.sqrt(np.where(square > 0, square, np.nan))


def update_range(
    joint: Moments,
    receiver: slice,
    sender: slice,
    range_m: np.ndarray,
    sigma_m: float,
    *,
    scale: slice | None = None,
    gate_sigma: float | None = None,
) -> tuple[Moments, Innovation]:
    """Condition on a horizontal range between two position blocks, linearized at the mean (W11 eq. 6).

    range_m: (trials,) metres; NaN marks a reception that did not happen and leaves the trial as it was. Where
    `scale` names a one-state block kappa, the range is (1 + kappa) times the distance: an error of the assumed
    sound speed. An innovation beyond `gate_sigma` standard deviations is refused and reported as such.
    """
    m = joint.mean
    difference = m[..., receiver] - m[..., sender]
    distance = np.linalg.norm(difference, axis=-1)
    usable = np.isfinite(range_m) & (distance > NEAREST_M)
    u = difference / np.where(distance > NEAREST_M, distance, 1.0)[..., None]
    expected = distance
    H = np.zeros(m.shape)
    H[..., receiver] = u
    H[..., sender] = -u
    if scale is not None:
        kappa = m[..., scale][..., 0]
        H *= (1.0 + kappa)[..., None]
        H[..., scale] = distance[..., None]
        expected = distance * (1.0 + kappa)
    PH = apply(joint.cov, H)
    S = (H * PH).sum(-1) + sigma_m**2
    e = np.where(usable, range_m, expected) - expected
    accepted = usable if gate_sigma is None else usable & (e**2 <= gate_sigma**2 * S)
    K = PH * (accepted / S)[..., None]
    after = Moments(m + K * e[..., None], symmetric(joint.cov - K[..., :, None] * PH[..., None, :]))
    heard = np.isfinite(range_m)
    return after, Innovation(np.where(heard, e, np.nan), np.where(heard, S, np.nan), accepted)
