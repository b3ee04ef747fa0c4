"""What variables that are gone said of those that stay: the density left when they are marginalized."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from engine.slam.factors.factor import Factor

#: Part of the largest information below which a direction counts as unknown.
UNKNOWN = 1e-12


@dataclass(frozen=True, eq=False)
class Remembered(Factor):
    """A Gaussian for each kernel: root (1 or N, D, D) times the way from at [(1 or N, d)], less offset (1 or N, D).

    It is of the kernels that it was made with and must be taken along with them (`taken`). Nothing is drawn from it.
    """

    at: tuple[np.ndarray, ...]
    root: np.ndarray
    offset: np.ndarray

    def residual(self, *values: np.ndarray) -> np.ndarray:
        away = [np.atleast_2d(value) - at for value, at in zip(values, self.at, strict=True)]
        size = np.broadcast_shapes(*(d.shape[:-1] for d in away))
        d = np.concatenate([np.broadcast_to(part, (*size, part.shape[-1])) for part in away], axis=-1)
        return np.einsum("...ij,...j->...i", self.root, d) - self.offset

    def linearize(self, *values: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        ends = np.cumsum([at.shape[-1] for at in self.at])[:-1]
        root = self.root[0] if len(self.root) == 1 else self.root
        return self.residual(*values), np.split(root, ends, axis=-1)

    def taken(self, kept: np.ndarray) -> Remembered:
        def some(x: np.ndarray) -> np.ndarray:
            return x[kept] if len(x) > 1 else x

        return replace(self, at=tuple(map(some, self.at)), root=some(self.root), offset=some(self.offset))


def remembered(variables: Sequence[str], at: Sequence[np.ndarray], Lam: np.ndarray, eta: np.ndarray) -> Remembered:
    """The density exp(eta' d - d' Lam d / 2) of the ways d from `at`; shapes as in propagation.Message."""
    value, basis = np.linalg.eigh(Lam)
    size = np.sqrt(np.where(value > UNKNOWN * value[..., -1:], value, 0.0))
    root = size[..., None] * np.swapaxes(basis, -1, -2)
    along = np.einsum("...ji,...j->...i", basis, eta)
    offset = np.divide(along, size, out=np.zeros(np.broadcast_shapes(along.shape, size.shape)), where=size > 0)
    return Remembered(tuple(variables), tuple(at), root, offset, costly=True)
