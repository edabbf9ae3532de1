"""Tracked baseline: it follows the temperature drift of a skin, and contacts do not move it."""

import numpy as np
import pytest

from taxel.signal import TrackedBaseline, compute_baseline

RATE_HZ = 20.0
TAXELS = 60
BOARD = np.repeat([0, 1], TAXELS // 2)  # number of the board of each taxel
NOISE = 2.0  # standard deviation of one frame, counts
BASELINE_FRAMES = 100  # frames of the first baseline (5 s), before the tracking starts
FOLLOWED = 5.0  # largest error of a tracked baseline without a lasting contact, counts
WARM_UP_S = 1000.0  # time constant of a drift that continues during the lasting contact
CONTACT_S = (400.0, 900.0)  # start and end of the lasting contact


class DriftingSkin:
    """Simulated skin of two boards whose counts at rest drift with the temperature.

    drift: mean change of a count at rest after a long time, counts. time_constant_s: time constant of the drift.
    signal: f64[TAXELS], counts by which the contact lowers each taxel; None: no contact. contact_s: start and end of
    the contact, seconds.
    """

    def __init__(self, seed, drift=100.0, time_constant_s=300.0, signal=None, contact_s=(np.inf, np.inf)):
        self.rng = np.random.default_rng(seed)
        self.counts_at_start = self.rng.uniform(2000.0, 4000.0, TAXELS)
        self.relative_drift = 1.0 + 0.3 * self.rng.standard_normal(TAXELS)
        self.drift, self.time_constant_s = drift, time_constant_s
        self.signal = np.zeros(TAXELS) if signal is None else signal
        self.contact_s = contact_s

    def compute_true_baseline(self, time_s):
        """Return f64[TAXELS]: the counts at rest, without noise and contact."""
        warmed = 1.0 - np.exp(-time_s / self.time_constant_s)
        return self.counts_at_start + self.drift * self.relative_drift * warmed

    def read_frame(self, time_s):
        """Return u16[TAXELS]: raw counts with noise, lowered by the signal during the contact."""
        is_touched = self.contact_s[0] <= time_s < self.contact_s[1]
        noise = NOISE * self.rng.standard_normal(TAXELS)
        return np.round(self.compute_true_baseline(time_s) - is_touched * self.signal + noise).astype(np.uint16)


def measure_first_baseline(skin):
    """Compute the baseline of `BASELINE_FRAMES` frames of the skin at time 0."""
    return compute_baseline(np.stack([skin.read_frame(0.0) for _ in range(BASELINE_FRAMES)]))


def track_until(skin, end_s):
    """Measure the first baseline from time 0, and track it until `end_s`.

    Return the tracked baseline and the number of corrections (calls of `update` that returned a state).
    """
    first = compute_baseline(np.stack([skin.read_frame(frame / RATE_HZ) for frame in range(BASELINE_FRAMES)]))
    tracked = TrackedBaseline(first.mean, first.noise, BOARD)
    corrections = 0
    for frame in range(BASELINE_FRAMES, int(end_s * RATE_HZ)):
        time_s = frame / RATE_HZ
        corrections += tracked.update(time_s, skin.read_frame(time_s)) is not None
    return tracked, corrections


def compute_largest_error(tracked, true_baseline):
    """Return the largest deviation of the tracked counts at rest from the true ones, counts."""
    return np.abs(tracked.state.mean - true_baseline).max()


def make_signal(covered_taxels, seed=3):
    """Return f64[TAXELS]: a contact on the first `covered_taxels` taxels, from 10 to 600 counts."""
    signal = np.zeros(TAXELS)
    signal[:covered_taxels] = np.random.default_rng(seed).uniform(10.0, 600.0, covered_taxels)
    return signal


def make_skin_with_lasting_contact(covered_taxels):
    """Simulate a warming skin with one contact of 500 s (`CONTACT_S`) on its first taxels."""
    return DriftingSkin(2, time_constant_s=WARM_UP_S, signal=make_signal(covered_taxels), contact_s=CONTACT_S)


def test_baseline_follows_a_drift_and_reports_no_contact():
    """The skin drifts by more than ten times the permitted error of the tracked baseline (`FOLLOWED`, 5 counts)."""
    end_s = 300.0
    skin = DriftingSkin(1)
    drifted = np.abs(skin.compute_true_baseline(end_s) - skin.counts_at_start).max()
    assert drifted > 10.0 * FOLLOWED
    tracked, _ = track_until(skin, end_s)
    assert compute_largest_error(tracked, skin.compute_true_baseline(end_s)) < FOLLOWED
    assert not tracked.state.is_contact.any()


def test_baseline_is_corrected_once_per_interval_of_one_second():
    _, corrections = track_until(DriftingSkin(1), 30.0)
    complete_intervals = 24  # from 5 s, the end of the first baseline, to 29 s; the last one is not complete
    assert corrections == complete_intervals


@pytest.mark.parametrize(("covered_taxels", "largest_error"), [(5, 20.0), (20, 20.0), (30, 60.0)])
def test_lasting_contact_stays_a_contact_and_does_not_enter_the_baseline(covered_taxels, largest_error):
    """Errors are in counts. Taxels 0 to 29 are on the first board.

    With 30 covered taxels, no free taxel shows the drift of this board during the contact: the baseline may then be
    wrong by the drift since the start of the contact.
    """
    end_s = CONTACT_S[1] - 10.0
    skin = make_skin_with_lasting_contact(covered_taxels)
    tracked, _ = track_until(skin, end_s)
    is_strong = skin.signal > 15.0 * NOISE  # above 30 counts; weaker signals may be detected later
    assert tracked.state.is_contact[is_strong].all()
    # `contact_s` is the time since the beginning of a contact, so the difference is the delay of its detection.
    found_after_s = end_s - CONTACT_S[0] - tracked.state.contact_s[is_strong]
    assert found_after_s.max() < 40.0
    assert compute_largest_error(tracked, skin.compute_true_baseline(end_s)) < largest_error


@pytest.mark.parametrize("covered_taxels", [5, 20, 30])
def test_baseline_is_correct_within_30_s_after_the_release_of_a_lasting_contact(covered_taxels):
    """The permitted error is twice that of a skin without a lasting contact (`FOLLOWED`, 5 counts)."""
    end_s = CONTACT_S[1] + 30.0
    skin = make_skin_with_lasting_contact(covered_taxels)
    tracked, _ = track_until(skin, end_s)
    assert compute_largest_error(tracked, skin.compute_true_baseline(end_s)) < 2.0 * FOLLOWED
    assert tracked.state.is_contact.sum() <= 2  # a few weak taxels may be released later


def test_baseline_measured_during_a_touch_is_corrected_within_10_s_after_its_release():
    touch_end_s = 10.0  # later than the end of the first baseline, after 5 s
    skin = DriftingSkin(4, drift=0.0, signal=make_signal(5), contact_s=(0.0, touch_end_s))
    tracked, _ = track_until(skin, touch_end_s + 10.0)
    assert compute_largest_error(tracked, skin.counts_at_start) < FOLLOWED  # permitted error: 5 counts


def test_repeated_contacts_do_not_move_the_baseline():
    skin = DriftingSkin(5, drift=0.0, signal=make_signal(20))
    first = measure_first_baseline(skin)
    tracked = TrackedBaseline(first.mean, first.noise, BOARD)
    for frame in range(4000):
        is_touched = frame // 60 % 2 == 1  # 3 s without contact, then 3 s with contact
        skin.contact_s = (0.0, np.inf) if is_touched else (np.inf, np.inf)
        tracked.update(frame / RATE_HZ, skin.read_frame(0.0))
    assert compute_largest_error(tracked, skin.counts_at_start) < FOLLOWED  # permitted error: 5 counts


def test_taxels_without_valid_frames_keep_their_baseline_and_report_no_contact():
    skin = DriftingSkin(6, drift=0.0)
    first = measure_first_baseline(skin)
    tracked = TrackedBaseline(first.mean, first.noise, BOARD)
    is_missing = np.arange(TAXELS) < 10
    for frame in range(600):
        raw = np.where(is_missing, 0, skin.read_frame(0.0)).astype(np.uint16)
        tracked.update(frame / RATE_HZ, raw, ~is_missing)
    assert compute_largest_error(tracked, skin.counts_at_start) < FOLLOWED  # permitted error: 5 counts
    assert not tracked.state.is_contact.any()


def test_step_back_of_the_clock_ends_the_interval_and_starts_a_new_one():
    skin = DriftingSkin(7, drift=0.0)
    first = measure_first_baseline(skin)
    tracked = TrackedBaseline(first.mean, first.noise)
    # `update` returns a state if its frame starts a new interval, and None if the frame belongs to the present one.
    assert tracked.update(100.0, skin.read_frame(0.0)) is None
    assert tracked.update(3.0, skin.read_frame(0.0)) is not None
    assert tracked.update(3.5, skin.read_frame(0.0)) is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"baseline_mean": np.full(3, np.nan), "noise": np.ones(3)}, "finite counts"),
        ({"baseline_mean": np.ones(3), "noise": np.ones(2)}, "noise"),
        ({"baseline_mean": np.ones(3), "noise": np.ones(3), "board": np.array([0, -1, 0])}, "board"),
        ({"baseline_mean": np.ones(3), "noise": np.ones(3), "interval_s": 0.0}, "interval_s"),
    ],
)
def test_wrong_array_or_interval_is_refused_with_the_name_of_its_argument(arguments, message):
    with pytest.raises(ValueError, match=message):
        TrackedBaseline(**arguments)


def test_time_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="time_s"):
        TrackedBaseline(np.ones(3), np.ones(3)).update(np.nan, np.ones(3, np.uint16))
