"""Cooperative smoothing by factor composition (W15): chains, packets, and the batch smoother behind them."""

from engine.smoothing.centralized_smoother import CENTRALIZED_SMOOTHER

REGISTERED = (CENTRALIZED_SMOOTHER,)
