"""Cooperative navigation by one-way travel times (W11, W12): one file per estimator."""

from engine.navigation.cekf import CEKF
from engine.navigation.dead_reckoning import DEAD_RECKONING
from engine.navigation.deif import DEIF
from engine.navigation.interleaved_update import INTERLEAVED_UPDATE
from engine.navigation.mdeif import MDEIF
from engine.navigation.mission import fly_navigation, outline
from engine.navigation.nekf import NEKF
from engine.registry import Family

NAVIGATION = Family(
    name="navigation", title="Cooperative navigation", fly=fly_navigation, outline=outline, accepts=("smoothing",)
)

REGISTERED = (NAVIGATION, DEAD_RECKONING, CEKF, NEKF, INTERLEAVED_UPDATE, DEIF, MDEIF)
