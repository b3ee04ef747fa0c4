"""Cooperative smoothing by factor composition (W15): chains, packets, and the batch smoother behind them."""
