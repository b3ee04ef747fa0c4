"""SAS-SLAM with points for poses: position increments and a few fixes (C19 §5.2.3, Table 5.3)."""

from __future__ import annotations

from engine.slam.building import Plan
from engine.slam.run import by_kernels

PLAN = Plan("arrays", motion="static")

run = by_kernels("sas_static", PLAN)
