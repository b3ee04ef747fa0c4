"""SAS-SLAM with points and velocities for poses, a first-order system (C19 §5.2.4, Table 5.4)."""

from __future__ import annotations

from engine.slam.building import Plan
from engine.slam.run import by_kernels

PLAN = Plan("arrays", motion="dynamic")

run = by_kernels("sas_dynamic", PLAN)
