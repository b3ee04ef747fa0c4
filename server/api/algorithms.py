"""The estimators there are."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from engine import registry

router = APIRouter(prefix="/api", tags=["algorithms"])


@router.get("/algorithms")
def algorithms() -> list[dict[str, Any]]:
    """Every installed algorithm, with what it assumes and the families of missions it runs on."""
    return described()


def described() -> list[dict[str, Any]]:
    """All algorithms in JSON's own types."""
    families = registry.families().values()
    return [
        {
            "name": a.name,
            "title": a.title,
            "family": a.family,
            "summary": a.summary,
            "source": a.source,
            "centralized": a.centralized,
            "assumes": list(a.assumes),
            "accepts_families": [f.name for f in families if a.family in (f.name, *f.accepts)],
        }
        for a in registry.algorithms().values()
    ]
