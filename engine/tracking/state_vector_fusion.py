"""State vector fusion (Bar-Shalom and Campo 1986, RC eq. 9-13): optimal where cross-covariances are tracked."""

from __future__ import annotations

import numpy as np

from engine.tracking.combination import best_weights, combined
from engine.tracking.recursion import Fused


def state_vector_fusion(believed: np.ndarray, actual: np.ndarray) -> Fused:
    """Maximum likelihood from the estimates alone: W_j = P_f sum_i (P^-1)_ij, P_f = (sum_ij (P^-1)_ij)^-1.

    actual (..., N, n, N, n) is the joint error covariance that the nodes track together, so what is believed is so.
    """
    weights = best_weights(actual)
    return Fused(weights, combined(weights, actual))
