"""The twin: a stream of poll cycles, compared with the reference step by step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS
from taxel.signal.rest_level import RestLevel
from taxel.twin.cleared import ClearedTest
from taxel.twin.detector import ChangeDetector, Hypothesis
from taxel.twin.events import Alarm, Cleared, Event, InputFault
from taxel.twin.live_session import LiveSession
from taxel.twin.missing_frames import MissingFrames
from taxel.twin.null_model import compute_log_ratios, fit_null_models
from taxel.twin.onset import StepHistory
from taxel.twin.reference import ConditionReference, Reference, compute_signals
from taxel.twin.schedule import Condition, Contact, ContactSchedule
from taxel.twin.sizes import compute_size
from taxel.twin.statistics import (
    OF_CONDITIONS,
    OF_CONTACTS,
    QUANTITIES,
    Scores,
    compute_contact_scores,
    compute_missing,
    compute_rest_scores,
    sum_over_places,
)
from taxel.twin.steps import BINS, HOLD, Step, StepBuilder
from taxel.twin.unannounced import UnannouncedContacts
from taxel.twin.variance_factors import VarianceFactors
from taxel.types import BoolArray, CountArray, FloatArray

HOURS_PER_FALSE_ALARM: Final = 24.0
"""Default mean time to a false alarm of the whole skin, hours."""

BACKWARDS_S: Final = 1.0
"""Step back of the time of a stream from which it counts as another clock, seconds; poll cycles may be out of order by
less than a cycle."""


@dataclass(frozen=True, eq=False)
class StepResult:
    """Results of one step. signals: f64[BINS, n], counts, of a contact; None otherwise. estimates: of each place, by
    quantity. evidence: sum of the statistics of the detector, an alarm from 1. touched: bool[n], unannounced contact.
    events: in order of time.
    """

    step: Step
    signals: FloatArray | None
    estimates: Scores
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
        self._excluded = np.zeros(n, dtype=bool)

    def take(self, time_s: FloatArray, raw_counts: CountArray, valid: BoolArray) -> list[StepResult]:
        """Add poll cycles; return the results of the steps that ended.

        time_s: f64[T], seconds. raw_counts: u16[T, n]. valid: bool[T, s].
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

    @property
    def contact(self) -> Contact | None:
        """The announced contact of the current step."""
        return self._builder.contact

    def finish(self) -> list[StepResult]:
        """Return the results of the steps that end with the stream."""
        return [self._process(step) for step in self._builder.finish()]

    def _restart(self, time_s: float) -> StepResult:
        """Continue after a step back of the clock: the steps so far are kept, the current step is discarded."""
        message = f"the clock steps back from {self._newest_s:.3f} s to {time_s:.3f} s; the current step is discarded "
        message += "and announced contacts are ignored; restart the twin with contacts on the new clock"
        fault = InputFault(time_s, "clock", message)
        own = self.reference
        self._builder = StepBuilder(self.schedule, own.places.board, own.sensors.s, own.baseline_s)
        self._builder.skip_announced()
        self._newest_s, self._last_step_s, self._last_alarm_s = time_s, None, -np.inf
        self.history = StepHistory(self.reference.places)
        empty = Step.empty(time_s, self.reference.taxels.n, self.reference.sensors.s)
        return StepResult(empty, None, {}, 0.0, np.zeros(self.reference.taxels.n, bool), (fault,))

    def _process(self, step: Step) -> StepResult:
        """Test one step."""
        pressed, near = self.unannounced.find_pressed(step)
        scores, touched = compute_rest_scores(step, self.level, self.noise, self._excluded, near)
        touched = touched | pressed
        signals = None
        novelty = self._compute_novelty(step)
        if step.contact is not None:
            found = compute_contact_scores(step, self.reference, self.live, self._excluded | touched)
            if found is not None:
                scores.update(found[0])
                own = self.reference.conditions[step.contact.condition]
                self.live.add(step.contact.condition, own.mean, np.where(touched, np.nan, found[1]))
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
        events: list[Event] = list(self._find_cleared(step, touched, elapsed))
        if evidence >= 1.0 and (alarm := self._raise_alarm(step)) is not None:
            events.append(alarm)
        return StepResult(step, signals, estimates, evidence, touched, tuple(events))

    def _compute_novelty(self, step: Step) -> FloatArray:
        """Variance of the expectation of each place beyond the usual one, relative to that of a contact, f64[P]."""
        places = self.reference.places
        if step.contact is None or step.contact.condition not in self.reference.conditions:
            return np.zeros(len(places))
        own = self.reference.conditions[step.contact.condition]
        _, factor = self.live.predict(step.contact.condition, own.mean, own.repeats)
        usual = 1.0 + self.reference.session_ratio[HOLD].mean() + 1.0 / own.repeats
        members = places.members
        mean = (members @ factor[HOLD].mean(axis=0)) / np.diff(members.indptr)
        return np.asarray(np.maximum(mean - usual, 0.0))

    def _compute_ratios(self, estimates: Scores, condition: Condition | None) -> dict[str, FloatArray]:
        """Log likelihood ratios by quantity."""
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
        """Create the alarm of the hypothesis with the largest evidence, and expect the new state from now on.

        A further change of the response of a board whose response has changed already gives no alarm: a fault such as a
        weak supply changes each contact in another way.
        """
        hypothesis = self.detector.find_largest()
        if QUANTITIES[hypothesis.quantity].name == "missing":
            onset_s, interval = step.start_s, (step.start_s, step.end_s)
            amplitude = hypothesis.amplitude
        else:
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
        """Whether active alarms report a changed response of all boards of a changed response."""
        if QUANTITIES[hypothesis.quantity].name not in OF_CONTACTS:
            return False
        board, boards = self.reference.places.board, self.reference.sensors.s
        covered = np.zeros(boards, dtype=bool)
        for test in self.active.values():
            if QUANTITIES[test.hypothesis.quantity].name in OF_CONTACTS:
                covered |= np.bincount(board, self._find_members(test.hypothesis.place), boards) > 0
        own = np.bincount(board, self._find_members(hypothesis.place), boards) > 0
        return bool(covered[own].all())

    def _adopt(self, step: Step, hypothesis: Hypothesis) -> None:
        """Expect the changed state of a place from now on, so that further changes are found."""
        taxels = self._find_members(hypothesis.place)
        if QUANTITIES[hypothesis.quantity].name == "missing":
            self.missing.set_share(hypothesis.place, *compute_missing(step, self.reference))
            return
        self.noise.forget(taxels)
        # The whole board: its other taxels may have changed less, and a change of some disturbs the common change.
        boards = np.bincount(self.reference.places.board, taxels, self.reference.sensors.s) > 0
        board = boards[self.reference.places.board]
        self.live.relearn(board)
        self.level.forget(board)

    def _find_members(self, place: int) -> BoolArray:
        """Taxels of a place, bool[n]."""
        return self.reference.places.find_members(self.reference.places.places[place])

    def _find_cleared(self, step: Step, touched: BoolArray, elapsed_s: float) -> list[Cleared]:
        """Alarms whose quantity agrees with the reference again."""
        if not self.active:
            return []
        estimates = self._compare_with_original(step, touched)
        condition = step.contact.condition if step.contact is not None else None
        cleared = []
        for number, test in list(self.active.items()):
            name = QUANTITIES[test.hypothesis.quantity].name
            if name in OF_CONTACTS and not self._is_loaded(step, test.hypothesis.place):
                continue  # a change of the response shows only where there is a response
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
        if step.contact is None or step.contact.condition not in self.reference.conditions:
            return False
        expected = self.reference.conditions[step.contact.condition].mean[HOLD].mean(axis=0)
        board = self.reference.places.board
        boards = np.bincount(board, self._find_members(place), self.reference.sensors.s) > 0
        return bool((expected > ACTIVE_SIGNAL_COUNTS)[boards[board]].any())

    def _compare_with_original(self, step: Step, touched: BoolArray) -> Scores:
        """Estimates of the places relative to the reference, without what the session has added."""
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


def make_rest_level(reference: Reference) -> RestLevel:
    """Create the tracked counts at rest of a new session: the loadings are known, the levels are not."""
    own = reference.rest_level
    return RestLevel(
        own.noise_variance, own.board, own.loading.copy(), own.loading_variance.copy(), settings=own.settings
    )


def fit_reference_models(reference: Reference, progress: Callable[[int, int], None] | None = None) -> VarianceFactors:
    """Fit the distributions without fault: each contact of the reference is compared with the others."""
    samples: list[tuple[Condition | None, Scores]] = []
    session_level: tuple[int, RestLevel] | None = None
    noise = reference.noise_level
    n = reference.taxels.n
    none = np.zeros(n, dtype=bool)
    for number, (session, step) in enumerate(reference.steps):
        if session_level is None or session_level[0] != session:
            session_level = (session, make_rest_level(reference))
        scores, _ = compute_rest_scores(step, session_level[1], noise.copy(), none)
        found = compute_contact_scores(step, _leave_out(reference, step), LiveSession.start(np.zeros(BINS), n), none)
        scores.update(found[0] if found else {})
        condition = step.contact.condition if step.contact is not None else None
        samples.append((condition, sum_over_places(scores, reference)))
        if progress is not None:
            progress(number + 1, len(reference.steps))
    models = fit_null_models([scores for _, scores in samples], reference.places.level)
    return VarianceFactors.learn(samples, models, reference.places.level)


def _leave_out(reference: Reference, step: Step) -> Reference:
    """The reference without one of its contacts."""
    if step.contact is None:
        return reference
    own = reference.conditions[step.contact.condition]
    if own.repeats < 2:
        return reference
    deviation = np.nan_to_num(compute_signals(step)) - own.mean
    others = own.repeats - 1
    others_only = ConditionReference(
        own.mean - deviation / others,
        np.maximum(own.squares - deviation**2 * own.repeats / others, 0.0),
        others,
        own.scale,
    )
    return replace(reference, conditions={step.contact.condition: others_only})
