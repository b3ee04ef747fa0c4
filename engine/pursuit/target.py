"""The target: constant speed, a heading that wanders (C19 eq. 3.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.gaussian.forms import Moments, apply, symmetric, transpose
from engine.pursuit.sigma_points import Rule, gather, spread


@dataclass(frozen=True)
class Motion:
    """speed V m/s; turn_psd rad^2/s, of the white turn rate; drift_psd m^2/s, of a random walk of every axis on top."""

    speed_mps: float
    turn_psd: float
    drift_psd: float = 0.0


def wander(motion: Motion, start: np.ndarray, step_s: float, turns: np.ndarray, drifts: np.ndarray) -> np.ndarray:
    """True states (trials, T+1, n) [x, y(, z), heading] from start (trials, n), every step_s.

    turns (trials, T) and drifts (trials, T, n-1) are standard normals. The heading within a step is that of its middle.
    """
    trials, T, dims = drifts.shape
    heading = np.empty((trials, T + 1))
    heading[:, 0] = start[:, -1]
    heading[:, 1:] = start[:, -1:] + np.cumsum(np.sqrt(motion.turn_psd * step_s) * turns, axis=1)
    middle = 0.5 * (heading[:, 1:] + heading[:, :-1])
    moves = np.sqrt(motion.drift_psd * step_s) * drifts
    moves[..., 0] += motion.speed_mps * step_s * np.cos(middle)
    moves[..., 1] += motion.speed_mps * step_s * np.sin(middle)
    states = np.empty((trials, T + 1, dims + 1))
    states[..., -1] = heading
    states[:, 0, :-1] = start[:, :-1]
    states[:, 1:, :-1] = start[:, None, :-1] + np.cumsum(moves, axis=1)
    return states


def predict(belief: Moments, motion: Motion, seconds: float, rule: Rule) -> Moments:
    """The belief (..., n) over the state [x, y(, z), heading] some seconds later (C19 eq. 3.7-3.9).

    Sigma points stand for the belief at the start; what the white turn rate does from there has exact moments.
    """
    quadrature = rule(belief.mean.shape[-1])
    points = spread(belief, quadrature)
    turned = wandering(motion, seconds)
    heading = points[..., -1]
    cos, sin = np.cos(heading), np.sin(heading)
    points[..., 0] += turned.ahead_m * cos
    points[..., 1] += turned.ahead_m * sin
    moved = gather(points, quadrature.weights)

    ahead, aside = np.zeros_like(points), np.zeros_like(points)
    ahead[..., 0], ahead[..., 1] = cos, sin
    aside[..., 0], aside[..., 1] = -sin, cos
    weights = quadrature.weights[:, None]
    Q = turned.ahead_m2 * (transpose(ahead) @ (weights * ahead)) + turned.aside_m2 * (
        transpose(aside) @ (weights * aside)
    )
    with_turn = turned.aside_turn_m * apply(transpose(aside), quadrature.weights)
    Q[..., :, -1] += with_turn
    Q[..., -1, :] += with_turn
    Q[..., -1, -1] += motion.turn_psd * seconds
    axes = np.arange(points.shape[-1] - 1)
    Q[..., axes, axes] += motion.drift_psd * seconds
    return Moments(moved.mean, symmetric(moved.cov + Q))


@dataclass(frozen=True)
class Wandering:
    """Moments of a displacement, in the frame of the heading it began with: the mean ahead, the variances ahead and
    aside, and the covariance of the way aside with the turn."""

    ahead_m: float
    ahead_m2: float
    aside_m2: float
    aside_turn_m: float


def wandering(motion: Motion, seconds: float) -> Wandering:
    """The displacement V int exp(i W) ds, W Brownian of rate q: from E exp(i W(s)) = exp(-q s / 2) and its like."""
    V, q, T = motion.speed_mps, motion.turn_psd, seconds
    a = 0.5 * q
    if a * T < 1e-3:  # the exact terms cancel; these are the first of their series
        return Wandering(V * T * (1 - 0.5 * a * T), 0.0, V * V * q * T**3 / 3, 0.5 * V * q * T * T)
    slow, fast = -np.expm1(-a * T) / a, -np.expm1(-4 * a * T) / (4 * a)
    square = 2 * (T - slow) / a  # E |D|^2
    double = 2 * (slow - fast) / (3 * a)  # E D^2
    return Wandering(
        V * slow,
        V * V * (0.5 * (square + double) - slow**2),
        V * V * 0.5 * (square - double),
        V * q * (slow - T * np.exp(-a * T)) / a,
    )


def jitter(belief: Moments, motion: Motion, jitter_s: float) -> np.ndarray:
    """Covariance (..., d, d) m^2 of how far the target gets along its heading within its clock's jitter_s (one sigma).

    The mean of u u' over a normal heading, u its unit vector.
    """
    heading, blunting = belief.mean[..., -1], np.exp(-2.0 * belief.cov[..., -1, -1])
    cos, sin = blunting * np.cos(2 * heading), blunting * np.sin(2 * heading)
    d = belief.mean.shape[-1] - 1
    out = np.zeros((*heading.shape, d, d))
    out[..., 0, 0], out[..., 1, 1] = 1 + cos, 1 - cos
    out[..., 0, 1] = out[..., 1, 0] = sin
    return 0.5 * (motion.speed_mps * jitter_s) ** 2 * out
