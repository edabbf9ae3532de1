"""Pressed and released events from a stream of frames."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from taxel.signal.activation import Activation
from taxel.types import BoolArray


@dataclass(frozen=True)
class ContactEvent:
    """One taxel changed.

    sample: index of the frame, counted from 0 at the first `update`, missing frames included.
    taxel: index of the taxel.
    kind: "pressed" or "released".
    """

    sample: int
    taxel: int
    kind: Literal["pressed", "released"]


class ActivationTracker:
    """Follows every taxel from frame to frame and reports its changes.

    A taxel starts inactive, so the first valid sample that is active is an event. While samples are missing
    the state is held: a change during a gap is reported at the first valid sample after it.

    active: bool[n], the state held.
    known: bool[n], whether a valid sample has come at all.
    suspect_baseline: bool[n], whether the raw count ever rose above the baseline by more than the
        threshold; this is how a touch that lasted through the whole baseline shows, once it is released.
    samples: frames so far.
    """

    def __init__(self, activation: Activation) -> None:
        self.activation = activation
        self.reset()

    def reset(self) -> None:
        """Back to sample 0 with every taxel inactive, unknown and not suspect."""
        n_taxels = self.activation.n_taxels
        self.samples = 0
        self.active: BoolArray = np.zeros(n_taxels, dtype=np.bool_)
        self.known: BoolArray = np.zeros(n_taxels, dtype=np.bool_)
        self.suspect_baseline: BoolArray = np.zeros(n_taxels, dtype=np.bool_)

    def update(self, raw_counts: npt.ArrayLike, valid: npt.ArrayLike | None = None) -> tuple[ContactEvent, ...]:
        """Take one frame and return its events, in the order of the taxels.

        raw_counts: u16[n]. valid: bool for the whole frame or bool[n]. Raises ValueError for a wrong shape
        or dtype; a frame that raises is not counted.
        """
        if np.ndim(raw_counts) != 1:
            raise ValueError(f"raw_counts: expected one frame of shape [n], found {np.ndim(raw_counts)} dimensions")
        frame = self.activation(raw_counts, valid)
        changed = ~frame.missing & (frame.active != self.active)
        events = tuple(
            ContactEvent(self.samples, taxel, "pressed" if frame.active[taxel] else "released")
            for taxel in np.flatnonzero(changed).tolist()
        )
        self.active = self.active ^ changed
        self.known = self.known | ~frame.missing
        self.suspect_baseline = self.suspect_baseline | frame.suspect_baseline
        self.samples += 1
        return events
