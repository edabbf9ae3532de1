"""How much of a residual a distortion tells, on cells that its numbers were not fitted to.

Each session's residual is fitted on its own, with the cells of a fold left out; what is explained is a product of two
sessions, residual and fit of the one with those of another. So neither scatter nor the number of columns adds to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from taxel.gap.data.pair import Pair
from taxel.gap.features.chances import compute_student_survival
from taxel.gap.features.features import Layout, SessionMeans
from taxel.gap.features.metric import jackknife, leave_one_out, off_diagonal
from taxel.gap.localisation.signature.shapes import HAND, Shape, groups
from taxel.types import FloatArray

RIDGE: Final = 0.03
"""Of a column's mean energy in a group: what a group hardly shows is not fitted."""

LEAST_SHARED: Final = 0.05
"""Of `Remainder.both`, below which two sessions tell nothing together."""

TOLD_RIDGE: Final = 0.001
"""The same for the numbers that are told: these are not to be drawn to 0."""


@dataclass(frozen=True, eq=False)
class Told:
    """What a distortion tells in one scope.

    taxels: f64[n], counts^2 of the excess that are told. total: f64[S, S], of each pair of sessions.
    numbers: f64[G, K], fitted to all cells and sessions. size: how many numbers there are.
    """

    shape: str
    scope: str
    taxels: FloatArray
    total: FloatArray
    numbers: FloatArray

    @property
    def size(self) -> int:
        """Numbers that were fitted."""
        return self.numbers.size


@dataclass(frozen=True, eq=False)
class Remainder:
    """What the best set leaves.

    residual: f64[C, S, F, n], counts; 0 where unknown. known: bool of the same form. root: f64[F, 1], roots of what the
    squares count. fold: [C]. both: f64[S, S], share of the predicted drop, squared, that two sessions both know.
    """

    pair: Pair
    residual: FloatArray
    known: NDArray[np.bool_]
    root: FloatArray
    fold: NDArray[np.intp]
    both: FloatArray

    @classmethod
    def of(cls, pair: Pair, real: SessionMeans, model: FloatArray, layout: Layout, fold: NDArray[np.intp]) -> Remainder:
        """model: f64[C, F, n]."""
        residual = real.residual(model)
        known = real.known & np.isfinite(residual)
        root = np.sqrt(layout.scale(model.shape[0], model.shape[2]))
        heard = known[:, :, : layout.bins].any(axis=2)
        pressed = np.nan_to_num(model[:, : layout.bins] ** 2).sum(axis=1) + 1e-9
        both = np.einsum("csn,ctn,cn->st", heard, heard, pressed, optimize=True) / pressed.sum()
        return cls(pair, np.where(known, residual, 0.0), known, root, fold, both)

    def even(self, gram: FloatArray) -> FloatArray:
        """Products f64[S, S] as if every session knew everything; two that share little count as the others do."""
        tells = self.both > LEAST_SHARED
        if not tells.any():
            return np.zeros_like(gram)
        full = gram / np.where(tells, self.both, 1.0)
        return np.asarray(np.where(tells, full, full[tells].mean()))

    @property
    def gram(self) -> FloatArray:
        """Counts^2 of each pair of sessions, f64[S, S]."""
        scaled = self.residual * self.root
        return self.even(np.einsum("csfn,ctfn->st", scaled, scaled, optimize=True))


@dataclass(frozen=True, eq=False)
class _Sums:
    """Normal equations of every cell and taxel: normal f64[C, n, K, K], right f64[C, S, n, K], heard bool[C, S, n].

    unit: f64[K], by which columns were divided.
    """

    normal: FloatArray
    right: FloatArray
    heard: NDArray[np.bool_]
    unit: FloatArray


def told(left: Remainder, shape: Shape) -> list[Told]:
    """A distortion in all its scopes; none where one cell is all there is and the distortion needs another."""
    sums = _sums(left, shape)
    one_condition = len(np.unique(left.fold)) < 2
    return [_in_scope(left, sums, shape, scope) for scope in shape.scopes if not one_condition or scope == HAND]


def p_value(gram: FloatArray) -> float | None:
    """That this much, f64[S, S], is told although nothing is there: t of the jackknife. None below 3 sessions."""
    whole = float(off_diagonal(gram))
    left = [float(off_diagonal(gram[np.ix_(stay, stay)])) for stay in leave_one_out(len(gram))]
    return survival(whole, jackknife(np.array(left), whole).error, len(gram))


def survival(value: float, error: float | None, sessions: int) -> float | None:
    """One-sided p-value of Student's t."""
    if error is None:
        return None
    if error <= 0:
        return 1.0 if value <= 0 else 0.0
    return compute_student_survival(value / error, sessions - 1)


def _sums(left: Remainder, shape: Shape) -> _Sums:
    root = left.root[shape.features, 0]
    known = left.known[:, :, shape.features]
    ever: NDArray[np.bool_] = np.asarray(known.any(axis=1))
    columns = np.where(np.moveaxis(ever, 1, 2)[..., None], shape.columns * root[:, None], 0.0)
    unit = np.sqrt(np.einsum("cnpk,cnpk->k", columns, columns))
    unit[unit <= 0] = 1.0
    columns /= unit
    turned = np.swapaxes(columns, 2, 3)
    residual = np.transpose(left.residual[:, :, shape.features] * root[:, None], (0, 3, 2, 1))  # [C, n, P, S]
    right = np.moveaxis(np.matmul(turned, residual), 3, 1)
    return _Sums(np.matmul(turned, columns), right, np.asarray(known.any(axis=2)), unit)


def _in_scope(left: Remainder, sums: _Sums, shape: Shape, scope: str) -> Told:
    group = groups(left.pair, scope)
    count = int(group.max()) + 1
    belongs = csr_array((np.ones(len(group)), (group, np.arange(len(group)))))
    right = _grouped(belongs, sums.right, 2)
    # A session that does not know a taxel learns from the others only; as a rule all do, and one inverse serves all.
    if sums.heard.all():
        normal = _grouped(belongs, sums.normal, 1)[:, None]
    else:
        weighted = (sums.normal * sums.heard[:, s, :, None, None] for s in range(sums.heard.shape[1]))
        normal = np.stack([_grouped(belongs, one, 1) for one in weighted], axis=1)
    whole, wanted = normal.sum(axis=0), right.sum(axis=0)
    ridge = np.eye(normal.shape[-1]) * RIDGE / count
    fitted = np.empty(right.shape)
    for fold in np.unique(left.fold):
        held = left.fold == fold
        out = held & (not held.all())
        inverse = np.linalg.inv(whole - normal[out].sum(axis=0) + ridge)
        fitted[held] = np.matmul(inverse, (wanted - right[out].sum(axis=0))[..., None])[..., 0]
    numbers = np.matmul(
        np.linalg.inv(whole.mean(axis=0) + ridge * (TOLD_RIDGE / RIDGE)), wanted.mean(axis=0)[..., None]
    )[..., 0]
    own = fitted[:, :, group] * sums.heard[..., None]
    gram = _products(sums, own)
    return Told(shape.name, scope, off_diagonal(gram), left.even(gram.sum(axis=0)), numbers / sums.unit)


def _products(sums: _Sums, fitted: FloatArray) -> FloatArray:
    """Residuals' products less those of what the fits f64[C, S, n, K] leave, f64[n, S, S]."""

    def by_taxel(values: FloatArray) -> FloatArray:
        conditions, sessions, taxels, columns = values.shape
        return np.transpose(values, (2, 1, 0, 3)).reshape(taxels, sessions, conditions * columns)

    predicted = np.moveaxis(np.matmul(sums.normal, np.moveaxis(fitted, 1, 3)), 3, 1)
    turned = np.swapaxes(by_taxel(fitted), 1, 2)
    cross = np.matmul(by_taxel(sums.right), turned)
    return np.asarray(cross + np.swapaxes(cross, 1, 2) - np.matmul(by_taxel(predicted), turned))


def _grouped(belongs: csr_array, values: FloatArray, axis: int) -> FloatArray:
    """Sums over the groups along an axis of n."""
    count, taxels = belongs.shape
    if count == taxels and bool((belongs.indices == np.arange(taxels)).all()):
        return values
    if count == 1:
        return np.asarray(values.sum(axis=axis, keepdims=True))
    first = np.moveaxis(values, axis, 0)
    summed = (belongs @ first.reshape(len(first), -1)).reshape(-1, *first.shape[1:])
    return np.asarray(np.moveaxis(summed, 0, axis))
