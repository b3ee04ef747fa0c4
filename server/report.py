"""A result directory as one HTML page that needs nothing else."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from engine.evaluation import metrics
from engine.scenario import toml
from engine.scenario.errors import ScenarioError
from engine.tracks import Belief
from server import charts
from server.artifacts import ARRAYS, RESULT, VERSIONS
from server.inline import from_json
from server.table import figures

#: The page carries this with it wherever it is kept; a server says POLICY.
INSIDE = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
POLICY = f"{INSIDE}; frame-ancestors 'self'"
STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:68rem;margin:2rem auto;padding:0 1rem;color:#1c2430;background:#fff}
h1{margin-bottom:.2rem}h2{margin-top:2.2rem;border-bottom:1px solid #d5dae1}
table{border-collapse:collapse;margin:.6rem 0}td,th{padding:.2rem .8rem .2rem 0;text-align:right;white-space:nowrap}
td:first-child,th:first-child,td:nth-child(2),th:nth-child(2){text-align:left}
td.text{white-space:normal}tr{border-bottom:1px solid #e5e9ee}.yes{color:#00735a}.no{color:#b3420a;font-weight:600}
svg{max-width:100%;height:auto}.legend span{margin-right:1.2rem}.legend i{display:inline-block;width:1.4em;height:.3em;
margin-right:.4em;vertical-align:middle}pre{background:#f3f5f8;padding:1rem;overflow:auto;font-size:13px}
.pair{display:flex;flex-wrap:wrap;gap:1rem}.pair>div{flex:1 1 26rem;min-width:0}
"""


def of_directory(directory: Path) -> str:
    """The report of a result directory; FileNotFoundError where it has no result."""
    result = json.loads((directory / RESULT).read_text(encoding="utf-8"))
    versions_file = directory / VERSIONS
    versions = json.loads(versions_file.read_text(encoding="utf-8")) if versions_file.is_file() else {}
    with np.load(directory / ARRAYS, allow_pickle=False) as file:
        arrays = {key: file[key] for key in file.files}
    scenario = result["scenario"]
    title = escape(scenario.get("title", "Result"))
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f'<meta http-equiv="content-security-policy" content="{INSIDE}">'
        f'<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head><body>'
        f"<h1>{title}</h1><p>{escape(scenario.get('summary', ''))}</p><p>{escape(scenario.get('source', ''))}</p>"
        f"<p>{_plural(result['trials'], 'trial')}, seed {result['seed']}. {escape(_versions(versions))}</p>"
        f"<h2>Comparison</h2>{_comparison(result)}{_claims(result)}{_notes(result)}"
        f"<h2>Tracks of the first trial</h2>{_plan(result, arrays)}"
        f"<h2>Over time</h2>{_over_time(result, arrays)}"
        f"<h2>Scenario</h2><pre>{escape(_toml(scenario))}</pre></body></html>"
    )


def _versions(versions: dict[str, str]) -> str:
    return "Computed by " + ", ".join(f"{k} {v}" for k, v in versions.items()) + "." if versions else ""


def _comparison(result: dict[str, Any]) -> str:
    header, rows = figures(result)
    head = "".join(f"<th>{escape(h)}</th>" for h in header)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"


def _claims(result: dict[str, Any]) -> str:
    if not result["claims"]:
        return ""
    rows = []
    for claim in result["claims"]:
        holds = claim["holds"]
        verdict = (
            '<td class="yes">holds</td>' if holds else f'<td class="no">{"fails" if holds is False else "not run"}</td>'
        )
        found = f"{_value(claim['value'])} {claim['operator']} {_value(claim['bound'])}"
        rows.append(f'<tr><td class="text">{escape(claim["text"])}</td><td>{escape(found)}</td>{verdict}</tr>')
    return f"<h2>Claims of the source</h2><table>{''.join(rows)}</table>"


def _notes(result: dict[str, Any]) -> str:
    notes = [
        f"<li>{escape(name)}: {escape(note)}</li>" for name, a in result["algorithms"].items() for note in a["notes"]
    ]
    return f"<h2>Notes</h2><ul>{''.join(notes)}</ul>" if notes else ""


def _plan(result: dict[str, Any], arrays: dict[str, np.ndarray]) -> str:
    truth = [value[0] for key, value in arrays.items() if key.startswith("truth/")]
    tracks = {
        name: [arrays[f"{name}/{subject}/mean"][0] for subject in answer["subjects"]]
        for name, answer in result["algorithms"].items()
    }
    return charts.plan(truth, tracks)


def _over_time(result: dict[str, Any], arrays: dict[str, np.ndarray]) -> str:
    time_s, parts = arrays["time_s"], []
    subjects = dict.fromkeys(s for a in result["algorithms"].values() for s in a["subjects"])
    for subject in subjects:
        truth = arrays.get(f"truth/{subject}")
        found = {
            name: metrics.curves(truth, Belief(arrays[f"{name}/{subject}/mean"], arrays[f"{name}/{subject}/cov"]))
            for name, answer in result["algorithms"].items()
            if subject in answer["subjects"]
        }
        band = next(iter(found.values())).interval
        drawn = [
            charts.curves(f"{subject}: sigma", "m", time_s, {n: c.sigma_m for n, c in found.items()}),
        ]
        if truth is not None:
            nees = {n: np.where(np.isfinite(c.nees), c.nees, np.nan) for n, c in found.items()}
            error = {n: c.error_m for n, c in found.items()}
            drawn.insert(0, charts.curves(f"{subject}: error, RMS over trials", "m", time_s, error))
            drawn.append(charts.curves(f"{subject}: NEES, mean over trials", "1", time_s, nees, band, 6 * band[1]))
        parts.append(f"<h3>{escape(subject)}</h3><div class='pair'>{''.join(f'<div>{d}</div>' for d in drawn)}</div>")
    return "".join(parts)


def _toml(scenario: dict[str, Any]) -> str:
    try:
        return toml.dumps(from_json(scenario))
    except ScenarioError:
        return json.dumps(scenario, indent=1, ensure_ascii=False)


def _value(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else "none" if value is None else str(value).lower()


def _plural(count: int, word: str) -> str:
    return f"{count} {word}" if count == 1 else f"{count} {word}s"
