"""Table I of W11, by measurement: what each estimator is good for, every cell from runs.

The runs are W11's five topologies without loss, and the fully connected one with loss; every cell keeps the figure
it was decided by. The paper's own ticks are printed beside for whom the paper had an opinion.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

TOPOLOGIES = tuple(f"walls2011-topology-{letter}" for letter in "abcde")
#: The topology that is run with loss as well, and how much.
LOSSY, LOSS = "walls2011-topology-c", 0.3
#: Where the ship is heard directly; the star and the cascade; who hears nobody.
DIRECT = ("walls2011-topology-c", "walls2011-topology-d")
STAR, CASCADE = "walls2011-topology-d", "walls2011-topology-e"
DEAF = (("walls2011-topology-b", "iver28"),)
#: The vehicles the table is about: those without a fix of their own.
VEHICLES = ("iver28", "iver31")
ALGORITHMS = ("dead_reckoning", "cekf", "nekf", "interleaved_update", "deif", "mdeif")

#: Uncertainty is bounded where it grows, late in the mission, by less than this part of dead reckoning's growth.
BOUNDED = 0.5
#: Hearing others must lower sigma below dead reckoning's by at least this part to count as working.
GAIN = 0.05
#: With packets lost, this part of what ranging gained over dead reckoning must remain.
KEPT = 0.5

COLUMNS = ("consistent", "bounds_error", "arbitrary_topology", "robust_to_loss")
#: W11 Table I. Dead reckoning is not in it; the origin state method is of 2012.
PAPER = {
    "cekf": (True, True, True, True),
    "nekf": (False, True, True, True),
    "interleaved_update": (True, False, True, True),
    "deif": (True, True, False, False),
}


def table_1(lossless: Mapping[str, dict[str, Any]], lossy: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows of the table from result.json contents: `lossless` by topology's name, `lossy` the one with loss.

    Each row: algorithm, a cell {holds, figure, why, paper} per column of COLUMNS (holds is None where it was not
    run), floats_per_packet and bytes_per_packet in the fully connected network.
    """
    rows = []
    for name in lossy["algorithms"]:
        if any(name not in result["algorithms"] for result in lossless.values()):
            continue
        cells = (
            _consistent(name, lossless),
            _bounds_error(name, lossless),
            _arbitrary_topology(name, lossless),
            _robust(name, lossless[LOSSY], lossy),
        )
        paper = PAPER.get(name, (None,) * len(COLUMNS))
        packets = lossless[LOSSY]["algorithms"][name]["packets"]
        rows.append(
            {
                "algorithm": name,
                **{column: {**cell, "paper": said} for column, cell, said in zip(COLUMNS, cells, paper)},
                "floats_per_packet": packets["floats_per_packet"],
                "bytes_per_packet": packets["bytes_per_packet"],
            }
        )
    return rows


def _subjects(result: dict[str, Any], name: str) -> dict[str, dict[str, Any]]:
    return {s: m for s, m in result["algorithms"][name]["subjects"].items() if s in VEHICLES}


def _cell(holds: bool | None, figure: float | None, why: str) -> dict[str, Any]:
    return {"holds": holds, "figure": figure, "why": why}


def _consistent(name: str, lossless: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """Overconfident about no vehicle in any topology."""
    judged = [(t, s, m["verdict"]) for t, result in lossless.items() for s, m in _subjects(result, name).items()]
    bad = [f"{s} in {t[-1].upper()}" for t, s, verdict in judged if verdict == "overconfident"]
    why = f"overconfident about {', '.join(bad)}" if bad else f"not overconfident in any of {len(judged)} cases"
    return _cell(not bad, len(bad), why)


def _bounds_error(name: str, lossless: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """Where a ship with GPS is heard directly (C and D), uncertainty stops growing."""
    worst, part = _worst_growth(name, {t: lossless[t] for t in DIRECT})
    why = f"sigma of {worst} grows {part:.2f} times as much as by dead reckoning"
    return _cell(part < BOUNDED, part, why)


def _worst_growth(name: str, lossless: Mapping[str, dict[str, Any]]) -> tuple[str, float]:
    """The vehicle whose sigma grows most from the second to the last quarter, relative to dead reckoning's growth."""
    parts = {}
    for t, result in lossless.items():
        alone = _subjects(result, "dead_reckoning")
        for s, m in _subjects(result, name).items():
            parts[f"{s} in {t[-1].upper()}"] = (m["sigma_growth"] - 1) / (alone[s]["sigma_growth"] - 1)
    worst = max(parts, key=lambda k: parts[k])
    return worst, parts[worst]


def _arbitrary_topology(name: str, lossless: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """Whoever hears somebody gains by it in every topology, and the cascade (E) is bounded if the star (D) is."""
    if name == "dead_reckoning":
        return _cell(None, None, "hears nobody")
    ratios = {}
    for t, result in lossless.items():
        alone = _subjects(result, "dead_reckoning")
        for s, m in _subjects(result, name).items():
            if (t, s) not in DEAF:
                ratios[f"{s} in {t[-1].upper()}"] = m["sigma_m"] / alone[s]["sigma_m"]
    worst = max(ratios, key=lambda k: ratios[k])
    if ratios[worst] > 1 - GAIN:
        return _cell(False, ratios[worst], f"sigma of {worst} is {ratios[worst]:.2f} of dead reckoning's")
    _, star = _worst_growth(name, {STAR: lossless[STAR]})
    far, cascade = _worst_growth(name, {CASCADE: lossless[CASCADE]})
    if star < BOUNDED <= cascade:
        why = f"bounds error in D but not in the cascade: sigma of {far} grows {cascade:.2f} times as dead reckoning's"
        return _cell(False, cascade, why)
    return _cell(True, ratios[worst], f"at the least, sigma of {worst} is {ratios[worst]:.2f} of dead reckoning's")


def _robust(name: str, clear: dict[str, Any], lossy: dict[str, Any]) -> dict[str, Any]:
    """With packets lost most of what ranging gained remains, and confidence stays what it was."""
    if name == "dead_reckoning":
        return _cell(None, None, "hears nobody")
    alone, before, after = _subjects(clear, "dead_reckoning"), _subjects(clear, name), _subjects(lossy, name)
    kept = {
        s: (alone[s]["sigma_m"] - after[s]["sigma_m"]) / (alone[s]["sigma_m"] - before[s]["sigma_m"]) for s in after
    }
    worst = min(kept, key=lambda k: kept[k])
    newly = [s for s in after if after[s]["verdict"] == "overconfident" and before[s]["verdict"] != "overconfident"]
    why = f"with {100 * LOSS:.0f} % lost, {100 * kept[worst]:.0f} % of what ranges gained of {worst} remains"
    if newly:
        why += f", and it turns overconfident about {', '.join(newly)}"
    return _cell(kept[worst] >= KEPT and not newly, kept[worst], why)
