"""Cooperative smoothing by factor composition (W15): chains, packets, and the batch smoother behind them."""

from engine.smoothing.centralized_smoother import CENTRALIZED_SMOOTHER
from engine.smoothing.k_best import K_BEST
from engine.smoothing.k_last import K_LAST
from engine.smoothing.paull import PAULL

REGISTERED = (K_LAST, K_BEST, PAULL, CENTRALIZED_SMOOTHER)
