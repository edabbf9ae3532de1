"""Candidate contacts: repetitions and variations of given contacts, with the simulated signal of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from taxel.gap.data.time_grid import TimeGrid
from taxel.gap.effects.proximity import MISS_SEPARATION_M
from taxel.gap.fitting.state import Signal, State
from taxel.recording.grasp_format import Phase

FORCE_FACTORS: Final = (0.25, 0.5, 2.0, 3.0)
"""Factors on the contact force. Chosen: a quarter to three times the force separates effects that depend on the load
differently. The simulated contact area stays constant, which is less realistic at larger factors."""

SLOW_CLOSING_FACTOR: Final = 4.0
"""Factor on the duration of closing in a slow contact. Chosen; a larger factor excites slow effects more."""

FAST_CLOSING_FACTOR: Final = 3.0
"""Divisor of the duration of closing in a fast contact. Chosen; a larger divisor leaves fewer frames in closing."""

LONG_HOLD_FACTOR: Final = 4.0
"""Factor on the duration of hold in a long contact. Chosen; a larger factor excites slow effects more."""

MIN_CLOSING_FRAMES: Final = 4
"""Smallest number of frames in a fast closing. Chosen: fewer frames do not resolve the time of the contact."""

HELD_DISTANCE_M: Final = 2e-3
"""Distance in metres between the object and the nearest taxel in a contact without touch.

Chosen: small enough for a proximity signal, and large enough to avoid accidental touch.
"""


@dataclass(frozen=True)
class PlannedContact:
    """A candidate contact, described by its difference from the given contact of the same object and approach.

    Attributes:
        object, approach: condition of the given contact, which was recorded or only simulated.
        force_scale: factor on the force.
        closing_scale, hold_scale: factors on the durations of closing and hold.
        apart_mm: distance in mm at which the object is held without touch; None for a contact with touch.
        is_recorded: whether the approach was recorded with the hand.
    """

    object: str
    approach: str
    force_scale: float = 1.0
    closing_scale: float = 1.0
    hold_scale: float = 1.0
    apart_mm: float | None = None
    is_recorded: bool = True

    @property
    def description(self) -> str:
        """Text for the user: object, approach, and the difference from the given contact."""
        changes = []
        if self.apart_mm is not None:
            changes.append(f"held at a distance of {self.apart_mm:g} mm")
        if self.force_scale != 1.0:
            changes.append(f"with {self.force_scale:g} times the force")
        if self.closing_scale > 1.0:
            changes.append(f"closed {self.closing_scale:g} times slower")
        if self.closing_scale < 1.0:
            changes.append(f"closed {1.0 / self.closing_scale:g} times faster")
        if self.hold_scale != 1.0:
            changes.append(f"held {self.hold_scale:g} times as long")
        if not self.is_recorded:
            changes.append("simulated but not yet recorded")
        return f"{self.object} {self.approach}, {', '.join(changes) or 'repeated'}"

    def to_json(self) -> dict[str, Any]:
        """Return the fields of an entry of `next_presses` in the report."""
        return {
            "press": self.description,
            "object": self.object,
            "approach": self.approach,
            "force_scale": self.force_scale,
            "closing_scale": self.closing_scale,
            "hold_scale": self.hold_scale,
            "apart_mm": self.apart_mm,
            "recorded": self.is_recorded,
        }


@dataclass(frozen=True, eq=False)
class ContactBatch:
    """Candidate contacts with the same variation.

    Attributes:
        contacts: the contacts, one for each condition of `state`, in the same order.
        state: simulated signals of these contacts without effects.
        is_repeat: whether the contacts repeat recorded contacts without a variation.
    """

    contacts: tuple[PlannedContact, ...]
    state: State
    is_repeat: bool = False


def generate_batches(
    state: State, is_recorded: bool, is_time_dependent: bool, has_proximity: bool
) -> Iterator[ContactBatch]:
    """Yield the contacts of a state without a variation, and with one variation at a time.

    is_recorded: whether the contacts were recorded with the hand. is_time_dependent: whether to vary the durations,
    for effects that depend on time. has_proximity: whether to add contacts without touch, for a proximity effect.
    """
    single = _select_one_contact(state)
    contacts = tuple(PlannedContact(*condition, is_recorded=is_recorded) for condition in single.pair.conditions)

    def vary(state: State, **changes: Any) -> ContactBatch:
        """Return the batch of all contacts with the given fields of `PlannedContact` changed, simulated by `state`."""
        return ContactBatch(tuple(replace(contact, **changes) for contact in contacts), state)

    yield ContactBatch(contacts, single, is_repeat=is_recorded)
    if single.base.force is not None:
        for scale in FORCE_FACTORS:
            yield vary(_scale_force(single, scale), force_scale=scale)
    if is_time_dependent:
        closing = single.time_grid.phase == Phase.CLOSING
        duration_s = float(single.time_grid.end[closing].max(initial=0.0))
        if duration_s > 0.0:
            yield vary(_stretch_phase(single, Phase.CLOSING, SLOW_CLOSING_FACTOR), closing_scale=SLOW_CLOSING_FACTOR)
        if duration_s / FAST_CLOSING_FACTOR >= MIN_CLOSING_FRAMES * single.pair.frame_s:
            yield vary(
                _stretch_phase(single, Phase.CLOSING, 1.0 / FAST_CLOSING_FACTOR),
                closing_scale=1.0 / FAST_CLOSING_FACTOR,
            )
        yield vary(_stretch_phase(single, Phase.HOLD, LONG_HOLD_FACTOR), hold_scale=LONG_HOLD_FACTOR)
    if has_proximity and single.base.separation is not None:
        yield vary(_hold_at_distance(single), apart_mm=1e3 * HELD_DISTANCE_M)


def _select_one_contact(state: State) -> State:
    """Return the state reduced to the first simulated contact of each condition."""
    first_contacts = np.array(
        [np.flatnonzero(state.condition == condition)[0] for condition in range(len(state.pair.conditions))]
    )
    base = state.base.map_arrays(lambda values: values[first_contacts])
    return State(
        state.pair, state.layout, state.time_grid, state.condition[first_contacts], base, state.mean, state.shift_s
    )


def _replace_signal(state: State, base: Signal) -> State:
    """Return the state with another signal, and with the features that this signal predicts."""
    return State(
        state.pair, state.layout, state.time_grid, state.condition, base, state.predict_features(base), state.shift_s
    )


def _scale_force(state: State, scale: float) -> State:
    """Return the state with all forces and penetration depths times `scale`, at a constant contact area."""
    force, separation = state.base.force, state.base.separation
    assert force is not None
    depth = None if separation is None else np.where(separation < 0.0, scale * separation, separation)
    return _replace_signal(state, replace(state.base, force=scale * force, separation=depth))


def _hold_at_distance(state: State) -> State:
    """Return the state without force, with the nearest taxel in hold at `HELD_DISTANCE_M` from the object.

    The motion of the object is the same, displaced by a constant distance.
    """
    separation = state.base.separation
    assert separation is not None
    hold_separation = separation[:, state.time_grid.phase == Phase.HOLD]
    distant_separation = np.where(
        separation < MISS_SEPARATION_M,
        separation - hold_separation.min(axis=(1, 2))[:, None, None] + HELD_DISTANCE_M,
        separation,
    )
    force = None if state.base.force is None else np.zeros_like(state.base.force)
    return _replace_signal(state, replace(state.base, force=force, separation=distant_separation))


def _stretch_phase(state: State, phase: Phase, factor: float) -> State:
    """Return the state with a phase that lasts `factor` times as long, with the same signals at the stretched times."""
    time_grid = state.time_grid
    scale = np.where(time_grid.phase == phase, factor, 1.0)
    return replace(
        state, time_grid=TimeGrid(time_grid.phase, scale * time_grid.begin, scale * time_grid.end, time_grid.bins)
    )
