"""What must hold of the navigation estimators, on small logs made by hand."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

from engine.evaluation.consistency import judge, nees
from engine.gaussian.forms import Moments
from engine.navigation import mdeif, network
from engine.navigation.cekf import CekfFleet
from engine.navigation.deif import DeifNode, Options
from engine.navigation.mdeif import MdeifNode
from engine.navigation.mission import Arrival, NavigationMission, prepare
from engine.navigation.network import run_fleet, run_nodes
from engine.registry import algorithms, silent
from engine.tracks import Tracks

sys.path.insert(0, str(Path(__file__).parent))
from loglab import make_log, make_mission

BOTH = [(0, 1), (1, 0)]
EVERYONE = [(a, b) for a in range(3) for b in range(3) if a != b]
ALL = ["dead_reckoning", "cekf", "nekf", "interleaved_update", "deif", "mdeif"]


def run(mission: NavigationMission, name: str) -> Tracks:
    return algorithms()[name].run(mission, silent)


def sigma(tracks: Tracks, subject: str) -> np.ndarray:
    return (np.linalg.det(tracks.beliefs[subject].cov) ** 0.25).mean(axis=0)


def verdict(mission: NavigationMission, tracks: Tracks, subject: str) -> str:
    return judge(nees(mission.truth[subject], tracks.beliefs[subject])).name


def after_each_packet(
    monkeypatch: pytest.MonkeyPatch, mission: NavigationMission, vehicle: int, run_it
) -> list[Moments]:
    """A vehicle's own belief right after each arrival at it, whoever drives the estimator."""
    seen: list[Moments] = []
    drive = network._Recorder.drive

    def watching(self, advance, launch, receive, belief, curves):
        def receive_and_note(event: Arrival):
            innovation = receive(event)
            if event.vehicle == vehicle:
                seen.append(belief(vehicle))
            return innovation

        drive(self, advance, launch, receive_and_note, belief, curves)

    with monkeypatch.context() as patch:
        patch.setattr(network._Recorder, "drive", watching)
        run_it(mission)
    return seen


def exact_deif(mission: NavigationMission) -> Tracks:
    return run_nodes(mission, silent, lambda m: DeifNode(m, Options(quantization="float64")))


def test_deif_with_full_states_equals_the_centralized_filter_at_every_packet(monkeypatch):
    """One server, one silent client, no loss: 1e-6 m and 1e-6 relative covariance over 20 seeds (W11 section III-C)."""
    mission = make_mission([(0, 1)], trials=20, seed=3, fixed_by_gps=())
    ours = after_each_packet(monkeypatch, mission, 1, exact_deif)
    benchmark = after_each_packet(monkeypatch, mission, 1, lambda m: run_fleet(m, silent, CekfFleet))
    assert len(ours) == 20
    for a, b in zip(ours, benchmark):
        np.testing.assert_allclose(a.mean, b.mean, atol=1e-6)
        np.testing.assert_allclose(a.cov, b.cov, rtol=1e-6, atol=1e-9)


def test_two_clients_of_one_server_differ_from_the_centralized_filter_by_what_the_other_learns(monkeypatch):
    """Topology D: leaves become correlated through the server; where the other leaf hears nothing, all is exact."""

    def apart(links) -> float:
        mission = make_mission(links, vehicles=3, trials=5, seed=3, duration_s=900.0)
        ours = after_each_packet(monkeypatch, mission, 1, exact_deif)
        benchmark = after_each_packet(monkeypatch, mission, 1, lambda m: run_fleet(m, silent, CekfFleet))
        return max(np.abs(a.mean - b.mean).max() for a, b in zip(ours, benchmark))

    assert apart([(0, 1)]) < 1e-6
    assert 1e-3 < apart([(0, 1), (0, 2)]) < 1.0  # of the metre or two that either knows


def test_deif_with_positions_only_sends_fourteen_floats_and_stays_close(monkeypatch):
    """W11's packet: smaller, and close to exact where velocity carries little from one launch to the next."""
    mission = make_mission([(0, 1)], trials=10, options={"deif": {"delayed_state": "xy"}})
    full = run(make_mission([(0, 1)], trials=10), "deif")
    small = run(mission, "deif")
    assert small.packets.floats_sent / small.packets.sent == 1 + 14
    assert small.packets.bytes_sent < 0.5 * full.packets.bytes_sent
    difference = np.abs(small.beliefs["v1"].mean - full.beliefs["v1"].mean).max()
    assert 0 < difference < 0.5


def test_rounding_to_single_precision_moves_the_deif_by_millimetres():
    exact = exact_deif(make_mission([(0, 1)], trials=10))
    rounded = run(make_mission([(0, 1)], trials=10), "deif")
    assert np.abs(exact.beliefs["v1"].mean - rounded.beliefs["v1"].mean).max() < 0.02


def test_a_deif_client_notices_a_lost_packet_and_dead_reckons_from_then_on():
    mission = make_mission([(0, 1)], trials=6, loss=0.3, seed=2)
    tracks = run(mission, "deif")
    assert any("lost a packet of v0" in str(note) for note in tracks.notes)
    accepted = tracks.innovations["v1"].accepted
    heard = np.isfinite(mission.log.acoustics.travel_time_s)
    for trial in range(6):
        lost = np.flatnonzero(~heard[trial])
        first = int(lost[0]) if lost.size else heard.shape[1]
        assert accepted[trial, :first].all() and not accepted[trial, first:].any()


def test_repeating_the_last_deltas_bridges_gaps_at_the_price_of_bandwidth():
    lossy = {"trials": 8, "loss": 0.3, "seed": 4}
    once = run(make_mission([(0, 1)], **lossy), "deif")
    thrice = run(make_mission([(0, 1)], options={"deif": {"redundancy": 4}}, **lossy), "deif")
    assert thrice.innovations["v1"].accepted.sum() > 2 * once.innovations["v1"].accepted.sum()
    assert thrice.packets.bytes_sent > 3.5 * once.packets.bytes_sent


def test_deltas_bridged_by_redundancy_are_as_if_the_lost_launches_were_marginalized(monkeypatch):
    """With every gap bridged the DEIF equals a centralized filter that never had the lost ranges."""
    mission = make_mission([(0, 1)], trials=8, loss=0.3, seed=4, fixed_by_gps=())
    options = Options(redundancy=8, quantization="float64")
    ours = after_each_packet(
        monkeypatch, mission, 1, lambda m: run_nodes(m, silent, lambda member: DeifNode(member, options))
    )
    benchmark = after_each_packet(monkeypatch, mission, 1, lambda m: run_fleet(m, silent, CekfFleet))
    heard = np.isfinite(mission.log.acoustics.travel_time_s)
    for n, (a, b) in enumerate(zip(ours, benchmark)):
        np.testing.assert_allclose(a.mean[heard[:, n]], b.mean[heard[:, n]], atol=1e-6)


@pytest.mark.parametrize("delayed_state", ["xy", "full"])
def test_mdeif_equals_deif_without_loss(delayed_state):
    """To 1e-6 m with the origin shifting by acknowledgements (W12 section 4.4)."""
    options = {
        "deif": {"delayed_state": delayed_state, "quantization": "float64"},
        "mdeif": {"delayed_state": delayed_state},
    }
    mission = make_mission(BOTH, trials=20, seed=5, options=options)
    exact, ours = run(mission, "deif"), run(mission, "mdeif")
    for subject in mission.truth:
        assert np.abs(exact.beliefs[subject].mean - ours.beliefs[subject].mean).max() < 1e-6
    assert not any("skipped" in str(note) for note in ours.notes)


def mdeif_under_loss(monkeypatch, delayed_state: str, loss, seed: int):
    """Vehicle 1's beliefs after each of vehicle 0's packets by MDEIF, and a mission with the same ranges down only."""
    both = make_mission(BOTH, trials=8, loss=loss, seed=seed, fixed_by_gps=())
    options = mdeif.Options(delayed_state=delayed_state)
    nodes: list[MdeifNode] = []

    def make(member):
        nodes.append(MdeifNode(member, options))
        return nodes[-1]

    down = both.log.acoustics.receiver == 1
    ours = after_each_packet(monkeypatch, both, 1, lambda m: run_nodes(m, silent, make))
    one_way = make_log([(0, 1)], trials=8, seed=seed, fixed_by_gps=())
    acoustics = dataclasses.replace(one_way.acoustics, travel_time_s=both.log.acoustics.travel_time_s[:, down])
    log = dataclasses.replace(one_way, vehicles=both.log.vehicles, acoustics=acoustics)
    whole = nodes[1].skipped[0] == 0
    return ours, prepare(log), np.isfinite(acoustics.travel_time_s) & whole[:, None]


def test_a_lost_mdeif_packet_leaves_the_graph_as_if_that_launch_had_been_marginalized(monkeypatch):
    """At every packet heard the client equals the centralized filter that never had the lost ranges: 1e-5 m."""
    ours, mission, use = mdeif_under_loss(monkeypatch, "full", {0: 0.25, 1: 0.0}, seed=6)
    benchmark = after_each_packet(monkeypatch, mission, 1, lambda m: run_fleet(m, silent, CekfFleet))
    assert use.sum() > 100
    for n, (a, b) in enumerate(zip(ours, benchmark)):
        np.testing.assert_allclose(a.mean[use[:, n]], b.mean[use[:, n]], atol=1e-5)


def test_with_acknowledgements_lost_too_the_origin_method_recovers_the_steps(monkeypatch):
    """Positions only, a quarter lost in both directions: equal to a DEIF that bridges every gap, to 1e-5 m."""
    ours, mission, use = mdeif_under_loss(monkeypatch, "xy", 0.25, seed=6)
    options = Options(delayed_state="xy", redundancy=8, quantization="float64")
    bridged = after_each_packet(
        monkeypatch, mission, 1, lambda m: run_nodes(m, silent, lambda member: DeifNode(member, options))
    )
    assert use.sum() > 100
    for n, (a, b) in enumerate(zip(ours, bridged)):
        np.testing.assert_allclose(a.mean[use[:, n]], b.mean[use[:, n]], atol=1e-5)


def test_mdeif_recovers_after_a_silence_in_which_its_origin_died():
    """W12 Fig. 5: after a stretch without communication the estimates come back to the DEIF's accuracy."""
    mission = make_mission(BOTH, trials=20, seed=7, duration_s=1200.0, silent_s=(300.0, 700.0))
    tracks, benchmark = run(mission, "mdeif"), run(mission, "cekf")
    late = mission.time_s > 900
    assert sigma(tracks, "v1")[late].mean() < 1.5 * sigma(benchmark, "v1")[late].mean()
    assert verdict(mission, tracks, "v1") != "overconfident"


def test_correlation_with_an_origin_that_nobody_moves_dies_and_the_server_says_so():
    mission = make_mission([(0, 1)], trials=3)
    tracks = run(mission, "mdeif")
    assert any("nobody acknowledges" in str(note) for note in tracks.notes)
    assert tracks.series["origin_correlation/v0"].value[:, -1].max() < 0.1
    assert verdict(mission, tracks, "v1") != "overconfident"


def test_naive_fusion_is_overconfident_where_two_vehicles_only_have_each_other():
    """W11 Fig. 3a: below the benchmark's sigma, and wrong about it."""
    mission = make_mission(BOTH, trials=40, fixed_by_gps=(), duration_s=900.0)
    naive, benchmark = run(mission, "nekf"), run(mission, "cekf")
    assert sigma(naive, "v1")[-1] < 0.7 * sigma(benchmark, "v1")[-1]
    assert verdict(mission, naive, "v1") == "overconfident"
    assert verdict(mission, benchmark, "v1") != "overconfident"


@pytest.mark.parametrize(("links", "gps"), [(BOTH, ()), ([(0, 1)], (0,)), (EVERYONE, (0,)), (EVERYONE, ())])
def test_the_interleaved_update_is_consistent_better_than_dead_reckoning_and_conservative(links, gps):
    vehicles = 1 + max(max(pair) for pair in links)
    mission = make_mission(links, vehicles=vehicles, trials=40, fixed_by_gps=gps, seed=9)
    ours, alone, benchmark = (run(mission, name) for name in ("interleaved_update", "dead_reckoning", "cekf"))
    for subject in mission.truth:
        assert verdict(mission, ours, subject) != "overconfident"
        assert np.all(sigma(ours, subject) <= sigma(alone, subject) * 1.001)
        assert np.all(sigma(ours, subject) >= sigma(benchmark, subject) * 0.999)
    heard = links[0][1]
    assert sigma(ours, f"v{heard}")[-1] < 0.95 * sigma(alone, f"v{heard}")[-1]


def test_interleaved_filters_that_could_be_correlated_never_meet():
    """Two vehicles: the second filter only ever meets filters of own sensors, so twice heard is not twice believed."""
    mission = make_mission(BOTH, trials=1, fixed_by_gps=(), period_s=2.0, duration_s=60.0)
    ours, benchmark = run(mission, "interleaved_update"), run(mission, "cekf")
    assert sigma(ours, "v1")[-1] > sigma(benchmark, "v1")[-1]


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("loss", [0.0, 0.5, 1.0])
def test_every_estimator_stays_finite_and_positive_definite_under_any_loss(name, loss):
    mission = make_mission(EVERYONE, vehicles=3, trials=5, loss=loss, seed=11)
    tracks = run(mission, name)
    for belief in tracks.beliefs.values():
        assert np.isfinite(belief.mean).all()
        assert np.linalg.eigvalsh(belief.cov).min() > 0


@pytest.mark.parametrize("name", ALL)
def test_a_block_of_trials_is_the_trials_one_by_one(name):
    mission = make_mission(EVERYONE, vehicles=3, trials=3, loss=0.3, seed=12)
    together = run(mission, name)

    def only(array, t):
        return array[t : t + 1]

    log = mission.log
    t = 1
    vehicles = tuple(
        dataclasses.replace(
            v,
            initial=dataclasses.replace(
                v.initial,
                position_m=only(v.initial.position_m, t),
                velocity_mps=v.initial.velocity_mps
                if v.initial.velocity_mps.ndim == 1
                else only(v.initial.velocity_mps, t),
                heading_rad=only(v.initial.heading_rad, t),
            ),
            velocity=v.velocity and dataclasses.replace(v.velocity, value=only(v.velocity.value, t)),
            heading=v.heading and dataclasses.replace(v.heading, value=only(v.heading.value, t)),
            fixes=v.fixes and dataclasses.replace(v.fixes, value=only(v.fixes.value, t)),
        )
        for v in log.vehicles
    )
    single = dataclasses.replace(
        log,
        trials=1,
        vehicles=vehicles,
        acoustics=dataclasses.replace(log.acoustics, travel_time_s=only(log.acoustics.travel_time_s, t)),
    )
    alone = run(prepare(single), name)
    for subject, belief in alone.beliefs.items():
        np.testing.assert_allclose(belief.mean[0], together.beliefs[subject].mean[t], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["nekf", "interleaved_update", "deif", "mdeif"])
def test_garbage_on_the_channel_is_refused_and_harms_nobody(name, monkeypatch):
    """Ten thousand random, truncated, repeated and bit-flipped packets: estimates stay finite and positive definite."""
    rng = np.random.default_rng(0)
    mission = make_mission(EVERYONE, vehicles=3, trials=18, seed=13, period_s=2.0)
    assert mission.log.acoustics.travel_time_s.size > 10_000
    made: list = []
    original = network.run_nodes

    class Vandal:
        def __init__(self, node):
            self.node, self.before = node, None

        def __getattr__(self, what):
            return getattr(self.node, what)

        def receive(self, arrival, data):
            mode = rng.integers(5)
            bad = data.copy()
            if mode == 0:
                bad = rng.integers(0, 256, data.shape, dtype=np.uint8)
            elif mode == 1:
                bad = data[:, : rng.integers(0, data.shape[1])]
            elif mode == 2:
                bad[:, rng.integers(data.shape[1])] ^= np.uint8(1 << rng.integers(8))
            elif mode == 3 and self.before is not None and self.before.shape == data.shape:
                bad = self.before
            self.before = data
            return self.node.receive(arrival, bad)

    def vandalized(mission, progress, make, monitor=None):
        def wrap(member):
            made.append(Vandal(make(member)))
            return made[-1]

        return original(mission, progress, wrap)

    for module in ("nekf", "interleaved_update", "deif", "mdeif"):
        monkeypatch.setattr(f"engine.navigation.{module}.run_nodes", vandalized)
    tracks = run(mission, name)
    assert len(made) == 3
    for belief in tracks.beliefs.values():
        assert np.isfinite(belief.mean).all()
        assert np.linalg.eigvalsh(belief.cov).min() > 0


def test_what_a_node_sees_of_an_unheard_packet_is_blank(monkeypatch):
    """Information discipline: no byte of a lost packet reaches a node."""
    mission = make_mission([(0, 1)], trials=6, loss=0.5, seed=1)
    seen = []

    class Peeking:
        def __init__(self, member):
            from engine.navigation.nekf import NekfNode

            self.node = NekfNode(member)

        def __getattr__(self, what):
            return getattr(self.node, what)

        def receive(self, arrival, data):
            seen.append((np.isfinite(arrival.slant_m), data.any(axis=1)))
            return self.node.receive(arrival, data)

    run_nodes(mission, silent, Peeking)
    for heard, anything in seen:
        np.testing.assert_array_equal(heard, anything)
