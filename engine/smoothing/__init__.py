"""Cooperative smoothing by factor composition (W15): chains, packets, and the batch smoother behind them."""

from engine.smoothing.centralized_smoother import CENTRALIZED_SMOOTHER
from engine.smoothing.k_best import K_BEST
from engine.smoothing.k_last import K_LAST

REGISTERED = (K_LAST, K_BEST, CENTRALIZED_SMOOTHER)
