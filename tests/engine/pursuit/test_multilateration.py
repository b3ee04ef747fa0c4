"""Sources of single pings by least squares, and the estimators that only listen."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares

from engine.pursuit.formation import inner
from engine.pursuit.listening import run_filter, run_multilateration
from engine.pursuit.mission import fly
from engine.pursuit.multilateration import locate
from engine.registry import silent
from engine.scenario import library, toml
from engine.scenario.errors import ScenarioError
from tests.engine.pursuit.pursuits import NAMES, mission, scenario

SIGMA = 0.2
CORNERS = np.array([[-100.0, -80.0], [110.0, -90.0], [90.0, 120.0], [-95.0, 70.0], [10.0, -10.0]])


@given(st.floats(-70, 70), st.floats(-60, 60), st.floats(-1e3, 1e3))
def test_exact_arrivals_give_the_exact_source_whatever_the_time_of_the_ping(x, y, clock_m):
    source = np.array([x, y])
    arrivals = clock_m + np.linalg.norm(CORNERS - source, axis=-1)
    found = locate(arrivals, np.ones(5, bool), CORNERS, SIGMA, np.zeros(2))
    np.testing.assert_allclose(found.mean, source, atol=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_it_agrees_with_scipys_least_squares(seed):
    """Five arrivals with noise: the same minimum over position and time of the ping."""
    rng = np.random.default_rng(seed)
    source = rng.uniform(-60, 60, 2)
    arrivals = 30.0 + np.linalg.norm(CORNERS - source, axis=-1) + SIGMA * rng.standard_normal(5)
    found = locate(arrivals, np.ones(5, bool), CORNERS, SIGMA, np.zeros(2))

    def residual(unknown):
        return (unknown[2] + np.linalg.norm(CORNERS - unknown[:2], axis=-1) - arrivals) / SIGMA

    best = least_squares(residual, [0.0, 0.0, 0.0], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    np.testing.assert_allclose(found.mean, best.x[:2], atol=1e-5)
    np.testing.assert_allclose(found.cov, np.linalg.inv(best.jac.T @ best.jac)[:2, :2], rtol=1e-4)


@pytest.mark.parametrize(
    ("places", "heard"),
    [
        (CORNERS[:3], [True, True, False]),
        (np.tile(CORNERS[0], (3, 1)), [True, True, True]),
        (np.array([[-50.0, 0.0], [0.0, 0.0], [50.0, 0.0]]), [False, False, False]),
    ],
    ids=["two arrivals", "one place", "nothing"],
)
def test_what_does_not_tell_gives_no_position(places, heard):
    arrivals = np.linalg.norm(places - np.array([3.0, 4.0]), axis=-1)
    found = locate(arrivals, np.array(heard), places, SIGMA, np.zeros(2))
    assert np.isnan(found.mean).all() and np.isnan(found.cov).all()


def at_rest(**changes):
    vehicles = [{"name": n, "max_speed_mps": 0, "start_m": list(p)} for n, p in zip(NAMES, inner(150.0).tolist())]
    return mission(trials=20, vehicles=vehicles, target={"speed_mps": 0.1, "heading_deg": 0.0}, **changes)


def test_a_fleet_at_rest_finds_the_target_at_every_ping():
    """At the pings the error of both is of the size that the geometry makes of 0.2 m."""
    flight = at_rest(report_interval_s=28.0, algorithms=["multilateration"])
    for run in (run_multilateration, run_filter):
        belief = run(flight, silent).beliefs["target-kestrel"]
        away = np.linalg.norm(belief.mean - flight.truth["target-kestrel"], axis=-1)
        assert np.median(away[:, 1:-1]) < 2.5 + SIGMA  # the filter's report is of just before the ping: 2.8 m on
        assert np.isfinite(belief.mean).all() and np.linalg.eigvalsh(belief.cov).min() > 0


def test_where_no_ping_tells_the_last_position_stands_and_a_note_says_so():
    flight = at_rest(network={"ping_loss": 1.0}, algorithms=["multilateration"])
    tracks = run_multilateration(flight, silent)
    start = np.broadcast_to(flight.first.mean[:, None, :2], tracks.beliefs["target-kestrel"].mean.shape)
    np.testing.assert_array_equal(tracks.beliefs["target-kestrel"].mean, start)
    assert "gave no position" in str(tracks.notes[0])


def test_an_unknown_receiver_is_refused_by_name():
    flight = mission(options={"tdoa_filter": {"receivers": ["kestrel", "ghost"]}})
    with pytest.raises(ScenarioError, match=r"receivers\[1\].*ghost"):
        run_filter(flight, silent)


@pytest.mark.recorded
def test_recorded_pings_are_within_a_metre_of_the_reference_track(recorded_data):
    """Median over the pings that the reference rests on three or more hydrophones for."""
    recorded_data("yaps")
    flight = fly(library.find("yaps-hydrophones"), [0])
    tracks = run_multilateration(flight, silent)
    away = np.linalg.norm(tracks.beliefs["target"].mean - flight.truth["target"], axis=-1)
    assert np.isfinite(away).sum() > 100
    assert np.nanmedian(away) < 1.0


@pytest.mark.recorded
def test_three_hydrophones_keep_track_of_the_boat_and_show_their_innovations(recorded_data):
    recorded_data("yaps")
    flight = fly(library.find("yaps-hydrophones"), [0])
    tracks = run_filter(flight, silent)
    away = np.linalg.norm(tracks.beliefs["target"].mean - flight.truth["target"], axis=-1)
    assert np.nanmedian(away) < 5.0
    heard = tracks.innovations["target"].value
    assert np.isfinite(heard).sum() > 150
    assert 0.5 < np.nanmean(heard**2) < 3.0


@pytest.mark.recorded
def test_a_recording_that_does_not_fit_is_refused_with_its_key(recorded_data):
    recorded_data("yaps")
    wrong = toml.override(library.find("yaps-hydrophones"), {"mission.receivers": "ssu1_yaps_track.csv"})
    with pytest.raises(ScenarioError, match=r"mission\.receivers"):
        fly(wrong, [0])


def test_a_scenario_in_space_needs_a_vehicle_more():
    with pytest.raises(ScenarioError, match="vehicles"):
        scenario(dimensions=3, vehicles=[{"name": n} for n in NAMES[:2]])
