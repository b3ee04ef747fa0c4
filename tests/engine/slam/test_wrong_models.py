"""A model that is wrong about the world: a visible doubt, finite answers, an end."""

from __future__ import annotations

import numpy as np
import pytest

from engine.registry import algorithm
from engine.slam.mission import fly
from engine.tracks import Tracks
from tests.engine.slam.missions import scenario

#: What the estimator is not told of: 22 m of delay, sound that is 4 % faster, an echo twice as loud as the direct path.
WRONG = {
    "clock offset": {"clock_offset_s": 0.015},
    "sound speed": {"sound_speed_mps": 1540.0},
    "outlier echo": {"outlier_m": 30.0, "outlier_gain": 2.0},
}


def solved(name: str, water: dict) -> Tracks:
    settled = {"snr_db": 15.0} | water
    mission = fly(scenario(water=settled, fixes={"count": 12}, ranging={"count": 30}), [0])
    return algorithm(name).run(mission, lambda *_: None)


def doubts(tracks: Tracks) -> list[str]:
    return [str(note) for note in tracks.notes if "do not fit" in str(note)]


def finite(tracks: Tracks) -> bool:
    beliefs = all(np.isfinite(b.mean).all() and np.isfinite(b.cov).all() for b in tracks.beliefs.values())
    return beliefs and all(np.isfinite(s.points).all() for s in tracks.samples.values())


@pytest.mark.parametrize("name", ["range_only", "sas_static", "sas_dynamic"])
def test_a_right_model_raises_no_doubt(name):
    tracks = solved(name, {})
    assert not doubts(tracks) and finite(tracks)


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("name", ["range_only", "sas_static", "sas_dynamic"])
def test_a_wrong_model_is_told_of_and_ends_in_numbers(name, wrong):
    tracks = solved(name, WRONG[wrong])
    assert finite(tracks)
    assert doubts(tracks), tracks.notes
