"""Requests drawn from the OpenAPI document, right ones and wrong ones: none makes the server fail or tell too much."""

from __future__ import annotations

import json
from collections import Counter
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from hypothesis.errors import Unsatisfiable
from requests import Session
from schemathesis import GenerationMode

from tests.server.living import SHORT, Live


def operations(live: Live) -> list[Any]:
    """What the document says can be asked."""
    schema = schemathesis.openapi.from_dict(live.http.get("/api/openapi.json").json())
    return [found.ok() for found in schema.get_all_operations()]


def ask_all(live: Live, examples: int, derandomize: bool = True) -> Counter[int]:
    """Ask every operation so many times each; how many answers of each status there were.

    Half of the ids asked for are those of a job that is there.
    """
    answers: Counter[int] = Counter()
    known = live.done(SHORT)["id"]

    def strategy(operation: Any) -> st.SearchStrategy[Any]:
        modes = [GenerationMode.POSITIVE, GenerationMode.NEGATIVE]
        asks = operation.path_parameters or operation.query or operation.headers or operation.body
        return st.one_of(*(operation.as_strategy(generation_mode=mode) for mode in (modes if asks else modes[:1])))

    with Session() as session:
        for operation in operations(live):

            @settings(
                max_examples=examples,
                deadline=None,
                database=None,
                derandomize=derandomize,
                phases=[Phase.generate],
                suppress_health_check=list(HealthCheck),
            )
            @given(strategy(operation), st.booleans())
            def ask(case: Any, existing: bool) -> None:
                nonlocal known
                if existing and "id" in (case.path_parameters or {}):
                    case.path_parameters["id"] = known
                answer = case.call(base_url=live.url, session=session, timeout=90)
                answers[answer.status_code] += 1
                check(case, answer)
                if case.method == "DELETE" and existing and answer.status_code == 204:
                    known = live.done(SHORT)["id"]

            try:
                ask()
            except Unsatisfiable:
                continue
    return answers


def check(case: Any, answer: Any) -> None:
    """Nothing the server could not cope with, nothing of its inside, and no NaN in JSON."""
    sent = f"{case.method} {case.formatted_path} {str(case.body)[:500]}"
    text = answer.content.decode("utf-8", "replace")
    assert answer.status_code < 500, f"{sent}: {answer.status_code} {text[:500]}"
    assert "Traceback" not in text, sent
    kind = answer.headers.get("content-type", "")
    if "json" in kind and text:
        told = json.loads(text, parse_constant=lambda word: pytest.fail(f"{sent}: {word} in JSON"))
        if answer.status_code >= 400:
            assert told["status"] == answer.status_code and told["title"], sent


def test_no_request_of_the_documents_kind_makes_the_server_fail(live: Live):
    answers = ask_all(live, examples=6)
    assert answers.total() > 100 and answers[200] and answers[422]
