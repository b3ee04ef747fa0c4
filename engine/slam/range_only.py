"""Range-only SLAM with non-Gaussian beliefs: every range a density of several peaks (C19 §5.2.1, Table 5.1)."""

from __future__ import annotations

from engine.slam.building import Plan
from engine.slam.run import by_kernels

PLAN = Plan("ranges")

run = by_kernels("range_only", PLAN)
