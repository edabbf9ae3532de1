"""How far the gap shrinks in a session that was left out: fitted inside, frozen, measured outside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.gap.chain import Chain, Link
from taxel.gap.features import SessionMeans, known_mean
from taxel.gap.fit import fit
from taxel.gap.judge import REFITS, Judge
from taxel.gap.metric import Interval, jackknife
from taxel.gap.select import FIXED
from taxel.gap.where import off_diagonal

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Each left-out session's squared gap, counts^2: f64[S] before and after; floor2 of one session; prediction frozen.

    predicted: shrink that the other sessions promised, f64[S]. links: fitted without each session.
    """

    before2: Array
    after2: Array
    floor2: float
    predicted: Array
    links: tuple[tuple[Link, ...], ...]

    @property
    def before(self) -> float:
        """Counts."""
        return float(np.sqrt(self.before2.mean()))

    @property
    def after(self) -> float:
        """Counts."""
        return float(np.sqrt(self.after2.mean()))

    @property
    def shrink(self) -> Interval:
        """(before - after) / before with its interval."""
        return jackknife(self._left(_shrink), _shrink(self.before2.mean(), self.after2.mean()))

    @property
    def value(self) -> Interval:
        """The gap after, counts."""
        return jackknife(self._left(lambda _, after: float(np.sqrt(after))), self.after)

    @property
    def reducible(self) -> float | None:
        """Share of what lies above the floor; None unless that is surely there."""
        room = self.before2.mean() - self.floor2
        spread = jackknife(self._left(lambda before, _: before - self.floor2), room)
        if spread.low is None or spread.low <= 0:
            return None
        return float(1.0 - (self.after2.mean() - self.floor2) / room)

    def _left(self, of: Callable[[float, float], float]) -> Array:
        count = len(self.before2)
        keep = [np.arange(count) != s for s in range(count)]
        return np.array([of(self.before2[k].mean(), self.after2[k].mean()) for k in keep]) if count > 1 else np.zeros(0)


def _shrink(before2: float, after2: float) -> float:
    return float(1.0 - np.sqrt(after2 / before2)) if before2 > 0 else 0.0


def held_out(judge: Judge, chain: Chain, fixed: Sequence[str] = FIXED) -> HeldOut:
    """Leave every session out in turn."""
    real, layout = judge.sessions, judge.layout
    count = real.value.shape[1]
    before = judge.state.mean
    scale = layout.weight[:, None] / (real.value.shape[0] * real.value.shape[3])
    known = np.isfinite(real.value)
    about = np.where(known, real.value - known_mean(real.value, 1)[:, None], 0.0)
    freedom = known.sum(axis=1) - 1
    variance = (about**2).sum(axis=1) / np.where(freedom > 0, freedom, np.nan) if count > 1 else real.spread
    floor2 = float(np.sum(scale * np.nan_to_num(variance)))
    firsts: list[float] = []
    seconds: list[float] = []
    promised, links = [], []
    for session in range(count):
        inside = np.arange(count) != session if count > 1 else np.ones(1, bool)
        part = _sessions(real, inside)
        own = Judge(judge.state, part, layout)
        fitted = fit(own.problem(), chain, fixed, REFITS)
        links.append(fitted.chain.links)
        outside = known[:, session]
        for store, features in ((firsts, before), (seconds, fitted.features)):
            store.append(float(np.sum(np.where(outside, scale * (real.value[:, session] - features) ** 2, 0.0))))
        excess = [_excess(part, features, scale) for features in (before, fitted.features)]
        promised.append(_shrink(max(excess[0], 0.0) + floor2, max(excess[1], 0.0) + floor2))
    return HeldOut(np.array(firsts), np.array(seconds), floor2, np.array(promised), tuple(links))


def _sessions(real: SessionMeans, chosen: NDArray[np.bool_]) -> SessionMeans:
    return SessionMeans(real.value[:, chosen], real.count[:, chosen], real.spread)


def _excess(real: SessionMeans, features: Array, scale: Array) -> float:
    residual = np.where(np.isfinite(real.value), real.value - features[:, None], 0.0) * np.sqrt(scale)
    gram = np.einsum("csfn,ctfn->st", residual, residual, optimize=True)
    return float(off_diagonal(gram[None])[0])
