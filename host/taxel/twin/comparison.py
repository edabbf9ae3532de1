"""The twin: a stream of poll cycles, compared with the reference step by step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS
from taxel.twin.cleared import ClearedTest
from taxel.twin.detector import ChangeDetector, Hypothesis
from taxel.twin.events import Alarm, Cleared, Event, InputFault
from taxel.twin.live_session import LiveSession
from taxel.twin.missing_frames import MissingFrames
from taxel.twin.null_model import compute_log_ratios
from taxel.twin.onset import StepHistory
from taxel.twin.reference import Reference, compute_signals
from taxel.twin.reference_models import fit_reference_models, make_rest_level
from taxel.twin.schedule import Condition, Contact, ContactSchedule
from taxel.twin.sizes import compute_size
from taxel.twin.statistics import (
    OF_CONDITIONS,
    OF_CONTACTS,
    QUANTITIES,
    Estimates,
    compute_contact_scores,
    compute_missing,
    compute_rest_scores,
    sum_over_places,
)
from taxel.twin.steps import BEFORE, HOLD, Step, StepBuilder
from taxel.twin.unannounced import UnannouncedContacts
from taxel.twin.variance_factors import VarianceFactors
from taxel.types import BoolArray, CountArray, FloatArray

HOURS_PER_FALSE_ALARM: Final = 24.0
"""Default mean time to a false alarm of the whole skin, hours."""

BACKWARDS_S: Final = 1.0
"""Step back of a stream's time from which the stream is treated as running on another clock, seconds. Poll cycles may
be out of order by less than a cycle."""


@dataclass(frozen=True, eq=False)
class StepResult:
    """Results of one step.

    signals: f64[BINS, n], counts, signals of the step's contact; None for a step without contact. estimates: estimated
    changes at all places, by quantity. evidence: sum of the detector's statistics; an alarm is raised from 1. touched:
    bool[n], taxels in an unannounced contact. events: events of the step, in order of time.
    """

    step: Step
    signals: FloatArray | None
    estimates: Estimates
    evidence: float
    touched: BoolArray
    events: tuple[Event, ...]


class Twin:
    """Compares a stream with a reference.

    `take` accepts the poll cycles of the stream and returns the results of the steps that have ended. The results
    depend only on the frames and the schedule, not on how the frames arrive.
    """

    def __init__(
        self,
        reference: Reference,
        schedule: ContactSchedule,
        hours_per_false_alarm: float = HOURS_PER_FALSE_ALARM,
        factors: VarianceFactors | None = None,
    ) -> None:
        """Create a twin. factors: result of `fit_reference_models`; None: fit the models."""
        self.reference = reference
        self.schedule = schedule
        self.factors = factors or fit_reference_models(reference)
        self.models = self.factors.models
        places = reference.places
        n = reference.taxels.n
        self.detector = ChangeDetector(places, hours_per_false_alarm)
        self.history = StepHistory(places)
        self.live = LiveSession.start(reference.session_ratio, n)
        self.level = make_rest_level(reference)
        self.unannounced = UnannouncedContacts(reference.noise_variance, reference.places.board)
        self.missing = MissingFrames.learn(reference)
        self.noise = reference.noise_level.copy()
        self.alarms: list[Alarm] = []
        self.active: dict[int, ClearedTest] = {}
        self._hours = hours_per_false_alarm
        self._builder = StepBuilder(schedule, places.board, reference.sensors.s, reference.baseline_s)
        self._newest_s = -np.inf
        self._last_step_s: float | None = None
        self._last_alarm_s = -np.inf
        self._exchanged = np.zeros(n, dtype=bool)
        """Taxels of boards that were exchanged during the current step, which are not compared in this step."""

    def take(self, time_s: FloatArray, raw_counts: CountArray, valid: BoolArray) -> list[StepResult]:
        """Add poll cycles; return the results of the steps that ended.

        time_s: f64[T], seconds. raw_counts: u16[T, n] of n taxels. valid: bool[T, s], whether each of the s boards
        delivered its frame. A step back of the clock gives one result with an `InputFault`.
        """
        results: list[StepResult] = []
        start = 0
        back = np.flatnonzero(np.diff(time_s, prepend=self._newest_s) < -BACKWARDS_S)
        for row in [*back.tolist(), len(time_s)]:
            part = slice(start, row)
            if row > start:
                ordered = np.maximum.accumulate(np.maximum(time_s[part], self._newest_s))
                results += [self._process(step) for step in self._builder.take(ordered, raw_counts[part], valid[part])]
                self._newest_s = float(ordered[-1])
            if row < len(time_s):
                results.append(self._restart(float(time_s[row])))
            start = row
        return results

    def exchange_board(self, board: int) -> None:
        """Learn signals, noise and rest level of a board anew from the next steps, after the board was exchanged.

        The board is not compared in the current step. board: index of the board, from 0.
        """
        self._exchanged |= self.reference.places.board == board
        self._relearn(self._exchanged)

    def begin_session(self, time_s: float) -> list[StepResult]:
        """Begin a new session, which has other counts without contact and other deviations from the reference.

        Returns the results of the steps that have ended by `time_s`, seconds, the time of the session's first frame.
        """
        results = [self._process(step) for step in self._builder.advance(time_s)]
        self.level.forget(np.ones(self.reference.taxels.n, dtype=bool))
        self.live.begin()
        self.unannounced = UnannouncedContacts(self.reference.noise_variance, self.reference.places.board)
        return results

    def _relearn(self, taxels: BoolArray) -> None:
        """Discard what the session has learnt about the taxels bool[n]."""
        self.noise.forget(taxels)
        self.live.relearn(taxels)
        self.level.forget(taxels)

    @property
    def contact(self) -> Contact | None:
        """The announced contact of the current step; None outside a contact."""
        return self._builder.contact

    def compute_baseline(self) -> FloatArray:
        """Return the raw count without contact at the newest time, f64[n], counts.

        During a contact this is the mean count before the contact. Otherwise, and for a taxel without frames before the
        contact, it is the tracked count, or the count of the reference if no count is tracked yet.
        """
        level = np.where(self.level.is_known, self.level.level, self.reference.rest)
        step = self._builder.current
        if step is None or step.contact is None:
            return np.asarray(level)
        before = step.compute_means()[BEFORE]
        return np.asarray(np.where(np.isfinite(before), before, level))

    def finish(self) -> list[StepResult]:
        """Return the results of the steps that end with the stream."""
        return [self._process(step) for step in self._builder.finish()]

    def _restart(self, time_s: float) -> StepResult:
        """Continue after a step back of the clock to `time_s`; return an empty result with the fault of the input.

        The current step and the history are discarded, and all contacts announced so far are ignored.
        """
        message = f"the clock steps back from {self._newest_s:.3f} s to {time_s:.3f} s; the current step is discarded "
        message += "and announced contacts are ignored; restart the twin with contacts on the new clock"
        fault = InputFault(time_s, "clock", message)
        reference = self.reference
        self._builder = StepBuilder(self.schedule, reference.places.board, reference.sensors.s, reference.baseline_s)
        self._builder.skip_announced()
        self._newest_s, self._last_step_s, self._last_alarm_s = time_s, None, -np.inf
        self.history = StepHistory(self.reference.places)
        empty = Step.empty(time_s, self.reference.taxels.n, self.reference.sensors.s)
        return StepResult(empty, None, {}, 0.0, np.zeros(self.reference.taxels.n, bool), (fault,))

    def _process(self, step: Step) -> StepResult:
        """Test one complete step: update the tracked state, the detector and the alarms; return the results."""
        pressed, on_pressed_board = self.unannounced.find_pressed(step)
        scores, touched = compute_rest_scores(step, self.level, self.noise, self._exchanged, on_pressed_board)
        touched = touched | pressed
        signals = None
        novelty = self._compute_novelty(step)
        if step.contact is not None:
            known = self.reference.expect(step)
            found = compute_contact_scores(step, self.reference, self.live, self._exchanged | touched)
            if found is not None and known is not None:
                scores.update(found[0])
                self.live.add(step.contact.condition, known.mean, np.where(touched, np.nan, found[1]))
            signals = compute_signals(step)
        condition = step.contact.condition if step.contact is not None else None
        estimates = self.factors.apply(sum_over_places(scores, self.reference), condition, novelty)
        ratios = self._compute_ratios(estimates, condition)
        missing, expected = compute_missing(step, self.reference)
        ratios["missing"] = self.missing.compute_log_ratios(missing, expected)
        self.history.add(step.start_s, step.end_s, estimates)
        elapsed = step.end_s - (self._last_step_s if self._last_step_s is not None else step.start_s)
        self._last_step_s = step.end_s
        evidence = self.detector.update(elapsed, ratios)
        if self._exchanged.any():  # the step contains frames of both boards, which must not define the new board
            self._relearn(self._exchanged)
            self._exchanged[:] = False
        events: list[Event] = list(self._find_cleared(step, touched, elapsed))
        if evidence >= 1.0 and (alarm := self._raise_alarm(step)) is not None:
            events.append(alarm)
        return StepResult(step, signals, estimates, evidence, touched, tuple(events))

    def _compute_novelty(self, step: Step) -> FloatArray:
        """Compute the excess variance of each place's expected signal, relative to the variance of a contact, f64[P].

        It is above 0 for places that the session is learning again after an alarm, and 0 for a step without a contact
        of the reference's conditions.
        """
        places = self.reference.places
        known = self.reference.expect(step)
        if step.contact is None or known is None:
            return np.zeros(len(places))
        _, factor = self.live.predict(step.contact.condition, known.mean, known.repeats)
        # Relative variance of the first contact of a condition in a session, without an alarm before.
        usual = 1.0 + self.reference.session_ratio[HOLD].mean() + 1.0 / known.repeats
        members = places.members
        # Mean over the taxels of each place; the differences of `indptr` are their numbers.
        mean = (members @ factor[HOLD].mean(axis=0)) / np.diff(members.indptr)
        return np.asarray(np.maximum(mean - usual, 0.0))

    def _compute_ratios(self, estimates: Estimates, condition: Condition | None) -> dict[str, FloatArray]:
        """Compute the log likelihood ratios of all alternatives (see `compute_log_ratios`), by name of the quantity."""
        return {
            quantity.name: compute_log_ratios(
                quantity,
                estimates[quantity.name],
                self.models[quantity.name],
                self.reference.places.level,
                self.factors.get_repeats(quantity.name, condition),
            )
            for quantity in QUANTITIES
            if quantity.name in estimates
        }

    def _raise_alarm(self, step: Step) -> Alarm | None:
        """Create the alarm of the hypothesis with the largest evidence; expect the changed state from now on.

        Returns None if active alarms already report a changed response of the same boards: a fault such as a weak
        supply changes each contact in another way, and must not raise an alarm for each. The detector starts again in
        both cases.
        """
        hypothesis = self.detector.find_largest()
        if QUANTITIES[hypothesis.quantity].name == "missing":
            onset_s, interval = step.start_s, (step.start_s, step.end_s)
            amplitude = hypothesis.amplitude
        else:
            # The steps since a first estimate of the onset determine the place; the second estimate is for this place.
            first = self.history.estimate_onset(hypothesis, self.models, self._last_alarm_s)
            places = self.reference.places
            hypothesis = self.history.localise(hypothesis, self.models, places, first.time_s)
            onset = self.history.estimate_onset(hypothesis, self.models, self._last_alarm_s)
            onset_s, interval, amplitude = onset.time_s, (onset.low_s, onset.high_s), onset.amplitude
        quantity, place = QUANTITIES[hypothesis.quantity], self.reference.places.places[hypothesis.place]
        if self._is_covered(hypothesis):
            self._adopt(step, hypothesis)
            self.detector.reset()
            return None
        alarm = Alarm(
            len(self.alarms) + 1,
            step.end_s,
            place,
            quantity.name,
            amplitude,
            quantity.unit,
            compute_size(self.reference, quantity, hypothesis.place, amplitude),
            onset_s,
            interval,
            quantity.words,
        )
        self.alarms.append(alarm)
        self.active[alarm.number] = ClearedTest(
            alarm, hypothesis, 3600.0 * self._hours, step.contact.condition if step.contact is not None else None
        )
        self._adopt(step, hypothesis)
        self.detector.reset()
        self._last_alarm_s = step.end_s
        return alarm

    def _is_covered(self, hypothesis: Hypothesis) -> bool:
        """Whether active alarms already report a changed response to contact of all boards of the hypothesis.

        False for a quantity that is not measured in a contact.
        """
        if QUANTITIES[hypothesis.quantity].name not in OF_CONTACTS:
            return False
        board, boards = self.reference.places.board, self.reference.sensors.s
        covered = np.zeros(boards, dtype=bool)
        for test in self.active.values():
            if QUANTITIES[test.hypothesis.quantity].name in OF_CONTACTS:
                covered |= np.bincount(board, self._find_members(test.hypothesis.place), boards) > 0
        concerned = np.bincount(board, self._find_members(hypothesis.place), boards) > 0
        return bool(covered[concerned].all())

    def _adopt(self, step: Step, hypothesis: Hypothesis) -> None:
        """Expect the changed state of the hypothesis from now on, so that further changes are detected.

        For missing frames, the new share is set. Otherwise the session's noise of the place is discarded, and so are
        the signals and the rest level of all taxels on the boards of the place.
        """
        taxels = self._find_members(hypothesis.place)
        if QUANTITIES[hypothesis.quantity].name == "missing":
            self.missing.set_share(hypothesis.place, *compute_missing(step, self.reference))
            return
        self.noise.forget(taxels)
        # The whole board is learnt again: its other taxels may have changed less, and changed taxels distort the
        # estimate of the board's common drift.
        boards = np.bincount(self.reference.places.board, taxels, self.reference.sensors.s) > 0
        board = boards[self.reference.places.board]
        self.live.relearn(board)
        self.level.forget(board)

    def _find_members(self, place: int) -> BoolArray:
        """Return which taxels belong to a place, bool[n]. place: index in `Places`."""
        return self.reference.places.find_members(self.reference.places.places[place])

    def _find_cleared(self, step: Step, touched: BoolArray, elapsed_s: float) -> list[Cleared]:
        """Return an event for each alarm whose quantity agrees with the reference again.

        These alarms are no longer active, and their taxels are compared with the reference again. touched: bool[n],
        taxels in an unannounced contact, which are not compared. elapsed_s: seconds since the step before.
        """
        if not self.active:
            return []
        estimates = self._compare_with_original(step, touched)
        condition = step.contact.condition if step.contact is not None else None
        cleared = []
        for number, test in list(self.active.items()):
            name = QUANTITIES[test.hypothesis.quantity].name
            if name in OF_CONTACTS and not self._is_loaded(step, test.hypothesis.place):
                continue  # a contact on other boards contains no information on the response of these boards
            if name in OF_CONDITIONS and test.condition is not None and test.condition != condition:
                continue
            if test.update(estimates, self.models, self.reference.places.level, elapsed_s):
                del self.active[number]
                taxels = self._find_members(test.hypothesis.place)
                self.live.restore(self.reference.session_ratio, taxels)
                self.noise.squares[taxels] = self.reference.noise_level.squares[taxels]
                self.noise.pairs[taxels] = self.reference.noise_level.pairs[taxels]
                cleared.append(Cleared(step.end_s, test.alarm))
        return cleared

    def _is_loaded(self, step: Step, place: int) -> bool:
        """Whether the contact of a step is expected to load the boards of a place."""
        known = self.reference.expect(step)
        if known is None:
            return False
        expected = known.mean[HOLD].mean(axis=0)
        board = self.reference.places.board
        boards = np.bincount(board, self._find_members(place), self.reference.sensors.s) > 0
        return bool((expected > ACTIVE_SIGNAL_COUNTS)[boards[board]].any())

    def _compare_with_original(self, step: Step, touched: BoolArray) -> Estimates:
        """Estimate the changes of a step at all places relative to the reference alone, without the session's updates.

        touched: bool[n], taxels that are not compared in a contact. The quantity "rest" is left out.
        """
        n = self.reference.taxels.n
        noise = self.reference.noise_level.copy()
        scores, _ = compute_rest_scores(step, make_rest_level(self.reference), noise, np.zeros(n, bool))
        del scores["rest"]  # a count at rest has no reference value: it drifts
        found = compute_contact_scores(
            step, self.reference, LiveSession.start(self.reference.session_ratio, n), touched
        )
        scores.update(found[0] if found else {})
        condition = step.contact.condition if step.contact is not None else None
        usual = np.zeros(len(self.reference.places))
        return self.factors.apply(sum_over_places(scores, self.reference), condition, usual)
