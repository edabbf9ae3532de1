"""Estimator of distance and approach speed of a target in front of one board, frame by frame."""

from collections import deque
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from taxel.hand import Board, Hand
from taxel.proximity.calibration import KindCalibration
from taxel.proximity.drift_tracker import DriftTracker
from taxel.proximity.estimate import (
    NOT_IDENTIFIABLE,
    PRESENT_PROBABILITY,
    TARGET_PROBABILITY,
    UNKNOWN,
    ProximityEstimate,
    compute_contact_probability,
    compute_nearest_motion,
    summarise_distance,
    summarise_speed,
    summarise_time_to_contact,
)
from taxel.proximity.likelihood import WindowLikelihood
from taxel.proximity.motion_filter import MotionFilter
from taxel.proximity.motion_grid import get_transition
from taxel.proximity.skin_points import SkinPoints, compute_skin_points
from taxel.proximity.templates import make_window
from taxel.types import FloatArray

BASELINE_FRAMES = 40
"""Number of frames in the first baseline. Its error, a sixth of the noise, is corrected later by the drift tracker."""

NEIGHBOUR_RADIUS_M = 0.0075
"""Radius within which the signals around a taxel are averaged to locate the target: 3 x 3 taxels at a 5 mm pitch."""

SMOOTHING_TIME_S = 0.1
"""Time constant with which the neighbourhood means are smoothed that start the filter and select the window."""

START_LIMIT = 3.0
"""Largest neighbourhood mean, in standard deviations, at which the board is treated as idle. With a smaller value, the
filter is started more often without a target, which costs time; the filter decides whether there is a target."""

IDLE_PROBABILITY = 0.98
"""Probability of no target above which the filter stops, and the baseline follows the counts."""

OWN_SHARE = 0.75
"""Weight of a taxel's signal in its neighbourhood mean; its neighbours share the rest. The mean of the neighbours alone
is largest in the middle of a face instead of at the nearest taxel; the signal of one taxel alone is noisy."""

SWITCH_RATIO = 1.1
SWITCH_NOISE = 1.5
"""The window moves to another taxel if its neighbourhood mean exceeds the mean at the present centre times
`SWITCH_RATIO` by more than `SWITCH_NOISE` times the noise (chosen above the differences between taxels below the same
target, 3 to 6 %). With smaller values, the window moves more often, which restarts the estimation of the shape."""

MISFIT_LIMIT = 3.0
"""Mean squared residual of the best template, in units of its variance, above which no calibrated target fits. The
variance contains the errors of the templates, so that the mean is below 1 for a calibrated target."""

MISFIT_TIME_S = 0.3
"""Time constant over which the squared residual is averaged, seconds."""

STORED_FRAMES = 8
"""Number of frames before the start of the filter that the filter processes first: the signals of the first frames of
an approach are too small to start it, but determine the speed."""

CACHED_WINDOWS = 16
"""Number of windows whose predictions an estimator keeps, about 1.5 MB each."""


class BoardEstimator:
    """Estimates the target in front of one board from the frames of this board.

    The first `BASELINE_FRAMES` frames are the baseline, during which nothing may be near the board.
    """

    def __init__(self, hand: Hand, board: Board, calibration: KindCalibration, horizon_s: float) -> None:
        """Create an estimator. horizon_s: time after the arrival of a frame within which a contact is predicted."""
        self.board = board
        self.horizon_s = horizon_s
        self._calibration = calibration
        self._targets = list(calibration.targets)
        self._points = compute_skin_points(hand, board)
        self._neighbours = _make_neighbour_means(self._points)
        self._tracker = DriftTracker(
            board.kind.taxel_count, calibration.drift_counts, calibration.noise_counts, BASELINE_FRAMES
        )
        self._get_likelihood = lru_cache(maxsize=CACHED_WINDOWS)(self._make_likelihood)
        self._stored: deque[tuple[FloatArray, float]] = deque(maxlen=STORED_FRAMES)
        self._smooth = np.zeros(board.kind.taxel_count)
        self._filter: MotionFilter | None = None
        self._middle = _find_middle(self._points)
        self._centre = self._middle
        self._misfit = 0.0
        self._fit_of_target = np.zeros(len(self._targets))
        self._last_s: float | None = None

    @property
    def progress(self) -> float:
        """Completed share of the first baseline, 0 to 1."""
        return self._tracker.progress

    def update(self, time_s: float, raw_counts: npt.ArrayLike, age_s: float = 0.0) -> ProximityEstimate:
        """Process one frame and return the estimate at its time.

        time_s: start of the scan, seconds. raw_counts: [n] counts. age_s: time from the scan to the arrival of the
        frame, seconds, by which the horizon of the contact prediction is extended.
        """
        raw = np.asarray(raw_counts, dtype=np.float64)
        dt = 0.0 if self._last_s is None else max(time_s - self._last_s, 0.0)
        self._last_s = time_s
        if self._tracker.baseline is None:
            self._tracker.start(raw)
            return self._make_estimate(time_s, age_s)
        signal = self._tracker.advance(dt) - raw
        self._locate(signal, dt)
        self._stored.append((signal, dt))
        if self._filter is None and self._is_idle():
            self._tracker.follow(raw, dt)
            self._centre = self._middle
            return self._make_estimate(time_s, age_s)
        if self._filter is None:
            # The filter first processes the earlier frames of the same window of taxels, which determine the speed.
            self._centre = int(np.argmax(np.abs(self._smooth)))
            for earlier, interval in list(self._stored)[:-1]:
                self._filter_frame(earlier, interval)
        self._filter_frame(signal, dt)
        if self._filter is not None and self._filter.far > IDLE_PROBABILITY:
            self._tracker.follow(raw, dt)
            if self._is_idle():
                self._filter = None
        return self._make_estimate(time_s, age_s)

    def _locate(self, signal: FloatArray, dt_s: float) -> None:
        """Smooth the neighbourhood means over time, and select the taxel at the centre of the window.

        The centre moves to the taxel with the largest mean if this mean is clearly larger than the mean at the present
        centre.
        """
        share = float(-np.expm1(-dt_s / SMOOTHING_TIME_S))
        self._smooth += share * (self._neighbours @ signal - self._smooth)
        size = np.abs(self._smooth)
        largest = int(np.argmax(size))
        noise = self._calibration.noise_counts
        if size[largest] > SWITCH_RATIO * size[self._centre] + SWITCH_NOISE * noise:
            self._centre = largest
            if self._filter is not None:
                self._filter.forget_shape()

    def _is_idle(self) -> bool:
        """Whether noise and drift explain all neighbourhood means, so that no target needs to be assumed."""
        noise = self._calibration.noise_counts**2 * (self._neighbours**2).sum(axis=1)
        variance = noise + self._tracker.offset_counts**2
        return bool((np.abs(self._smooth) < START_LIMIT * np.sqrt(variance)).all())

    def _make_likelihood(self, centre: int) -> tuple[WindowLikelihood, FloatArray]:
        """Make the likelihood of the window around the taxel `centre`, and the prior f64[K] of targets and
        templates.
        """
        window = make_window(self._points, centre)
        responses = [self._calibration.targets[name] for name in self._targets]
        likelihood = WindowLikelihood(window, self._calibration, responses)
        return likelihood, np.tile(window.weight, len(responses))

    def _filter_frame(self, signal: FloatArray, dt_s: float) -> None:
        """Advance the filter by one frame, and update the misfits; create the filter if it does not exist.

        signal: f64[n], counts. dt_s: time since the frame before. The misfit is the squared residual per taxel of the
        best hypothesis, in variances, averaged over `MISFIT_TIME_S`.
        """
        likelihood, prior = self._get_likelihood(self._centre)
        if self._filter is None:
            self._filter = MotionFilter(prior)
            self._misfit = 0.0
            self._fit_of_target = np.zeros(len(self._targets))
        self._filter.predict(get_transition(dt_s))
        part, offset = signal[likelihood.taxels], self._tracker.offset_counts
        values, absent, contact = likelihood.evaluate(part, offset)
        self._filter.update(values, absent, contact)
        squares = -2.0 * max(float(values.max()), absent) / len(part)
        share = float(-np.expm1(-dt_s / MISFIT_TIME_S))
        self._misfit += share * (squares - self._misfit)
        self._fit_of_target += share * (values.reshape(len(self._targets), -1).max(axis=1) - self._fit_of_target)

    def _make_estimate(self, time_s: float, age_s: float) -> ProximityEstimate:
        """Summarise the state of the filter as the estimate of the frame at `time_s`; no target without a filter."""
        state, horizon = self._filter, self.horizon_s + age_s
        present = 0.0 if state is None else float(state.present.sum())
        is_present = state is not None and present > PRESENT_PROBABILITY
        targets = {} if state is None else self._compute_targets()
        motion = None if state is None else compute_nearest_motion(state)
        return ProximityEstimate(
            address=self.board.address,
            board=self.board.name,
            time_s=time_s,
            is_ready=self._tracker.baseline is not None,
            present=present,
            contact=0.0 if state is None else state.contact,
            distance_m=summarise_distance(motion) if motion is not None and is_present else None,
            speed_m_s=summarise_speed(motion) if motion is not None and is_present else None,
            contact_soon=0.0
            if motion is None or state is None
            else compute_contact_probability(motion, state.contact, horizon),
            horizon_s=horizon,
            time_to_contact_s=summarise_time_to_contact(motion) if motion is not None and is_present else None,
            targets=targets if is_present else {},
            target=self._name_target(targets) if is_present else None,
            centre=self._centre if is_present else None,
        )

    def _compute_targets(self) -> dict[str, float]:
        """Compute the probabilities of the calibrated targets, given that one of them is present.

        The probabilities follow from the mean log-likelihood of a frame, not from the sum over the frames. The errors
        of the modelled shapes are the same in every frame, so that a sum would turn a small difference of two shapes
        into certainty about the target.
        """
        weight = np.exp(self._fit_of_target - self._fit_of_target.max())
        return dict(zip(self._targets, (weight / weight.sum()).tolist(), strict=True))

    def _name_target(self, targets: dict[str, float]) -> str:
        """Return the name of the most probable target, or "unknown" or "not identifiable" (see `ProximityEstimate`)."""
        if self._misfit > MISFIT_LIMIT:
            return UNKNOWN
        name = max(targets, key=lambda each: targets[each])
        return name if targets[name] > TARGET_PROBABILITY and len(targets) > 1 else NOT_IDENTIFIABLE


def _make_neighbour_means(points: SkinPoints) -> FloatArray:
    """Make the matrix f64[n, n] that averages the signal of each taxel and of its neighbours with a similar normal.

    Similar normals differ by less than 60 degrees. The taxel itself has the weight `OWN_SHARE`.
    """
    distance = np.linalg.norm(points.centre[:, None] - points.centre[None], axis=2)
    near = (distance <= NEIGHBOUR_RADIUS_M) & (points.normal @ points.normal.T > 0.5)
    np.fill_diagonal(near, False)
    mean = near / np.maximum(near.sum(axis=1, keepdims=True), 1)
    return np.asarray(OWN_SHARE * np.eye(len(near)) + (1.0 - OWN_SHARE) * mean)


def _find_middle(points: SkinPoints) -> int:
    """Return the index of the taxel nearest to the middle of a board."""
    return int(np.argmin(np.linalg.norm(points.centre - points.centre.mean(axis=0), axis=1)))
