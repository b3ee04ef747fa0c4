"""One of several factors holds, with known odds: a measurement of several modes, a range or its echo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.slam.factors.factor import Factor


@dataclass(frozen=True)
class Mixture(Factor):
    """Components on the same variables and of the same size; the last variable is the label of the one that holds.

    odds (M,) sum to one; log_norms (M,) are the components' log normalizers, which decide between them.
    """

    components: tuple[Factor, ...]
    odds: np.ndarray
    log_norms: np.ndarray

    @property
    def determined(self) -> tuple[str, ...]:
        return self.components[0].determined

    def residual(self, *values: np.ndarray) -> np.ndarray:
        *rest, label = values
        found = np.stack(np.broadcast_arrays(*(c.residual(*rest) for c in self.components)))
        return np.concatenate([self._pick(found, label), self._penalty(label, found.shape[1:-1])], axis=-1)

    def linearize(self, *values: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        *rest, label = values
        parts = [c.linearize(*rest) for c in self.components]
        e = self._pick(np.stack(np.broadcast_arrays(*(e for e, _ in parts))), label)
        e = np.concatenate([e, self._penalty(label, e.shape[:-1])], axis=-1)
        jacobians = []
        for i in range(len(rest)):
            J = np.stack([J[i] for _, J in parts])
            if J.ndim == 3:
                J = np.broadcast_to(J[:, None], (len(J), len(label), *J.shape[1:]))
            J = self._pick(J, label[..., None])
            jacobians.append(np.concatenate([J, np.zeros((*J.shape[:-2], 1, J.shape[-1]))], axis=-2))
        return e, [*jacobians, np.zeros((len(label), e.shape[-1], 1))]

    def sample(
        self, towards: int, values: list[np.ndarray], strata: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        if towards == len(self.variables) - 1:
            label = np.searchsorted(np.cumsum(self.odds), strata, side="right")
            return np.minimum(label, len(self.odds) - 1)[..., None].astype(float)
        *rest, label = values
        found = np.stack([c.sample(towards, rest, strata, rng) for c in self.components])
        return self._pick(found, label)

    def _pick(self, stacked: np.ndarray, label: np.ndarray) -> np.ndarray:
        chosen = np.round(label).astype(int)
        size = (1, *np.broadcast_shapes(stacked.shape[1:-1], chosen.shape[:-1]), 1)
        stacked = np.broadcast_to(stacked, (len(stacked), *size[1:-1], stacked.shape[-1]))
        return np.take_along_axis(stacked, np.broadcast_to(chosen[None], size), axis=0)[0]

    def _penalty(self, label: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        """As a residual without Jacobian: what a component's normalizer takes from its density."""
        behind = self.log_norms.max() - self.log_norms[np.round(label[..., 0]).astype(int)]
        return np.broadcast_to(np.sqrt(2.0 * behind)[..., None], (*np.broadcast_shapes(shape, behind.shape), 1))


def mixture(label: str, components: list[tuple[float, float, Factor]]) -> Mixture:
    """A mixture of (odds, log normalizer, factor); `label` names the variable that tells which one holds."""
    odds = np.array([o for o, _, _ in components], dtype=float)
    if not (odds > 0).all():
        raise ValueError(f"the odds of a mixture must be positive, got {odds.tolist()}")
    first = components[0][2]
    return Mixture(
        (*first.variables, label),
        tuple(f for _, _, f in components),
        odds / odds.sum(),
        np.array([n for _, n, _ in components], dtype=float),
        determines=first.determines,
    )
