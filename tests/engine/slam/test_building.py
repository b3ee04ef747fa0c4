"""What an algorithm makes of a log: which measurements it takes, and how near a peak must be to be believed."""

from __future__ import annotations

import numpy as np

from engine.slam import range_only, sas_static
from engine.slam.building import growths
from engine.slam.factors.heard import Heard
from engine.slam.log import thinned
from engine.slam.mission import fly
from tests.engine.slam.missions import scenario


def test_fewer_measurements_are_spread_over_the_whole_mission():
    log = fly(scenario(), [0]).log(0)
    some = thinned(log, 3)
    assert [p.pose for p in some.pings] == [log.pings[k].pose for k in (0, 10, 19)]
    assert [a.poses for a in some.arrays] == [log.arrays[k].poses for k in (0, 2, 3)]
    assert thinned(log, None).pings == thinned(log, 50).pings == log.pings


def test_the_last_growth_reaches_the_last_pose():
    mission = fly(scenario(), [0])
    for plan in (range_only.PLAN, sas_static.PLAN):
        grown = list(growths(mission.log(0), plan, mission.time_s, 0.0))
        names = [v for g in grown for v in g.kinds]
        assert names == list(dict.fromkeys(names)) and {f"x{k}" for k in range(100)} < set(names)


def test_a_peak_must_be_as_near_as_odometry_since_the_last_ping_lets_it():
    """Dead reckoning since the last fix is off by more, but the ping before has told this one's distance."""
    mission = fly(scenario(ranging={"count": 100}, odometry={"drift_mps": 0.4}), [0])
    heard = [f for g in growths(mission.log(0), range_only.PLAN, mission.time_s, 0.0) for f in g.factors]
    slack = np.array([f.slack_m for f in heard if isinstance(f, Heard)])
    assert len(slack) == 100
    assert slack[0] < 0.2 and (slack[10:90] < 1.2).all()
    assert 0.4 * np.sqrt(90) > 3.0, "what dead reckoning would be off by"
