"""Tracked baseline: drift is followed, contacts are not."""

import numpy as np
import pytest

from taxel.signal import TrackedBaseline, compute_baseline

RATE_HZ = 20.0
N = 60
BOARD = np.repeat([0, 1], N // 2)
NOISE = 2.0


class Skin:
    """A skin of two boards with temperature drift. signal: f64[n], counts, during the contact."""

    def __init__(self, seed, drift=100.0, seconds=300.0, signal=None, contact_s=(np.inf, np.inf)):
        self.rng = np.random.default_rng(seed)
        self.rest = self.rng.uniform(2000.0, 4000.0, N)
        self.loading = 1.0 + 0.3 * self.rng.standard_normal(N)
        self.drift, self.seconds = drift, seconds
        self.signal = np.zeros(N) if signal is None else signal
        self.contact_s = contact_s

    def truth(self, time_s):
        return self.rest + self.drift * self.loading * (1.0 - np.exp(-time_s / self.seconds))

    def frame(self, time_s):
        touched = self.contact_s[0] <= time_s < self.contact_s[1]
        noise = NOISE * self.rng.standard_normal(N)
        return np.round(self.truth(time_s) - touched * self.signal + noise).astype(np.uint16)


def follow(skin, end_s):
    """Run the baseline to `end_s`; return it and the number of states."""
    first = compute_baseline(np.stack([skin.frame(number / RATE_HZ) for number in range(100)]))
    tracked = TrackedBaseline(first.mean, first.noise, BOARD)
    states = 0
    for number in range(100, int(end_s * RATE_HZ)):
        time_s = number / RATE_HZ
        states += tracked.update(time_s, skin.frame(time_s)) is not None
    return tracked, states


def make_signal(covered, seed=3):
    """Signals of a contact on the first `covered` taxels, from 10 to 600 counts."""
    signal = np.zeros(N)
    signal[:covered] = np.random.default_rng(seed).uniform(10.0, 600.0, covered)
    return signal


def test_drift_is_followed():
    skin = Skin(1)
    tracked, states = follow(skin, 300.0)
    assert states in (294, 295)
    state = tracked.state
    assert np.abs(state.mean - skin.truth(300.0)).max() < 5.0
    assert not state.is_contact.any()
    assert np.abs(skin.truth(300.0) - skin.rest).max() > 60.0


@pytest.mark.parametrize("covered", [5, 20, 30])
def test_lasting_contact_is_not_absorbed_and_its_release_is_found(covered):
    skin = Skin(2, seconds=1000.0, signal=make_signal(covered), contact_s=(400.0, 900.0))
    tracked, _ = follow(skin, 890.0)
    state = tracked.state
    large = skin.signal > 30.0
    assert state.is_contact[large].all()
    # Without a free taxel (30 covered), nothing shows the drift of the board.
    assert np.abs(state.mean - skin.truth(890.0)).max() < (60.0 if covered == 30 else 20.0)
    assert state.contact_s[large].min() > 450.0
    tracked, _ = follow(Skin(2, seconds=1000.0, signal=make_signal(covered), contact_s=(400.0, 900.0)), 930.0)
    assert np.abs(tracked.state.mean - skin.truth(930.0)).max() < 10.0
    assert tracked.state.is_contact.sum() <= 2


def test_touch_during_the_first_baseline_is_corrected_after_its_release():
    skin = Skin(4, drift=0.0, signal=make_signal(5), contact_s=(0.0, 10.0))
    tracked, _ = follow(skin, 20.0)
    assert np.abs(tracked.state.mean - skin.rest).max() < 5.0


def test_repeated_contacts_do_not_move_the_baseline():
    skin = Skin(5, drift=0.0, signal=make_signal(20))
    first = compute_baseline(np.stack([skin.frame(0.0) for _ in range(100)]))
    tracked = TrackedBaseline(first.mean, first.noise, BOARD)
    for number in range(4000):
        skin.contact_s = (0.0, np.inf) if number // 60 % 2 else (np.inf, np.inf)
        tracked.update(number / RATE_HZ, skin.frame(0.0))
    assert np.abs(tracked.state.mean - skin.rest).max() < 5.0


def test_missing_frames_keep_the_baseline():
    skin = Skin(6, drift=0.0)
    first = compute_baseline(np.stack([skin.frame(0.0) for _ in range(100)]))
    tracked = TrackedBaseline(first.mean, first.noise, BOARD)
    missing = np.arange(N) < 10
    for number in range(600):
        raw = np.where(missing, 0, skin.frame(0.0)).astype(np.uint16)
        tracked.update(number / RATE_HZ, raw, ~missing)
    state = tracked.state
    assert np.abs(state.mean - skin.rest).max() < 5.0
    assert not state.is_contact.any()


def test_step_back_of_the_clock_ends_the_interval():
    skin = Skin(7, drift=0.0)
    first = compute_baseline(np.stack([skin.frame(0.0) for _ in range(100)]))
    tracked = TrackedBaseline(first.mean, first.noise)
    assert tracked.update(100.0, skin.frame(0.0)) is None
    assert tracked.update(3.0, skin.frame(0.0)) is not None
    assert tracked.update(3.5, skin.frame(0.0)) is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"baseline_mean": np.full(3, np.nan), "noise": np.ones(3)}, "finite counts"),
        ({"baseline_mean": np.ones(3), "noise": np.ones(2)}, "noise"),
        ({"baseline_mean": np.ones(3), "noise": np.ones(3), "board": np.array([0, -1, 0])}, "board"),
        ({"baseline_mean": np.ones(3), "noise": np.ones(3), "interval_s": 0.0}, "interval_s"),
    ],
)
def test_wrong_argument_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        TrackedBaseline(**arguments)


def test_time_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="time_s"):
        TrackedBaseline(np.ones(3), np.ones(3)).update(np.nan, np.ones(3, np.uint16))
