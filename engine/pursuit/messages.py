"""What a vehicle says in its slot: every arrival it knows of this cycle, with the place where it was heard."""

from __future__ import annotations

import struct
from collections.abc import Mapping

import numpy as np

from engine.tracks import PacketCount

#: An arrival counts microseconds from the start of the cycle, a place centimetres, each in 24 bits.
TICK_S, GRAIN_M = 1e-6, 0.01
HEADER_BYTES, ENTRY_BYTES = 2, 10
#: The floats of one entry: arrival, x and y.
ENTRY_FLOATS = 3
#: The waypoints of a shore station's command: x and y in centimetres.
WAYPOINT_BYTES, WAYPOINT_FLOATS = 6, 2


def rounded(arrival_s: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An arrival (...,) s and a place (..., 2) m as they are after a message."""
    return np.round(arrival_s / TICK_S) * TICK_S, np.round(place / GRAIN_M) * GRAIN_M


def counted(entries: np.ndarray, heard: np.ndarray, entry_bytes: int, entry_floats: int) -> PacketCount:
    """Messages of one slot: entries (trials,) in each, 0 where nobody spoke; heard (trials, receivers)."""
    sent, said = int((entries > 0).sum()), int(entries.sum())
    largest = HEADER_BYTES + entry_bytes * int(entries.max()) if sent else 0
    return PacketCount(sent, int(heard.sum()), HEADER_BYTES * sent + entry_bytes * said, entry_floats * said, largest)


def encode(sender: int, cycle: int, entries: Mapping[int, tuple[float, float, float]]) -> bytes:
    """A message: for every vehicle heard of, by number, its arrival s and place x, y m. 32 bytes for three (FSK0)."""
    parts = [struct.pack("BB", sender, cycle % 256)]
    for number, (arrival_s, x, y) in sorted(entries.items()):
        parts.append(struct.pack("B", number))
        parts += [_three_bytes(round(v / unit)) for v, unit in ((arrival_s, TICK_S), (x, GRAIN_M), (y, GRAIN_M))]
    return b"".join(parts)


def decode(message: bytes) -> tuple[int, int, dict[int, tuple[float, float, float]]]:
    """Sender, cycle modulo 256, and entries of a message; ValueError where it is none."""
    if len(message) < HEADER_BYTES or (len(message) - HEADER_BYTES) % ENTRY_BYTES:
        raise ValueError(f"a message has {HEADER_BYTES} bytes and {ENTRY_BYTES} for each entry, not {len(message)}")
    entries = {}
    for at in range(HEADER_BYTES, len(message), ENTRY_BYTES):
        numbers = [int.from_bytes(message[n : n + 3], "little", signed=True) for n in (at + 1, at + 4, at + 7)]
        entries[message[at]] = (numbers[0] * TICK_S, numbers[1] * GRAIN_M, numbers[2] * GRAIN_M)
    return message[0], message[1], entries


def _three_bytes(value: int) -> bytes:
    try:
        return value.to_bytes(3, "little", signed=True)
    except OverflowError:
        raise ValueError(f"{value} ticks do not fit in 24 bits: 8.4 s and 84 km are the most a message says") from None
