"""Packets of composed links (W15 section V-A): the new launch's odometry and k links with priors, in one frame.

A link is sent composed to its stretch's origin: position in whole centimetres, covariance in whole square centimetres
times a power of two. The sender adds its links up on that lattice, always rounding covariances up, so that any two
received links decompose to a covariance that is positive and never smaller than the true one. With k = 2 a packet is
506 bits: a single 64-byte frame. Pose chains of SE(2) do not fit and are sent in floats.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.gaussian.forms import symmetric
from engine.navigation.packets import crc16

POSITION_STEP_M = 0.01
VARIANCE_STEP_M2 = 1e-4
DEPTH_STEP_M = 0.1
#: Largest number of variance steps before the exponent goes up.
_VARIANCE_LIMIT = 2**19 - 2
#: Standard deviations of priors: so many steps a decade, from the smallest, rounded up.
_SIGMA_STEPS_PER_DECADE, _SMALLEST_SIGMA_M = 73, 1e-3
#: Age of an empty slot, and of a stretch that goes back to the frame's origin.
NONE = 255
OLDEST = 254

_HEAD = [("sender", 8), ("sequence", 16), ("depth", 16), ("stretch", 8)]
_ODOMETRY = [("x", -20), ("y", -20), ("exponent", 4), ("xx", 19), ("yy", 19), ("xy", -20)]
_PRIOR = [("dx", -17), ("dy", -17), ("sx", 9), ("sy", 9), ("rho", -8)]


def frame_fields(k: int) -> list[tuple[str, int]]:
    """Names and widths in bits (negative: signed) of a packet with k slots."""
    fields = [*_HEAD, *((f"new.{name}", bits) for name, bits in _ODOMETRY)]
    for slot in range(k):
        fields.append((f"{slot}.age", 8))
        fields += [(f"{slot}.{name}", bits) for name, bits in (*_ODOMETRY, *_PRIOR)]
    return fields


def frame_bytes(k: int) -> int:
    """Length of a packet with k slots, checksum included."""
    return -(-sum(abs(bits) for _, bits in frame_fields(k)) // 8) + 2


def write_bits(fields: list[tuple[str, int]], trials: int, values: dict[str, np.ndarray | int]) -> np.ndarray:
    """Pack integers into bytes (trials, n) with a CRC-16: a field left out is zero, too large a value saturates."""
    columns = []
    for name, bits in fields:
        width = abs(bits)
        low, high = (-(2 ** (width - 1)), 2 ** (width - 1) - 1) if bits < 0 else (0, 2**width - 1)
        value = np.broadcast_to(np.asarray(values.get(name, 0), np.int64), (trials,))
        columns.append((np.clip(value, low, high)[:, None] >> np.arange(width - 1, -1, -1)) & 1)
    data = np.packbits(np.concatenate(columns, axis=1).astype(np.uint8), axis=1)
    check = crc16(data)
    return np.concatenate([data, (check & 0xFF)[:, None], (check >> 8)[:, None]], axis=1).astype(np.uint8)


def read_bits(fields: list[tuple[str, int]], data: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Unpack bytes (trials, n): integers by name, and which trials have the right length and checksum."""
    trials = len(data)
    need = -(-sum(abs(bits) for _, bits in fields) // 8)
    if data.shape[1] != need + 2:
        return {name: np.zeros(trials, np.int64) for name, _ in fields}, np.zeros(trials, bool)
    check = data[:, -2].astype(np.uint16) | (data[:, -1].astype(np.uint16) << 8)
    valid = crc16(np.ascontiguousarray(data[:, :-2])) == check
    bits = np.unpackbits(data[:, :-2], axis=1).astype(np.int64)
    values, at = {}, 0
    for name, signed in fields:
        width = abs(signed)
        value = bits[:, at : at + width] @ (1 << np.arange(width - 1, -1, -1, dtype=np.int64))
        values[name] = np.where(value >= 2 ** (width - 1), value - 2**width, value) if signed < 0 else value
        at += width
    return values, valid


@dataclass(frozen=True)
class Lattice:
    """Composed odometry as it is sent: position (trials, 2) in centimetres; covariance (trials, 3) xx, yy, xy in steps
    of VARIANCE_STEP_M2 times 2^exponent (trials,)."""

    position: np.ndarray
    covariance: np.ndarray
    exponent: np.ndarray

    def z(self) -> np.ndarray:
        return self.position * POSITION_STEP_M

    def R(self) -> np.ndarray:
        xx, yy, xy = np.moveaxis(self.covariance * (VARIANCE_STEP_M2 * 2.0**self.exponent)[:, None], -1, 0)
        return np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)


def onto_lattice(z: np.ndarray, R: np.ndarray, exponent: np.ndarray) -> Lattice:
    """Round a composed relation z (trials, 2), R (trials, 2, 2), the covariance up, with no less than an exponent."""
    largest = np.maximum(R[:, 0, 0], R[:, 1, 1]) / VARIANCE_STEP_M2
    need = np.ceil(np.log2(np.maximum(largest, 1.0) / (_VARIANCE_LIMIT - 2)))
    exponent = np.clip(np.maximum(exponent, need), 0, 15).astype(int)
    step = VARIANCE_STEP_M2 * 2.0**exponent
    xy = np.rint(R[:, 0, 1] / step)
    # Half a step more on the diagonal outweighs what rounding takes from the corner.
    xx, yy = (np.ceil(R[:, i, i] / step + 0.5 - 1e-9) for i in range(2))
    covariance = np.minimum(np.stack([xx, yy, xy], axis=-1), _VARIANCE_LIMIT + 1).astype(np.int64)
    return Lattice(np.rint(z / POSITION_STEP_M).astype(np.int64), covariance, exponent)


def odometry_values(prefix: str, lattice: Lattice) -> dict[str, np.ndarray]:
    """A composed relation as packet fields."""
    x, y = lattice.position.T
    xx, yy, xy = lattice.covariance.T
    return {
        f"{prefix}.x": x,
        f"{prefix}.y": y,
        f"{prefix}.exponent": lattice.exponent,
        f"{prefix}.xx": xx,
        f"{prefix}.yy": yy,
        f"{prefix}.xy": xy,
    }


def read_odometry(prefix: str, values: dict[str, np.ndarray]) -> Lattice:
    """Packet fields back to a composed relation."""
    return Lattice(
        np.stack([values[f"{prefix}.x"], values[f"{prefix}.y"]], axis=-1),
        np.stack([values[f"{prefix}.{name}"] for name in ("xx", "yy", "xy")], axis=-1),
        values[f"{prefix}.exponent"],
    )


def prior_values(prefix: str, mean: np.ndarray, cov: np.ndarray, near: Lattice) -> dict[str, np.ndarray]:
    """A prior mean (trials, 2), cov (trials, 2, 2) as packet fields, its position counted from the link's own.

    The covariance that is sent is never smaller than the given one in any direction.
    """
    sigma, rho = _sigma_up(cov)
    offset = np.rint(mean / POSITION_STEP_M).astype(np.int64) - near.position
    return {
        f"{prefix}.dx": offset[:, 0],
        f"{prefix}.dy": offset[:, 1],
        f"{prefix}.sx": sigma[:, 0],
        f"{prefix}.sy": sigma[:, 1],
        f"{prefix}.rho": rho,
    }


def read_prior(prefix: str, values: dict[str, np.ndarray], near: Lattice) -> tuple[np.ndarray, np.ndarray]:
    """Packet fields back to a prior's mean (trials, 2) and covariance (trials, 2, 2)."""
    offset = np.stack([values[f"{prefix}.dx"], values[f"{prefix}.dy"]], axis=-1)
    sigma = np.stack([values[f"{prefix}.sx"], values[f"{prefix}.sy"]], axis=-1)
    return (near.position + offset) * POSITION_STEP_M, _prior_cov(sigma, values[f"{prefix}.rho"])


def _prior_cov(sigma: np.ndarray, rho: np.ndarray) -> np.ndarray:
    s = _SMALLEST_SIGMA_M * 10.0 ** (sigma / _SIGMA_STEPS_PER_DECADE)
    xy = np.clip(rho, -127, 127) / 128.0 * s[:, 0] * s[:, 1]
    return np.stack([np.stack([s[:, 0] ** 2, xy], -1), np.stack([xy, s[:, 1] ** 2], -1)], -2)


def _sigma_up(cov: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quantized sigmas (trials, 2) and correlation (trials,) of a covariance that bounds the given one from above."""
    s = np.sqrt(np.stack([cov[:, 0, 0], cov[:, 1, 1]], axis=-1))
    rho = np.rint(np.clip(cov[:, 0, 1] / (s[:, 0] * s[:, 1]), -0.99, 0.99) * 128)
    larger = np.ones(len(cov))
    sigma = _sigma_index(s)
    for _ in range(8):
        root = np.linalg.cholesky(_prior_cov(sigma, rho))
        half = np.linalg.solve(root, cov)
        excess = np.linalg.eigvalsh(symmetric(np.linalg.solve(root, np.swapaxes(half, -1, -2))))[:, -1]
        short = excess > 1.0
        if not short.any():
            return sigma, rho
        larger[short] *= np.sqrt(excess[short]) * 1.001
        sigma = _sigma_index(s * larger[:, None])
    widest = np.sqrt(np.linalg.eigvalsh(cov)[:, -1])
    bound = _sigma_index(np.stack([widest, widest], axis=-1))
    return np.where(short[:, None], bound, sigma), np.where(short, 0, rho)


def _sigma_index(sigma: np.ndarray) -> np.ndarray:
    steps = np.ceil(np.log10(np.maximum(sigma, _SMALLEST_SIGMA_M) / _SMALLEST_SIGMA_M) * _SIGMA_STEPS_PER_DECADE - 1e-9)
    return np.clip(steps, 0, 511).astype(np.int64)


#: A pose chain's link: age, composed pose and covariance; prior, infinite where there is none.
POSE_LINK = np.dtype(
    [("age", "u1"), ("z", "<f8", 3), ("R", "<f8", 6), ("prior_mean", "<f8", 3), ("prior_cov", "<f8", 6)]
)
