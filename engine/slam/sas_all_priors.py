"""Synthetic apertures on known poses, a fix at each: mapping without navigation (C19 §5.2.2, Table 5.2)."""

from __future__ import annotations

from engine.slam.building import Plan
from engine.slam.run import by_kernels

PLAN = Plan("arrays", fixes="all")

run = by_kernels("sas_all_priors", PLAN)
