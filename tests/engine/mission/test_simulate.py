"""What the simulated sensors and modems give, against statistics and geometry worked out here."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from engine.mission import fly
from engine.mission.log import Log
from engine.scenario import library, toml
from engine.scenario.navigation import NavigationScenario

BASE: dict[str, Any] = {
    "schema": 1,
    "title": "two vehicles",
    "family": "navigation",
    "duration_s": 600,
    "seed": 3,
    "trials": 40,
    "vehicles": [
        {
            "name": "auv",
            "kind": "auv",
            "depth_m": 30,
            "path": {"kind": "loiter", "center_m": [0, 0], "radius_m": 80, "speed_mps": 1.5},
            "initial": {"position_sigma_m": 2.0, "velocity_sigma_mps": 0.3, "heading_sigma_deg": 4.0},
            "sensors": {
                "dvl": {"rate_hz": 2, "along_sigma_mps": 0.05, "cross_sigma_mps": 0.1},
                "heading": {"rate_hz": 5, "sigma_deg": 2.0},
                "depth": {"rate_hz": 1, "sigma_m": 0.2},
                "gps": {"rate_hz": 1, "sigma_m": 3.0},
                "modem": {"range_sigma_m": 1.5},
            },
        },
        {
            "name": "ship",
            "kind": "surface",
            "path": {
                "kind": "lawnmower",
                "start_m": [300, 0],
                "line_length_m": 200,
                "spacing_m": 50,
                "lines": 3,
                "speed_mps": 2,
            },
            "initial": {"position_sigma_m": 3.0},
            "sensors": {"gps": {"rate_hz": 1, "sigma_m": 2.0}, "modem": {"range_sigma_m": 1.0}},
        },
    ],
    "network": {
        "tdma": {"cycle_s": 20, "slots": [{"vehicle": "ship", "at_s": 0}, {"vehicle": "auv", "at_s": 10}]},
    },
}


def scenario(**changes: Any) -> NavigationScenario:
    """The base scenario with keys changed; `a__b` stands for a.b."""
    base = toml.validate(BASE)
    found = toml.override(base, {key.replace("__", "."): value for key, value in changes.items()})
    assert isinstance(found, NavigationScenario)
    return found


def truth_at(s: NavigationScenario, name: str, time_s: np.ndarray) -> np.ndarray:
    """True horizontal positions at any times, by asking for reports there."""
    step = 0.125
    log = fly(toml.override(s, {"report_interval_s": step}), [0])
    positions = log.truth[name][0]
    return np.stack([np.interp(time_s, log.time_s, positions[:, i]) for i in range(2)], axis=-1)


def assert_sigma(samples: np.ndarray, sigma: float) -> None:
    """Samples of N(0, sigma): their sum of squares within its 99.99 % interval, and their mean within its own."""
    n = samples.size
    low, high = stats.chi2.ppf([5e-5, 1 - 5e-5], n)
    assert low < (samples**2).sum() / sigma**2 < high
    assert abs(samples.mean()) < 4 * sigma / np.sqrt(n)


def flown(**changes: Any) -> Log:
    return fly(scenario(**changes), range(40))


def test_the_sensors_noise_is_the_stated_one():
    log = flown()
    auv, ship = log.vehicles
    assert auv.velocity and auv.heading and auv.depth and ship.fixes
    np.testing.assert_allclose(auv.velocity.time_s[:3], [0, 0.5, 1.0])
    assert_sigma(auv.velocity.value[..., 0] - 1.5, 0.05)
    assert_sigma(auv.velocity.value[..., 1], 0.1)
    course = np.pi / 2 + 1.5 * auv.heading.time_s / 80
    assert_sigma(auv.heading.value - course, np.radians(2.0))
    assert_sigma(auv.depth.value - 30, 0.2)
    assert_sigma(ship.fixes.value - truth_at(scenario(), "ship", ship.fixes.time_s), 2.0)
    np.testing.assert_allclose(ship.fixes.cov, np.tile(np.eye(2) * 4.0, (601, 1, 1)))
    assert auv.fixes is None


def test_the_first_belief_is_drawn_around_the_truth():
    log = fly(scenario(), range(400))
    auv = log.vehicles[0].initial
    assert_sigma(auv.position_m - [80, 0], 2.0)
    assert_sigma(auv.velocity_mps - [0, 1.5], 0.3)
    assert_sigma(auv.heading_rad - np.pi / 2, np.radians(4.0))
    np.testing.assert_allclose(auv.position_cov, np.eye(2) * 4)


def test_a_block_of_trials_is_the_same_whatever_block_it_is_in():
    s = scenario(network__loss=0.3, network__sound_speed_sigma_mps=5.0)
    whole, part = fly(s, range(6)), fly(s, [3, 4])
    for a, b in zip(whole.vehicles, part.vehicles):
        np.testing.assert_array_equal(a.initial.position_m[3:5], b.initial.position_m)
        for name in ("velocity", "heading", "depth", "fixes"):
            if (sensor := getattr(a, name)) is not None:
                np.testing.assert_array_equal(sensor.value[3:5], getattr(b, name).value)
    np.testing.assert_array_equal(whole.acoustics.travel_time_s[3:5], part.acoustics.travel_time_s)


def test_no_sensor_changes_with_another():
    """Streams belong to a vehicle's sensor: take the DVL, the GPS and a third vehicle away or add them."""
    more = {**BASE, "vehicles": [*BASE["vehicles"], {**BASE["vehicles"][0], "name": "third"}]}
    a, b = flown(), fly(toml.validate(more), range(40))  # type: ignore[arg-type]
    c = flown(vehicles__auv__sensors__dvl={"rate_hz": 7, "along_sigma_mps": 1, "cross_sigma_mps": 1})
    for other in (b, c):
        np.testing.assert_array_equal(a.vehicles[0].heading.value, other.vehicles[0].heading.value)
        np.testing.assert_array_equal(a.vehicles[0].initial.position_m, other.vehicles[0].initial.position_m)
        np.testing.assert_array_equal(a.vehicles[1].fixes.value, other.vehicles[1].fixes.value)
    np.testing.assert_array_equal(a.acoustics.travel_time_s, c.acoustics.travel_time_s)


def test_two_vehicles_and_two_trials_share_no_noise():
    twins = {**BASE, "vehicles": [BASE["vehicles"][0], {**BASE["vehicles"][0], "name": "twin"}, BASE["vehicles"][1]]}
    log = fly(toml.validate(twins), [0, 1])  # type: ignore[arg-type]
    course = np.pi / 2 + 1.5 * log.vehicles[0].heading.time_s / 80
    noise = np.concatenate([log.vehicles[0].heading.value, log.vehicles[1].heading.value]) - course
    correlation = np.corrcoef(noise) - np.eye(4)
    assert np.abs(correlation).max() < 4 / np.sqrt(noise.shape[1])


def test_a_range_runs_from_the_launch_position_to_the_arrival_position():
    """The light-time equation: |receiver(TOA) - sender(TOL)| = c (TOA - TOL), in three dimensions."""
    s = scenario(vehicles__auv__sensors__modem__range_sigma_m=1e-9, vehicles__ship__sensors__modem__range_sigma_m=1e-9)
    log = fly(s, [0])
    a = log.acoustics
    tol = a.tol_s[a.broadcast]
    names = s.names
    assert len(tol) == 60
    for r in range(len(tol)):
        sender, receiver = names[a.sender[a.broadcast[r]]], names[a.receiver[r]]
        launch = np.append(truth_at(s, sender, tol[r : r + 1])[0], 30.0 if sender == "auv" else 0.0)
        arrival = np.append(truth_at(s, receiver, a.toa_s[r : r + 1])[0], 30.0 if receiver == "auv" else 0.0)
        distance = np.linalg.norm(arrival - launch)
        assert distance == pytest.approx(1500 * (a.toa_s[r] - tol[r]), abs=5e-3)
        assert distance == pytest.approx(1500 * a.travel_time_s[0, r], abs=5e-3)


def test_ranging_noise_is_the_receivers():
    log = flown()
    a = log.acoustics
    error = 1500 * (a.travel_time_s - (a.toa_s - a.tol_s[a.broadcast]))
    assert_sigma(error[:, a.receiver == 0], 1.5)
    assert_sigma(error[:, a.receiver == 1], 1.0)


def test_an_unknown_sound_speed_stretches_all_ranges_of_a_trial_alike():
    log = fly(
        scenario(network__sound_speed_sigma_mps=30.0, vehicles__auv__sensors__modem__range_sigma_m=1e-9), range(300)
    )
    a = log.acoustics
    mine = a.receiver == 0
    stretch = a.travel_time_s[:, mine] / (a.toa_s - a.tol_s[a.broadcast])[mine]
    assert np.ptp(stretch, axis=1).max() < 2e-4  # the receiver moves a little while the packet takes longer
    assert_sigma(1500 / stretch[:, 0] - 1500, 30.0)


@pytest.mark.parametrize(
    ("loss", "rate"), [(0.25, 0.25), ({"kind": "fixed", "rate": 0.6}, 0.6), (0.0, 0.0), (1.0, 1.0)]
)
def test_a_fixed_loss_loses_its_share(loss, rate):
    heard = np.isfinite(flown(network__loss=loss).acoustics.travel_time_s)
    low, high = stats.binom.interval(0.9999, heard.size, 1 - rate)
    assert low <= heard.sum() <= high


def test_a_range_dependent_loss_follows_its_curve():
    log = fly(
        scenario(network__loss={"kind": "range", "half_range_m": 300.0, "width_m": 60.0, "floor": 0.1}), range(300)
    )
    a = log.acoustics
    distance = 1500 * (a.toa_s - a.tol_s[a.broadcast])
    expected = 0.9 / (1 + np.exp((distance - 300) / 60))
    heard = np.isfinite(a.travel_time_s).sum(axis=0)
    assert stats.chi2.sf(((heard - 300 * expected) ** 2 / (300 * expected * (1 - expected))).sum(), len(heard)) > 1e-4
    assert np.ptp(expected) > 0.3


def test_loss_by_signal_to_noise_ratio_is_half_where_the_sonar_equation_says():
    """SL 180 less 20 log10 r less 10 dB/km less 110 dB of noise is 15 dB at r = 378.6 m (by hand)."""
    from engine.mission.channel import snr_db
    from engine.scenario.network import SnrLoss

    loss = SnrLoss(
        kind="snr", source_level_db=180, noise_level_db=110, spreading=20, absorption_db_per_km=10, half_snr_db=15
    )
    assert snr_db(loss, np.array([378.6]))[0] == pytest.approx(180 - 20 * np.log10(378.6) - 3.786 - 110)
    heard = {}
    for half in (0.0, 14.7, 100.0):
        model = {**loss.model_dump(), "half_snr_db": half}
        heard[half] = np.isfinite(flown(network__loss=model).acoustics.travel_time_s).mean()
    assert heard[0.0] > 0.99 and heard[100.0] == 0 and 0.2 < heard[14.7] < 0.9


def test_a_bursty_channel_has_its_share_of_bad_spells_of_the_stated_length():
    """Gilbert-Elliott: the share of bad time is mean_bad / (mean_good + mean_bad), and the memory is exponential."""
    model = {"kind": "bursty", "mean_good_s": 90.0, "mean_bad_s": 30.0}
    log = fly(scenario(network__loss=model, duration_s=6000.0), range(200))
    a = log.acoustics
    mine = a.receiver == 0
    lost = np.isnan(a.travel_time_s[:, mine]).astype(float)
    assert lost.mean() == pytest.approx(0.25, abs=0.01)
    c0 = lost - 0.25
    memory = (c0[:, 1:] * c0[:, :-1]).mean() / (0.25 * 0.75)
    assert memory == pytest.approx(np.exp(-20 * (1 / 90 + 1 / 30)), abs=0.03)


def test_a_recorded_loss_is_played_back():
    model = {"kind": "recorded", "links": [{"sender": "ship", "receiver": "auv", "heard": [True, False, False, True]}]}
    log = flown(network__loss=model)
    a = log.acoustics
    heard = np.isfinite(a.travel_time_s)
    to_auv = heard[:, a.receiver == 0]
    assert to_auv[:, [0, 3]].all() and to_auv.sum() == 2 * 40
    assert heard[:, a.receiver == 1].all()


def test_directed_links_decide_who_can_hear():
    a = flown(network__links=[["ship", "auv"]]).acoustics
    assert set(a.receiver) == {0} and len(a.tol_s) == 60
    assert len(flown(network__links=[]).acoustics.receiver) == 0


def test_a_surfaced_auv_gets_fixes_and_neither_sends_nor_hears():
    log = flown(vehicles__auv__surfacings=[{"start_s": 200, "end_s": 260}])
    auv, a = log.vehicles[0], log.acoustics
    assert auv.fixes is not None
    np.testing.assert_allclose(auv.fixes.time_s, np.arange(200, 261))
    assert_sigma(auv.fixes.value - truth_at(scenario(), "auv", auv.fixes.time_s), 3.0)
    sent = a.tol_s[a.sender == 0]
    assert not ((sent >= 200) & (sent <= 260)).any() and ((sent > 180) & (sent < 280)).sum() == 2
    heard = a.toa_s[a.receiver == 0]
    assert not ((heard >= 200) & (heard <= 260)).any()
    depth = auv.depth.value.mean(axis=0)
    assert abs(depth[230]) < 0.2 and depth[100] == pytest.approx(30, abs=0.2) and 0 < depth[190] < 10


def test_no_fix_arrives_in_an_outage():
    log = flown(vehicles__ship__sensors__gps={"rate_hz": 1, "sigma_m": 2, "outages": [{"start_s": 50, "end_s": 99.5}]})
    t, before = log.vehicles[1].fixes.time_s, flown().vehicles[1].fixes
    assert not ((t >= 50) & (t <= 99.5)).any() and len(t) == 601 - 50
    np.testing.assert_array_equal(log.vehicles[1].fixes.value, before.value[:, np.isin(before.time_s, t)])


def test_a_modem_does_not_hear_while_it_sends():
    slots = {"cycle_s": 20, "packet_s": 2.0, "slots": [{"vehicle": "ship", "at_s": 0}, {"vehicle": "auv", "at_s": 1.0}]}
    assert len(flown(network__tdma=slots).acoustics.receiver) == 0
    assert len(flown(network__tdma={**slots, "packet_s": 0.5}).acoustics.receiver) == 60


def test_outliers_are_as_many_as_stated_and_always_too_long():
    modem = {"range_sigma_m": 0.001, "outlier_rate": 0.2, "outlier_sigma_m": 50.0}
    log = flown(vehicles__auv__sensors__modem=modem)
    a = log.acoustics
    error = 1500 * (a.travel_time_s - (a.toa_s - a.tol_s[a.broadcast]))[:, a.receiver == 0]
    gross = np.abs(error) > 0.01
    low, high = stats.binom.interval(0.9999, error.size, 0.2)
    assert low <= gross.sum() <= high
    assert error[gross].min() > 0
    assert_sigma(error[gross] * np.random.default_rng(0).choice([-1, 1], gross.sum()), 50.0)


def test_reports_come_as_asked_for_and_else_about_720_times():
    np.testing.assert_allclose(fly(scenario(report_interval_s=7.0), [0]).time_s, np.arange(0, 600, 7.0))
    time_s = fly(scenario(), [0]).time_s
    assert len(time_s) == 721 and time_s[0] == 0 and time_s[-1] == 600


def test_the_channels_history_is_in_order():
    log = fly(library.find("walls2011-topology-c"), [0, 1])  # type: ignore[arg-type]
    a = log.acoustics
    assert (np.diff(a.tol_s) >= 0).all() and (np.diff(a.toa_s) >= 0).all()
    assert (a.toa_s > a.tol_s[a.broadcast]).all()
    assert (a.receiver != a.sender[a.broadcast]).all()
