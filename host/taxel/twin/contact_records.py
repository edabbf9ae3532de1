"""Frames of the contacts of a stream, as records of a grasp dataset."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from taxel.recording.grasp_format import BASELINE_FRAMES, Phase
from taxel.recording.grasp_record import GraspRecord
from taxel.twin.schedule import Condition, Contact, ContactSchedule
from taxel.types import BoolArray, CountArray, FloatArray

SPARE_FRAMES = 20
"""Number of frames before a contact that a record contains beyond `BASELINE_FRAMES`: single boards may miss frames."""

Poses = Mapping[Condition, tuple[FloatArray, FloatArray]]
"""Nominal poses of the brackets f64[s, 4, 4] and of the object f64[4, 4] by condition."""


@dataclass(eq=False)
class ContactRecorder:
    """Collects the frames of announced contacts from poll cycles in order of time.

    poses: nominal poses by condition; contacts of conditions without poses are left out. The recorder never holds more
    than the frames of one contact and its baseline.
    """

    schedule: ContactSchedule
    poses: Poses
    _number: int = 0
    _last_s: float = -np.inf
    _parts: list[tuple[FloatArray, CountArray, BoolArray]] = field(default_factory=list)
    _occurrences: dict[Condition, int] = field(default_factory=dict)

    def take(self, time_s: FloatArray, raw_counts: CountArray, valid: BoolArray) -> list[tuple[Contact, GraspRecord]]:
        """Add poll cycles; return the contacts that are complete, with their records.

        time_s: f64[T], seconds. raw_counts: u16[T, n]. valid: bool[T, s], whether each board delivered its frame. After
        a step back of the clock, all contacts announced so far are left out.
        """
        done = []
        start = 0
        if time_s[0] < self._last_s or (np.diff(time_s) < 0.0).any():
            self._number, self._parts = len(self.schedule), []  # another clock: its contacts are not announced
            return []
        self._last_s = float(time_s[-1])
        while self._number < len(self.schedule):
            contact = self.schedule[self._number]
            end = int(np.searchsorted(time_s, contact.end_s))
            if end == len(time_s):
                break
            self._parts.append((time_s[start:end], raw_counts[start:end], valid[start:end]))
            record = self._make_record(contact)
            if record is not None:
                done.append((contact, record))
            self._number += 1
            self._parts = []
            start = end
        self._parts.append((time_s[start:].copy(), raw_counts[start:].copy(), valid[start:].copy()))
        self._forget_old()
        return done

    def _make_record(self, contact: Contact) -> GraspRecord | None:
        """Make the record of a contact from the collected frames.

        Returns None without poses of its condition, with fewer than `BASELINE_FRAMES` frames before the contact, or
        without a frame in the hold phase. Iteration and session count the contacts of the condition from 0.
        """
        if contact.condition not in self.poses:
            return None
        time_s, raw, valid = (np.concatenate([part[column] for part in self._parts]) for column in range(3))
        first = int(np.searchsorted(time_s, contact.start_s))
        begin = max(first - BASELINE_FRAMES - SPARE_FRAMES, 0)
        phase = np.array([contact.find_phase(time) for time in time_s[begin:].tolist()], np.uint8)
        if first - begin < BASELINE_FRAMES or not (phase == Phase.HOLD).any():
            return None
        number = self._occurrences.get(contact.condition, 0)
        self._occurrences[contact.condition] = number + 1
        brackets, item = self.poses[contact.condition]
        return GraspRecord(
            object=contact.condition[0],
            approach=contact.condition[1],
            iteration=number,
            session=number,
            timestamp=time_s[begin:],
            phase=phase,
            raw_counts=raw[begin:],
            valid=valid[begin:],
            sensor_pose=brackets,
            object_pose=item,
        )

    def _forget_old(self) -> None:
        """Delete all collected frames except those that the baseline of the next contact may need."""
        start = self.schedule[self._number].start_s if self._number < len(self.schedule) else np.inf
        kept, frames = [], 0
        for part in reversed(self._parts):
            if frames > BASELINE_FRAMES + SPARE_FRAMES and part[0].size and part[0][-1] < start:
                break
            kept.append(part)
            frames += len(part[0])
        self._parts = kept[::-1]
