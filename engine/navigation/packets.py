"""Packets as bytes: fixed layouts, quantization, a checksum; one row per trial.

A packet is a NumPy structured record; encoding a block of trials gives an array (trials, bytes) of uint8. What
arrives is decoded with the same layout and checked: wrong length, wrong checksum or a value no honest sender
would send makes that trial's packet invalid, never an exception.
"""

from __future__ import annotations

import binascii
from dataclasses import dataclass

import numpy as np

#: Every packet starts so: who sent it, and which of its broadcasts this is (wraps around).
HEADER = [("sender", "u1"), ("sequence", "<u2")]
CHECKSUM = [("checksum", "<u2")]


def layout(*fields: tuple) -> np.dtype:
    """A packet's record type: header, the given fields, checksum; packed without gaps."""
    return np.dtype([*HEADER, *fields, *CHECKSUM])


@dataclass(frozen=True)
class Decoded:
    """Records (trials,) as received, blank where not valid."""

    record: np.ndarray
    valid: np.ndarray


def encode(dtype: np.dtype, trials: int, **values: np.ndarray | int) -> np.ndarray:
    """Bytes (trials, dtype.itemsize) of one packet per trial; values are in the record's own units."""
    record = np.zeros(trials, dtype)
    for name, value in values.items():
        record[name] = value
    data = record.view(np.uint8).reshape(trials, dtype.itemsize)
    record["checksum"] = crc16(data[:, :-2])
    return data


def decode(dtype: np.dtype, data: np.ndarray) -> Decoded:
    """Read packets (trials, n) of a layout; a wrong length or checksum marks the trial invalid."""
    trials = data.shape[0]
    if data.ndim != 2 or data.shape[1] != dtype.itemsize:
        return Decoded(np.zeros(trials, dtype), np.zeros(trials, bool))
    data = np.ascontiguousarray(data)
    record = data.view(dtype)[:, 0].copy()
    valid = crc16(data[:, :-2]) == record["checksum"]
    record[~valid] = np.zeros((), dtype)
    return Decoded(record, valid)


def crc16(data: np.ndarray) -> np.ndarray:
    """CRC-16/CCITT-FALSE of each row of uint8 (trials, n)."""
    return np.array([binascii.crc_hqx(row.tobytes(), 0xFFFF) for row in data], np.uint16)


def to_steps(value: np.ndarray, step: float, dtype: str) -> np.ndarray:
    """Round to whole steps of an integer type, saturating at its limits; NaN becomes zero."""
    limits = np.iinfo(np.dtype(dtype))
    return np.clip(np.rint(np.nan_to_num(value) / step), limits.min, limits.max).astype(dtype)


def half_up(value: np.ndarray) -> np.ndarray:
    """Half-precision floats not below the given positive values: a quantized sigma never claims more."""
    half = np.asarray(value).astype(np.float16)
    return np.where(half < value, np.nextafter(half, np.float16(np.inf)), half)


#: A position belief of 2 means and 3 covariance terms (W11 section IV-D), in 14 bytes.
POSITION = [("position", "<i4", 2), ("sigma", "<f2", 2), ("correlation", "<i2")]
POSITION_STEP_M = 0.01
CORRELATION_STEP = 1 / 32767
DEPTH = [("depth", "<i2")]
DEPTH_STEP_M = 0.1


def pack_position(mean: np.ndarray, cov: np.ndarray) -> dict[str, np.ndarray]:
    """A belief (trials, 2), (trials, 2, 2) as POSITION fields: centimetres, half-float sigmas, correlation.

    Sigmas are rounded up and the correlation towards zero, so the packet stays positive definite.
    """
    sigma = np.sqrt(np.stack([cov[..., 0, 0], cov[..., 1, 1]], axis=-1))
    rho = cov[..., 0, 1] / (sigma[..., 0] * sigma[..., 1])
    steps = np.trunc(np.clip(rho, -1, 1) * 32766)
    return {
        "position": to_steps(mean, POSITION_STEP_M, "<i4"),
        "sigma": half_up(sigma),
        "correlation": steps.astype("<i2"),
    }


def unpack_position(record: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """POSITION fields back to mean (trials, 2), cov (trials, 2, 2) and which are a proper belief."""
    mean = record["position"] * POSITION_STEP_M
    sigma = record["sigma"].astype(float)
    rho = record["correlation"] * CORRELATION_STEP
    proper = np.isfinite(sigma).all(-1) & (sigma > 0).all(-1) & (np.abs(rho) < 1)
    sigma = np.where(proper[:, None], sigma, 1.0)
    rho = np.where(proper, rho, 0.0)
    cov = np.empty((len(record), 2, 2))
    cov[:, 0, 0], cov[:, 1, 1] = sigma[:, 0] ** 2, sigma[:, 1] ** 2
    cov[:, 0, 1] = cov[:, 1, 0] = rho * sigma[:, 0] * sigma[:, 1]
    return mean, cov, proper
