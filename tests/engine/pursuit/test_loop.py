"""The closed loop: who knows what when, and what follows from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.pursuit import centralized, decentralized
from engine.pursuit.messages import decode, encode, rounded
from engine.pursuit.mission import fly
from engine.pursuit.options import PursuitOptions
from engine.pursuit.tracker import Update
from engine.registry import silent
from engine.scenario import library, toml
from tests.engine.pursuit.pursuits import NAMES, mission, scenario

OPTIONS = PursuitOptions()


def kinds(diary) -> np.ndarray:
    """Kinds of update in the first cycle, (slots, holders), of trial 0."""
    return np.stack([s.kind[0] for s in diary.slots if s.cycle == 0])


def test_without_loss_updates_come_in_the_slots_of_figure_3_3():
    """Two arrivals after one message, three after two; the last to speak is the first to know all."""
    diary, _ = decentralized.fly(mission(), OPTIONS, True, silent)
    N, P, F = Update.NONE, Update.PARTIAL, Update.FULL
    np.testing.assert_array_equal(kinds(diary), [[N, N, N], [N, P, P], [P, N, F], [F, F, N]])
    assert [s.end_s for s in diary.slots[:5]] == [0.0, 12.0, 19.0, 26.0, 28.0]


def test_the_shore_decides_when_all_have_spoken_and_commands_in_the_fifth_slot():
    diary, _ = centralized.fly(mission(), OPTIONS, silent)
    np.testing.assert_array_equal(kinds(diary)[:, 0], [0, 0, 0, Update.FULL, 0])
    first = diary.slots[:6]
    assert [s.sender for s in first] == [-1, 0, 1, 2, 3, -1]
    assert first[4].end_s == 33.0 and first[5].end_s == 35.0


def test_with_no_loss_all_estimates_agree_at_the_end_of_every_cycle():
    """They hold the same arrivals then, whatever the order they came in."""
    _, tracks = decentralized.fly(mission(report_interval_s=28.0), OPTIONS, True, silent)
    means = [tracks.beliefs[f"target-{name}"].mean for name in NAMES]
    covs = [tracks.beliefs[f"target-{name}"].cov for name in NAMES]
    # At 28 k s a cycle has ended and the arrivals of the next ping are still to come; the first report is the start.
    for mean, cov in zip(means[1:], covs[1:]):
        np.testing.assert_allclose(mean, means[0], atol=1e-9)
        np.testing.assert_allclose(cov, covs[0], atol=1e-9)


def test_nobody_who_hears_nothing_learns_anything():
    """All pings lost: estimates are the start's, predicted; the vehicles stay at their waypoints."""
    deaf = mission(network={"ping_loss": 1.0})
    diary, tracks = decentralized.fly(deaf, OPTIONS, True, silent)
    assert not any(s.kind.any() for s in diary.slots)
    assert not any(s.spoke.any() for s in diary.slots if s.number)
    assert tracks.packets.sent == 0
    spread = np.linalg.det(tracks.beliefs["target-kestrel"].cov[0])
    assert (np.diff(spread) > 0).all()
    path = tracks.beliefs["kestrel"].mean
    np.testing.assert_allclose(path, np.broadcast_to(path[:, :1], path.shape), atol=1e-9)


def test_lost_messages_leave_partial_information_and_repeating_mends_some():
    """Kestrel's message holds what silvana's and nostromo's held: nostromo misses silvana's, and still knows all."""
    flight = mission(trials=1)
    heard = flight.chances.messages.copy()
    heard[:, 0, 2, 0] = False
    diary, _ = decentralized.fly(
        replace(flight, chances=replace(flight.chances, messages=heard)), OPTIONS, True, silent
    )
    np.testing.assert_array_equal(kinds(diary)[:, 0], [0, 0, 0, Update.FULL])
    heard[:, 0, 3, 0] = False
    heard[:, 0, 2, 0] = True
    diary, _ = decentralized.fly(
        replace(flight, chances=replace(flight.chances, messages=heard)), OPTIONS, True, silent
    )
    np.testing.assert_array_equal(kinds(diary)[:, 0], [0, 0, Update.PARTIAL, 0])


def test_the_closed_loop_stays_finite_at_any_loss():
    for loss in (0.0, 0.5, 0.95, 1.0):
        flight = mission(network={"loss": loss, "ping_loss": 0.5 * loss})
        for tracks in (
            decentralized.fly(flight, OPTIONS, True, silent)[1],
            centralized.fly(flight, OPTIONS, silent)[1],
        ):
            for belief in tracks.beliefs.values():
                assert np.isfinite(belief.mean).all()
                assert np.linalg.eigvalsh(belief.cov).min() > 0


@pytest.mark.parametrize("changes", [{"formation": {"kind": "custom", "offsets_m": [[-40, 0], [0, 0], [40, 0]]}}])
def test_a_fleet_on_a_line_through_the_target_stays_finite(changes):
    for rule in ("gauss_hermite", "unscented"):
        _, tracks = decentralized.fly(mission(**changes), PursuitOptions(points=rule), True, silent)
        for belief in tracks.beliefs.values():
            assert np.isfinite(belief.mean).all() and np.linalg.eigvalsh(belief.cov).min() > 0


def test_in_space_the_loop_holds_with_four_vehicles():
    flight = fly(toml.override(library.find("pursuit-in-space"), {"duration_s": 700.0}), range(4))
    options = PursuitOptions(range_sigma_m=1.0)
    for tracks in (
        decentralized.fly(flight, options, True, silent)[1],
        centralized.fly(flight, options, silent)[1],
    ):
        belief = tracks.beliefs["target-narcissus"]
        away = np.linalg.norm(belief.mean - flight.truth["target-narcissus"], axis=-1)
        assert np.isfinite(belief.mean).all() and np.linalg.eigvalsh(belief.cov).min() > 0
        assert np.median(away) < 30.0


def test_a_trial_is_the_same_in_any_block():
    every = fly(scenario(network={"loss": 0.2}), range(4))
    last = fly(scenario(network={"loss": 0.2}), [3])
    _, together = decentralized.fly(every, OPTIONS, True, silent)
    _, alone = decentralized.fly(last, OPTIONS, True, silent)
    for subject, belief in alone.beliefs.items():
        np.testing.assert_allclose(together.beliefs[subject].mean[3:], belief.mean, rtol=0, atol=1e-7)


def test_vehicles_keep_up_and_the_estimate_is_consistent():
    """Mean NEES of 40 pursuits near 2: what the filter believes of its error is right."""
    flight = mission(trials=40, duration_s=1400.0)
    _, tracks = decentralized.fly(flight, OPTIONS, True, silent)
    belief = tracks.beliefs["target-kestrel"]
    error = belief.mean - flight.truth["target-kestrel"]
    nees = np.einsum(
        "ti,ti->t", error.reshape(-1, 2), np.linalg.solve(belief.cov.reshape(-1, 2, 2), error.reshape(-1, 2, 1))[..., 0]
    )
    assert 1.5 < nees.mean() < 3.0
    assert tracks.series["formation_error_m/kestrel"].value[:, -20:].mean() < 45.0


def test_a_message_of_three_arrivals_is_the_32_bytes_of_an_fsk0_packet():
    entries = {0: (0.061234, 12.34, -90.0), 1: (-0.2, -77.9, 45.01), 2: (0.3, 77.94, 45.0)}
    message = encode(2, 300, entries)
    assert len(message) == 32
    sender, cycle, back = decode(message)
    assert (sender, cycle) == (2, 44)
    for number, (arrival, x, y) in entries.items():
        t, place = rounded(np.array(arrival), np.array([x, y]))
        np.testing.assert_allclose(back[number], [t, *place], atol=1e-12)


@settings(max_examples=50)
@given(st.binary(max_size=40))
def test_noise_is_no_message_or_decodes_to_something_finite(noise):
    try:
        _, _, entries = decode(noise)
    except ValueError:
        return
    assert np.isfinite([v for e in entries.values() for v in e]).all()


def test_what_does_not_fit_in_a_message_is_refused():
    with pytest.raises(ValueError, match="24 bits"):
        encode(0, 0, {0: (9.0, 0.0, 0.0)})
