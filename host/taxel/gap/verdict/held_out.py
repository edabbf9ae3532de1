"""How far the gap shrinks in a session that was left out: fitted inside, frozen, measured outside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from taxel.gap.effects.catalogue import FIXED
from taxel.gap.features.features import SessionMeans
from taxel.gap.features.metric import Interval, jackknife, leave_one_out, shrink
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import fit, start_of
from taxel.gap.fitting.judge import REFITS, Judge
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Each left-out session's squared gap, counts^2: f64[S] before and after; floor2 of one session; prediction frozen.

    predicted: shrink that the other sessions promised, f64[S]. links: fitted without each session.
    """

    before2: FloatArray
    after2: FloatArray
    floor2: float
    predicted: FloatArray
    links: tuple[tuple[FittedEffect, ...], ...]

    @property
    def sessions(self) -> int:
        """S."""
        return len(self.before2)

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
        return jackknife(self._left(shrink), shrink(float(self.before2.mean()), float(self.after2.mean())))

    @property
    def value(self) -> Interval:
        """The gap after, counts."""
        return jackknife(self._left(lambda _, after: float(np.sqrt(after))), self.after).positive

    @property
    def left2(self) -> Interval:
        """Remaining excess: what lies above the floor with the effects, counts^2, with its interval."""
        return jackknife(self._left(lambda _, after: after - self.floor2), float(self.after2.mean() - self.floor2))

    @property
    def reducible(self) -> float | None:
        """Share of what lies above the floor; None unless that is surely there."""
        room = self.before2.mean() - self.floor2
        spread = jackknife(self._left(lambda before, _: before - self.floor2), room)
        if spread.low is None or spread.low <= 0:
            return None
        return float(1.0 - (self.after2.mean() - self.floor2) / room)

    def _left(self, of: Callable[[float, float], float]) -> FloatArray:
        stays = leave_one_out(len(self.before2)) if len(self.before2) > 1 else []
        return np.array([of(float(self.before2[k].mean()), float(self.after2[k].mean())) for k in stays])


def compute_held_out(
    judge: Judge, composite: CompositeModel, fixed: Sequence[str] = FIXED, in_sample: Sequence[CompositeModel] = ()
) -> HeldOut:
    """Leave every session out in turn. inside: what was chosen without each, if it was not `chain` for all."""
    real, layout = judge.sessions, judge.layout
    count = real.value.shape[1]
    before = judge.state.mean
    scale = layout.scale(real.value.shape[0], real.value.shape[3])
    firsts = [real.square(session, before, scale) for session in range(count)]
    seconds, promised, links = [], [], []
    start = start_of(judge.state, composite, fixed)
    for session in range(count):
        if in_sample:
            composite, start = in_sample[session], start_of(judge.state, in_sample[session], fixed)
        part = real.only(np.arange(count) != session) if count > 1 else real
        own = Judge(judge.state, part, layout)
        fitted = fit(own.problem(), composite, fixed, REFITS, start)
        links.append(fitted.composite.links)
        seconds.append(real.square(session, fitted.features, scale))
        excess = [own.excess(features) for features in (before, fitted.features)]
        scatter = compute_session_variance(part, scale)
        promised.append(shrink(max(excess[0], 0.0) + scatter, max(excess[1], 0.0) + scatter))
    return HeldOut(
        np.array(firsts), np.array(seconds), compute_session_variance(real, scale), np.array(promised), tuple(links)
    )


def compute_session_variance(real: SessionMeans, scale: FloatArray) -> float:
    """Squared gap of one session that its scatter alone makes, counts^2."""
    return float(np.sum(scale * np.nan_to_num(real.variance)))
