"""The sound speed as an unknown: one more state where the scenario says how far the assumed one may be wrong."""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import Moments, join
from engine.navigation.network import Member


def with_sound_speed(state: Moments, member: Member) -> tuple[Moments, slice | None]:
    """Append a constant scale error kappa of all measured ranges, N(0, (sigma_c / c)^2), and say where it is.

    Nothing is appended where the scenario trusts its sound speed.
    """
    if member.sound_speed_sigma_mps <= 0:
        return state, None
    sigma = member.sound_speed_sigma_mps / member.sound_speed_mps
    kappa = Moments(np.zeros((member.trials, 1)), np.full((member.trials, 1, 1), sigma**2))
    n = state.mean.shape[-1]
    return join(state, kappa), slice(n, n + 1)
