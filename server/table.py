"""The comparison of a result as rows of text, for a terminal or a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

HEADER = [
    "algorithm",
    "subject",
    "RMSE m",
    "final m",
    "sigma m",
    "ANEES",
    "verdict",
    "packets",
    "bytes each",
    "bit/s",
    "CPU s",
]


def figures(result: dict[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Header and one row for each algorithm and subject of a result.json; "!" marks a load beyond the channel's."""
    rows = []
    for name, answer in result["algorithms"].items():
        for n, (subject, m) in enumerate(answer["subjects"].items()):
            own = [
                subject,
                number(m["rmse_m"]),
                number(m["final_rmse_m"]),
                number(m["sigma_m"]),
                number(m["anees"]),
                m.get("verdict") or {True: "consistent", False: "overconfident", None: "-"}[m["consistent"]],
            ]
            packets = answer["packets"]
            load = number(packets["bits_per_second"]) + ("!" if packets["exceeds_capacity"] else "")
            shared = [number(packets["sent"]), number(packets["bytes_per_packet"]), load, number(answer["cpu_s"])]
            rows.append([name if n == 0 else "", *own, *(shared if n == 0 else [""] * len(shared))])
    return HEADER, rows


def curves(key: str, results: Sequence[tuple[float, dict[str, Any]]]) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a sweep: the swept value, then algorithm and subject with their figures."""
    header = [key, "algorithm", "subject", "RMSE m", "sigma m", "ANEES", "interval", "verdict", "bit/s"]
    rows = []
    for value, result in results:
        for name, answer in result["algorithms"].items():
            for subject, m in answer["subjects"].items():
                bounds = m["anees_interval"]
                rows.append(
                    [
                        f"{value:g}",
                        name,
                        subject,
                        *(number(m[figure]) for figure in ("rmse_m", "sigma_m", "anees")),
                        "-" if bounds is None else f"{bounds[0]:.2f}..{bounds[1]:.2f}",
                        str(m.get("verdict", "-")),
                        number(answer["packets"]["bits_per_second"]),
                    ]
                )
    return header, rows


def number(value: float | None) -> str:
    """A figure to three digits, a dash where there is none."""
    if value is None:
        return "-"
    if isinstance(value, int) or abs(value) >= 1000:
        return f"{value:.0f}"
    return f"{value:.3g}"


def lines(header: Sequence[str], rows: Sequence[Sequence[str]], left: int = 2) -> list[str]:
    """Columns in line, the first `left` of them to the left."""
    widths = [max(len(row[k]) for row in [header, *rows]) for k in range(len(header))]

    def line(row: Sequence[str]) -> str:
        cells = [c.ljust(w) if k < left else c.rjust(w) for k, (c, w) in enumerate(zip(row, widths))]
        return "  ".join(cells).rstrip()

    return [line(header), "  ".join("-" * w for w in widths), *map(line, rows)]
