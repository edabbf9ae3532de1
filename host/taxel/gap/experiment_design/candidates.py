"""Presses that could be made: those that were, once more or changed, and what the simulator would feel in each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from taxel.gap.data.clock import Clock
from taxel.gap.effects.proximity import MISSED_M
from taxel.gap.fitting.state import Signal, State
from taxel.recording.grasp_format import Phase

LADDER: Final = (0.25, 0.5, 2.0, 3.0)
"""Factors on the force of a press."""

SLOWER: Final = 4.0
QUICKER: Final = 3.0
"""Of closing."""

LONGER: Final = 4.0
"""Of hold."""

LEAST_FRAMES: Final = 4
"""A closing of fewer frames tells no time."""

APART_M: Final = 2e-3
"""From the surface, of an object that is held off: near enough to be seen, far enough not to touch by chance."""


@dataclass(frozen=True)
class PlannedContact:
    """A press that could be made. The scales are of a recorded or simulated one of that object and approach.

    apart_mm: the object is held off so far, and nothing touches. recorded: whether the hand has made this approach.
    """

    object: str
    approach: str
    force_scale: float = 1.0
    closing_scale: float = 1.0
    hold_scale: float = 1.0
    apart_mm: float | None = None
    recorded: bool = True

    @property
    def words(self) -> str:
        """For people."""
        how = []
        if self.apart_mm is not None:
            how.append(f"held at a distance of {self.apart_mm:g} mm")
        if self.force_scale != 1.0:
            how.append(f"with {self.force_scale:g} times the force")
        if self.closing_scale > 1.0:
            how.append(f"closed {self.closing_scale:g} times slower")
        if self.closing_scale < 1.0:
            how.append(f"closed {1.0 / self.closing_scale:g} times faster")
        if self.hold_scale != 1.0:
            how.append(f"held {self.hold_scale:g} times as long")
        if not self.recorded:
            how.append("simulated but not yet recorded")
        return f"{self.object} {self.approach}, {', '.join(how) or 'repeated'}"

    def to_json(self) -> dict[str, Any]:
        """For the report."""
        return {
            "press": self.words,
            "object": self.object,
            "approach": self.approach,
            "force_scale": self.force_scale,
            "closing_scale": self.closing_scale,
            "hold_scale": self.hold_scale,
            "apart_mm": self.apart_mm,
            "recorded": self.recorded,
        }


@dataclass(frozen=True, eq=False)
class Batch:
    """Presses with the state that effects act on: press k is its cell k. again: they repeat what was recorded."""

    contacts: tuple[PlannedContact, ...]
    state: State
    again: bool = False


def batches(state: State, recorded: bool, memory: bool, near: bool) -> Iterator[Batch]:
    """Every press of a state as it is, and changed in one thing at a time.

    recorded: whether the hand has made them. memory: whether something is asked that depends on time. near: whether
    something is asked that is felt before contact.
    """
    own = _one_each(state)
    contacts = tuple(PlannedContact(*condition, recorded=recorded) for condition in own.pair.conditions)

    def changed(state: State, **how: Any) -> Batch:
        return Batch(tuple(replace(contact, **how) for contact in contacts), state)

    yield Batch(contacts, own, again=recorded)
    if own.base.force is not None:
        for scale in LADDER:
            yield changed(_harder(own, scale), force_scale=scale)
    if memory:
        closing = own.clock.phase == Phase.CLOSING
        lasts = float(own.clock.end[closing].max(initial=0.0))
        if lasts > 0.0:
            yield changed(_slower(own, Phase.CLOSING, SLOWER), closing_scale=SLOWER)
        if lasts / QUICKER >= LEAST_FRAMES * own.pair.frame_s:
            yield changed(_slower(own, Phase.CLOSING, 1.0 / QUICKER), closing_scale=1.0 / QUICKER)
        yield changed(_slower(own, Phase.HOLD, LONGER), hold_scale=LONGER)
    if near and own.base.separation is not None:
        yield changed(_held_off(own), apart_mm=1e3 * APART_M)


def _one_each(state: State) -> State:
    """One press a cell."""
    first = np.array(
        [np.flatnonzero(state.condition == condition)[0] for condition in range(len(state.pair.conditions))]
    )
    base = state.base.mapped(lambda values: values[first])
    return State(state.pair, state.layout, state.clock, state.condition[first], base, state.mean, state.shift_s)


def _with(state: State, base: Signal) -> State:
    return State(state.pair, state.layout, state.clock, state.condition, base, state.predicted(base), state.shift_s)


def _harder(state: State, scale: float) -> State:
    """All forces scaled, and the depths with them; the patch of contact stays."""
    force, separation = state.base.force, state.base.separation
    assert force is not None
    depth = None if separation is None else np.where(separation < 0.0, scale * separation, separation)
    return _with(state, replace(state.base, force=scale * force, separation=depth))


def _held_off(state: State) -> State:
    """No force, and in hold the nearest taxel `APART_M` from the object; the way there is as it was."""
    separation = state.base.separation
    assert separation is not None
    hold = separation[:, state.clock.phase == Phase.HOLD]
    apart = np.where(separation < MISSED_M, separation - hold.min(axis=(1, 2))[:, None, None] + APART_M, separation)
    force = None if state.base.force is None else np.zeros_like(state.base.force)
    return _with(state, replace(state.base, force=force, separation=apart))


def _slower(state: State, phase: Phase, factor: float) -> State:
    """A phase that lasts `factor` times as long, with the same course in it."""
    clock = state.clock
    scale = np.where(clock.phase == phase, factor, 1.0)
    return replace(state, clock=Clock(clock.phase, scale * clock.begin, scale * clock.end, clock.bins))
