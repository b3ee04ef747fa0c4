"""Packets: what is sent is what is read, and what is damaged is refused."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.navigation import packets
from engine.navigation.nekf import PACKET


def beliefs(seed: int, trials: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(trials, 2, 2)) * 10 ** rng.uniform(-2, 3, (trials, 1, 1))
    return rng.normal(size=(trials, 2)) * 1e4, root @ np.swapaxes(root, -1, -2) + 1e-4 * np.eye(2)


def encoded(seed: int, trials: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    mean, cov = beliefs(seed, trials)
    fields = packets.pack_position(mean, cov)
    return packets.encode(PACKET, trials, sender=3, sequence=77, depth=123, **fields), mean, cov


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_position_survives_its_packet_to_a_centimetre_and_never_gains_certainty(seed):
    data, mean, cov = encoded(seed, 6)
    packet = packets.decode(PACKET, data)
    assert packet.valid.all() and (packet.record["sender"] == 3).all() and (packet.record["sequence"] == 77).all()
    got_mean, got_cov, proper = packets.unpack_position(packet.record)
    assert proper.all()
    np.testing.assert_allclose(got_mean, mean, atol=0.0051)
    sigma, got_sigma = (np.sqrt(np.diagonal(c, axis1=-2, axis2=-1)) for c in (cov, got_cov))
    assert np.all(got_sigma >= sigma * (1 - 1e-12)) and np.all(got_sigma <= sigma * 1.001 + 1e-6)
    assert np.all(np.linalg.eigvalsh(got_cov) > 0)


@settings(deadline=None, max_examples=200)
@given(st.integers(0, 2**32 - 1), st.data())
def test_a_damaged_packet_is_refused(seed, data):
    """Any one to three flipped bits, and any truncation, are noticed."""
    good, _, _ = encoded(seed, 1)
    bits = data.draw(st.lists(st.integers(0, good.size * 8 - 1), min_size=1, max_size=3, unique=True))
    bad = good.copy()
    for bit in bits:
        bad[0, bit // 8] ^= 1 << (bit % 8)
    assert not packets.decode(PACKET, bad).valid.any()
    cut = data.draw(st.integers(0, good.shape[1] - 1))
    assert not packets.decode(PACKET, good[:, :cut]).valid.any()


def test_the_checksum_is_the_standard_one():
    """The check value of CRC-16/CCITT-FALSE in the catalogue of CRC algorithms is 29B1 for "123456789"."""
    row = np.frombuffer(b"123456789", np.uint8)[None]
    assert packets.crc16(row)[0] == 0x29B1


def test_silence_is_not_a_packet():
    """Blanked bytes, as the network hands out where nothing was heard, never check out."""
    assert not packets.decode(PACKET, np.zeros((4, PACKET.itemsize), np.uint8)).valid.any()


def test_values_beyond_a_field_saturate_instead_of_wrapping():
    assert packets.to_steps(np.array([1e9, -1e9, np.nan]), 0.1, "<i2").tolist() == [32767, -32768, 0]
