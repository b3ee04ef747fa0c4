"""Claims against a result written out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from engine.evaluation.claims import check

RESULT = {
    "algorithms": {
        "cekf": {
            "subjects": {
                "iver": {"sigma_m": 4.0, "consistent": True, "correlation": {"ship": {"final": 0.9}}},
                "ship": {"sigma_m": 1.0, "rmse_m": None},
            },
            "packets": {"bytes_per_packet": 0.0},
        },
        "nekf": {
            "subjects": {
                "iver": {
                    "sigma_m": 2.0,
                    "consistent": False,
                    "verdict": "overconfident",
                    "anees_interval": [1.6, 2.4],
                },
            },
            "packets": {"bytes_per_packet": 29.0},
        },
    }
}


def claim(metric: str, algorithm: str, subject: str | None, operator: str, bound: Any = None, than: Any = None):
    other = SimpleNamespace(**than) if than else None
    return SimpleNamespace(
        text="so it is said",
        metric=metric,
        algorithm=algorithm,
        subject=subject,
        operator=operator,
        bound=bound,
        than=other,
    )


@pytest.mark.parametrize(
    ("metric", "algorithm", "subject", "operator", "bound", "value", "holds"),
    [
        ("sigma_m", "nekf", "iver", "<", 2.5, 2.0, True),
        ("sigma_m", "nekf", "iver", "<", 2.0, 2.0, False),
        ("sigma_m", "nekf", "iver", "<=", 2, 2.0, True),
        ("sigma_m", "nekf", "iver", ">", 2.0, 2.0, False),
        ("sigma_m", "nekf", "iver", ">=", 2.0, 2.0, True),
        ("sigma_m", "nekf", "iver", "==", 2, 2.0, True),
        ("consistent", "nekf", "iver", "==", False, False, True),
        ("consistent", "cekf", "iver", "==", False, True, False),
        ("verdict", "nekf", "iver", "==", "overconfident", "overconfident", True),
        ("packets.bytes_per_packet", "nekf", None, "<", 32, 29.0, True),
        ("packets.bytes_per_packet", "nekf", "iver", "<", 20, 29.0, False),
        ("correlation.ship.final", "cekf", "iver", ">", 0.5, 0.9, True),
        ("anees_interval.1", "nekf", "iver", "<", 3, 2.4, True),
    ],
)
def test_a_metric_against_a_bound(metric, algorithm, subject, operator, bound, value, holds):
    [found] = check([claim(metric, algorithm, subject, operator, bound)], RESULT)
    assert found == {
        "text": "so it is said",
        "value": value,
        "operator": operator,
        "bound": bound,
        "holds": holds,
    }


@pytest.mark.parametrize(("factor", "holds"), [(1.0, True), (0.5, False), (0.51, True)])
def test_a_metric_against_another_times_a_factor(factor, holds):
    than = {"metric": "sigma_m", "algorithm": "cekf", "subject": "iver", "factor": factor}
    [found] = check([claim("sigma_m", "nekf", "iver", "<", than=than)], RESULT)
    assert (found["bound"], found["holds"]) == (4.0 * factor, holds)


@pytest.mark.parametrize(
    ("algorithm", "subject", "reason"),
    [("deif", "iver", "deif was not run"), ("nekf", "ship", "nekf did not locate ship")],
)
def test_a_claim_on_what_was_not_run_is_open(algorithm, subject, reason):
    [found] = check([claim("sigma_m", algorithm, subject, "<", 1)], RESULT)
    assert (found["value"], found["holds"], found["reason"]) == (None, None, reason)


def test_a_comparison_with_what_was_not_run_is_open_and_keeps_its_value():
    than = {"metric": "sigma_m", "algorithm": "deif", "subject": "iver", "factor": 1.0}
    [found] = check([claim("sigma_m", "nekf", "iver", "<", than=than)], RESULT)
    assert (found["value"], found["bound"], found["holds"]) == (2.0, None, None)


@pytest.mark.parametrize(
    ("metric", "subject", "operator", "bound", "reason"),
    [
        ("sgma_m", "iver", "<", 1, "no metric 'sgma_m'"),
        ("sigma_m.mean", "iver", "<", 1, "no metric 'sigma_m.mean'"),
        ("sigma_m", None, "<", 1, "no metric 'sigma_m'"),
        ("rmse_m", "ship", "<", 1, "has no value"),
        ("consistent", "iver", ">", 0, "cannot be compared"),
        ("consistent", "iver", "==", 1, "cannot be compared"),
        ("sigma_m", "iver", "<", "small", "cannot be compared"),
        ("correlation", "iver", "==", 1, "cannot be compared"),
    ],
)
def test_a_claim_on_a_figure_that_does_not_exist_fails_with_a_reason(metric, subject, operator, bound, reason):
    [found] = check([claim(metric, "cekf", subject, operator, bound)], RESULT)
    assert found["holds"] is False
    assert reason in found["reason"]


def test_claims_are_data_and_an_operator_outside_the_list_is_refused():
    with pytest.raises(ValueError, match="no operator"):
        check([claim("sigma_m", "cekf", "iver", "__class__", 1)], RESULT)
