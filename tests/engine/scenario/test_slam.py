import pytest
from pydantic import ValidationError

from engine.scenario.slam import array_starts
from tests.engine.slam.missions import scenario


def test_arrays_reach_from_end_to_end():
    assert array_starts(scenario(arrays={"count": 3, "elements": 10}), 100) == [0, 45, 90]
    assert array_starts(scenario(arrays={"starts": [60, 5]}), 100) == [5, 60]
    assert array_starts(scenario(arrays={"count": 0}), 100) == []
    assert array_starts(scenario(arrays={"count": 1}), 100) == [0]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"water": None}, "water: is missing"),
        ({"duration_s": None}, "duration_s: is missing"),
        ({"duration_s": 1e5}, "makes 100001 poses"),
        ({"arrays": {"count": 13}}, "overlap"),
        ({"arrays": {"starts": [0, 5]}}, "overlap"),
        ({"arrays": {"starts": [95]}}, "does not end"),
        ({"fixes": {"count": 101}}, "more than the 100 poses"),
        ({"ranging": {"count": 101}}, "more than the 100 poses"),
        ({"sonar": {"high_hz": 100.0}}, "not above low_hz"),
        ({"sonar": {"sampling_hz": 3000.0}}, "half the sampling rate"),
        ({"sonar": {"chirp_samples": 9000}}, "longer than a record"),
        ({"beacon": {"name": "auv"}}, "is the vehicle's"),
        ({"water": {"snr": 10.0}}, "did you mean 'snr_db'"),
        ({"vehicles": [{"name": "a", "kind": "fixed", "initial": {"position_sigma_m": 1.0}}]}, "recorded missions"),
        (
            {"mission": {"kind": "recorded", "format": "csv", "log": "here"}},
            "is of simulated missions",
        ),
    ],
)
def test_faults_say_what_is_wrong(changes, words):
    with pytest.raises(ValidationError, match=words):
        scenario(**changes)
