"""Local chains, their packets, and what can be put together again from them."""

from __future__ import annotations

import itertools
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.gaussian.forms import to_moments
from engine.gaussian.links import advance
from engine.smoothing import packets
from engine.smoothing.choice import current_information, k_best, received_probability
from engine.smoothing.composition import compose
from engine.smoothing.fidelity import closeness
from engine.smoothing.reconstruction import ReceivedChain, open_packet, target
from engine.smoothing.refactor import divergence
from engine.smoothing.sender import PlaneSender, choose_best, choose_last

sys.path.insert(0, str(Path(__file__).parent))
from chainlab import chain_of, launch_times, surfacing_mission


@cache
def sent(surfacing: bool, consistent: bool, best: bool, k: int = 2):
    """A chain, and every packet of it, opened."""
    mission = surfacing_mission() if surfacing else surfacing_mission(())
    chain = chain_of(mission, consistent=consistent)
    sender = PlaneSender(0, chain, mission.trials, k, choose_best(0.5) if best else choose_last)
    data = [sender.packet(n, np.full(mission.trials, 8.0)) for n in range(len(chain.links))]
    return chain, data, [open_packet(d, k) for d in data]


def rebuilt(opened, numbers, trial: int = 0) -> ReceivedChain:
    chain = ReceivedChain()
    for n in numbers:
        for number, link in opened[n].links(trial):
            chain.add(number, link)
    return chain


def test_a_packet_with_two_priors_is_one_64_byte_frame():
    _, data, opened = sent(True, False, False)
    assert {d.shape[1] for d in data} == {64}
    assert all(o.valid.all() for o in opened)
    np.testing.assert_allclose(opened[3].depth_m, 8.0)


def test_a_damaged_packet_is_not_taken_for_one():
    _, data, _ = sent(True, False, False)
    broken = data[5].copy()
    broken[1, 20] ^= 4
    np.testing.assert_array_equal(open_packet(broken, 2).valid, [True, False, True])
    assert not open_packet(broken[:, :-1], 2).valid.any()


@pytest.mark.parametrize("kept", [slice(None), slice(None, None, 3), slice(4, 9)])
def test_chains_without_priors_are_exact_up_to_quantization(kept):
    """Composition is marginalization: what was lost leaves no trace (W15 section IV-A)."""
    chain, _, opened = sent(False, False, True)
    assert all(link.prior_information is None for link in chain.links)
    numbers = list(range(len(chain.links)))[kept]
    wanted, got = target(chain.start, chain.windows, numbers, 0), rebuilt(opened, numbers).chain(numbers)
    assert divergence(wanted.matrix, got.matrix) < 1e-3
    apart = to_moments(wanted).mean - to_moments(got).mean
    assert np.abs(apart).max() < 0.011


def test_composed_odometry_is_the_marginal_of_the_chain():
    """Adding up the links of a vehicle without fixes gives what a filter over the same log believes at the end.

    Velocities dropped at the launches cost a little: no more than 2 % of the covariance, and never a gain.
    """
    mission = surfacing_mission(())
    chain = chain_of(mission)
    whole = chain.links[0].odometry
    for link in chain.links[1:]:
        whole = compose(whole, link.odometry)
    own = mission.chains[0]
    state = own.initial
    for step in own.steps[: int(np.searchsorted(own.times_s, launch_times(mission)[-1]))]:
        state = advance(state, slice(None), step.at(state.mean))
    assert np.abs(state.mean[:, :2] - whole.z).max() < 0.2
    gain = np.linalg.eigvals(np.linalg.solve(state.cov[:, :2, :2], whole.R)).real
    assert gain.min() > 1 - 1e-9 and gain.max() < 1.02


def test_with_every_packet_both_choices_give_the_full_approximate_chain():
    for consistent in (False, True):
        results = []
        for best in (False, True):
            chain, _, opened = sent(True, consistent, best)
            numbers = list(range(len(chain.links)))
            results.append(rebuilt(opened, numbers).chain(numbers))
        np.testing.assert_allclose(results[0].matrix, results[1].matrix)
        np.testing.assert_allclose(results[0].vector, results[1].vector)
        kld, apart = closeness(chain, numbers, results[0], 0)
        assert kld < 0.05 and apart < 0.02


@settings(max_examples=60)
@given(heard=st.lists(st.integers(0, 29), min_size=1, max_size=60), best=st.booleans(), trial=st.integers(0, 2))
def test_any_packets_in_any_order_give_a_chain_never_more_certain_than_the_target(heard, best, trial):
    """With the consistency constraint, whatever subset, order and repetition arrives (quantized as sent)."""
    chain, _, opened = sent(True, True, best)
    kept = sorted(set(heard))
    got = rebuilt(opened, heard, trial).chain(kept)
    wanted = target(chain.start, chain.windows, kept, trial)
    assert np.linalg.eigvalsh(got.matrix).min() > 0
    assert np.linalg.eigvalsh(wanted.matrix - got.matrix).min() > -1e-9 * np.linalg.eigvalsh(wanted.matrix).max()
    again = rebuilt(opened, [*heard, *heard[::-1]], trial).chain(kept)
    np.testing.assert_allclose(again.matrix, got.matrix)
    in_order = rebuilt(opened, kept, trial).chain(kept)
    np.testing.assert_allclose(in_order.matrix, got.matrix, rtol=1e-9)


def test_a_vehicle_without_odometry_sends_independent_priors():
    """A ship with GPS alone: no window holds odometry, every launch a prior of its own (W15 section IV-B)."""
    from loglab import make_mission

    mission = make_mission([(0, 1)], trials=3)
    chain = chain_of(mission)
    assert all(link.odometry is None for link in chain.links[1:])
    sender = PlaneSender(0, chain, 3, 2, choose_last)
    opened = [open_packet(sender.packet(n, np.zeros(3)), 2) for n in range(len(chain.links))]
    got = rebuilt(opened, [3, 5]).chain([3, 5])
    np.testing.assert_array_equal(got.matrix[:2, 2:], 0)
    sigma = np.linalg.det(np.linalg.inv(got.matrix[:2, :2])) ** 0.25
    assert 0.3 < sigma < 3.0


@given(seed=st.integers(0, 2**32 - 1))
def test_rounded_covariances_bound_the_true_ones(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(20, 2, 2)) * 10.0 ** rng.uniform(-2, 2, (20, 1, 1))
    cov = root @ root.transpose(0, 2, 1) + 1e-5 * np.eye(2)
    lattice = packets.onto_lattice(np.zeros((20, 2)), cov, np.zeros(20))
    assert np.linalg.eigvalsh(lattice.R() - cov).min() > -1e-9
    near = packets.onto_lattice(np.zeros((20, 2)), cov, np.zeros(20))
    values = packets.prior_values("p", np.zeros((20, 2)), cov, near)
    fields = [("p.dx", -17), ("p.dy", -17), ("p.sx", 9), ("p.sy", 9), ("p.rho", -8)]
    back, valid = packets.read_bits(fields, packets.write_bits(fields, 20, values))
    _, read = packets.read_prior("p", back, near)
    assert valid.all()
    assert (np.linalg.eigvalsh(read - cov)[:, 0] > -1e-6 * np.trace(cov, axis1=1, axis2=2)).all()


def test_current_information_is_the_schur_complement():
    """Pose by pose against the whole matrix of a chain of five priors."""
    rng = np.random.default_rng(4)
    n = 5
    priors = np.stack([np.diag(rng.uniform(0.1, 1, 2)) for _ in range(n)])
    R = np.stack([np.diag(rng.uniform(0.1, 1, 2)) for _ in range(n)])
    weight = rng.uniform(0, 1, n)
    anchor = 0.2 * np.eye(2)
    H = np.zeros((2 * n + 2,) * 2)
    H[:2, :2] += anchor
    for i in range(n):
        at = slice(2 * i, 2 * i + 2)
        H[at, at] += weight[i] * priors[i]
        both = slice(2 * i, 2 * i + 4)
        H[both, both] += np.kron([[1, -1], [-1, 1]], np.linalg.inv(R[i]))
    expected = np.linalg.inv(np.linalg.inv(H)[-2:, -2:])
    np.testing.assert_allclose(current_information(anchor, priors, weight, R), expected, rtol=1e-9)


def test_k_best_is_greedy_over_the_log_determinant():
    """Both picks are the best of all single picks, by trying them one by one (W15 section IV-C, eq. 17)."""
    rng = np.random.default_rng(6)
    n, loss = 6, 0.4
    priors = np.stack([np.diag(rng.uniform(0.01, 2, 2)) for _ in range(n)])[None]
    R = np.stack([np.diag(rng.uniform(0.1, 3, 2)) for _ in range(n)])[None]
    anchor = 0.01 * np.eye(2)[None]
    broadcasts = rng.integers(1, 4, (1, n))
    chosen = k_best(anchor, priors, broadcasts, R, 2, loss)[0]
    sent_so_far, picks = broadcasts[0].astype(float), []
    for _ in range(2):
        scores = {}
        for c in set(range(n)) - set(picks):
            m = sent_so_far + (np.arange(n) == c)
            p = received_probability(m, loss)
            scores[c] = np.linalg.slogdet(current_information(anchor[0], priors[0], p, R[0]))[1]
        picks.append(max(scores, key=scores.__getitem__))
        sent_so_far[picks[-1]] += 1
    assert list(chosen) == picks


def test_priors_known_better_later_supersede_what_was_told_before():
    """The prior of a launch gains from the window after it; an old packet that arrives late changes nothing."""
    _, _, opened = sent(True, False, False)
    for a, b in itertools.permutations(range(12), 2):
        first = rebuilt(opened, [a, b])
        second = rebuilt(opened, [b, a])
        assert first.links.keys() == second.links.keys()
        for n, link in first.links.items():
            assert link.told == second.links[n].told
