"""The twin reports changes of the skin, and nothing else."""

from functools import cache

import numpy as np
import pytest

from host.tests.twin.synthetic_skin import ADDRESSES, SIDE, TAXELS, SyntheticSkin, learn, make_tables, watch
from taxel.twin import (
    Alarm,
    Cleared,
    ContactSchedule,
    InputFault,
    Reference,
    Twin,
    VarianceFactors,
    fit_reference_models,
)


@cache
def learn_once() -> tuple[SyntheticSkin, Reference, VarianceFactors]:
    skin = SyntheticSkin(seed=5)
    reference = learn(skin)
    return skin, reference, fit_reference_models(reference)


def make_twin(contacts, hours: float = 24.0) -> Twin:
    _, reference, factors = learn_once()
    return Twin(reference, ContactSchedule(contacts), hours, factors)


def make_skin(seed: int) -> SyntheticSkin:
    """The same skin with other random numbers."""
    original, _, _ = learn_once()
    skin = SyntheticSkin(seed=seed)
    skin.patterns, skin._loading = original.patterns, original._loading
    return skin


def run_with_fault(seed: int, change, healthy: int = 20, faulty: int = 30):
    """Events of a stream whose fault begins after `healthy` contacts, and the onset."""
    skin = make_skin(seed)
    first, before = skin.run_routine(healthy)
    onset = skin.time_s
    change(skin)
    second, after = skin.run_routine(faulty)
    cycles = tuple(np.concatenate(pair) for pair in zip(before, after, strict=True))
    return watch(make_twin([*first, *second]), cycles), onset, second


def test_healthy_skin_with_drift_gives_no_alarm_in_two_hours():
    skin = make_skin(7)
    contacts, cycles = skin.run_routine(500)
    assert cycles[0][-1] > 5400.0
    assert watch(make_twin(contacts), cycles) == []


@pytest.mark.parametrize("gain", [0.3, 0.1, 0.03])  # 0.1 and 0.03: no taxel is active
def test_lasting_unannounced_contact_gives_no_alarm(gain):
    skin = make_skin(8)
    skin.gain = np.full(TAXELS, gain)
    contact = skin.make_contact(("peg", "press_0"), 65.0)
    times = (
        *contact.times_s[:2],
        contact.times_s[1] + 3600.0,
        contact.times_s[1] + 3601.0,
        contact.times_s[1] + 3602.0,
    )
    cycles = skin.run(type(contact)(times, contact.condition), 3680.0)
    assert watch(make_twin([]), cycles) == []


def test_events_do_not_depend_on_how_the_frames_arrive():
    skin = make_skin(9)
    first, before = skin.run_routine(10)
    skin.gain[:SIDE] = 0.3
    second, after = skin.run_routine(10)
    cycles = tuple(np.concatenate(pair) for pair in zip(before, after, strict=True))
    whole = watch(make_twin([*first, *second]), cycles, 10**9)
    single = watch(make_twin([*first, *second]), cycles, 1)
    odd = watch(make_twin([*first, *second]), cycles, 37)
    assert whole
    assert whole == single == odd


def make_weak_line(skin: SyntheticSkin) -> None:
    taxels, _ = make_tables()
    skin.gain[(taxels.sensor == ADDRESSES[0]) & (taxels.tx == 1)] = 0.5


def test_weak_line_is_detected_and_located_within_three_contacts():
    events, onset, contacts = run_with_fault(11, make_weak_line)
    alarm = next(event for event in events if isinstance(event, Alarm))
    assert (alarm.quantity, alarm.place.level, alarm.place.number) == ("gain", "tx", 1)
    assert sum(contact.end_s <= alarm.time_s + 1e-6 for contact in contacts) <= 6  # every third one is on another board
    assert alarm.amplitude == pytest.approx(-0.5, abs=0.15)
    assert alarm.onset_ci95[0] - 1.0 <= onset <= alarm.onset_ci95[1] + 12.0


def test_shift_at_rest_of_a_taxel_is_detected_and_located():
    def shift(skin: SyntheticSkin) -> None:
        skin.offset[5] = -40.0  # the count rises: no contact

    events, _, _ = run_with_fault(12, shift)
    alarm = next(event for event in events if isinstance(event, Alarm))
    assert (alarm.quantity, alarm.place.level, alarm.place.number) == ("rest", "taxel", 5)
    assert alarm.size_counts == pytest.approx(40.0, abs=10.0)


def test_contacts_that_vary_in_one_condition_only_give_no_alarm():
    """A contact at the edge of a board loads it by a force that differs from contact to contact."""
    original = SyntheticSkin(seed=5, force_deviation={("peg", "press_2"): 0.25})
    reference = learn(original)
    skin = SyntheticSkin(seed=16, force_deviation=original.force_deviation)
    skin.patterns, skin._loading = original.patterns, original._loading
    first, cycles = skin.run_routine(150)
    assert watch(Twin(reference, ContactSchedule(first)), cycles) == []


def test_lost_frames_of_a_board_are_detected():
    def lose(skin: SyntheticSkin) -> None:
        skin.lost[1] = 0.3

    events, _, _ = run_with_fault(13, lose)
    alarm = next(event for event in events if isinstance(event, Alarm))
    assert (alarm.quantity, alarm.place.level, alarm.place.name) == ("missing", "board", "right")


def test_more_noise_is_detected():
    def disturb(skin: SyntheticSkin) -> None:
        skin.noise_counts = 12.0

    events, _, _ = run_with_fault(14, disturb)
    assert next(event for event in events if isinstance(event, Alarm)).quantity == "noise"


def test_removed_fault_clears_its_alarm():
    skin = make_skin(15)
    contacts, parts = [], []
    for gain in (1.0, 0.4, 1.0):
        skin.gain = np.full(TAXELS, gain)
        own, cycles = skin.run_routine(20)
        contacts += own
        parts.append(cycles)
    cycles = tuple(np.concatenate(columns) for columns in zip(*parts, strict=True))
    twin = make_twin(contacts)
    events = watch(twin, cycles)
    assert any(isinstance(event, Alarm) for event in events)
    assert any(isinstance(event, Cleared) for event in events)


def test_clock_that_steps_back_is_reported_without_an_alarm():
    skin = make_skin(16)
    first, before = skin.run_routine(6)
    skin.time_s = 0.0
    _, after = skin.run_routine(6)
    cycles = tuple(np.concatenate(pair) for pair in zip(before, after, strict=True))
    events = watch(make_twin(first), cycles)
    assert [type(event) for event in events if not isinstance(event, InputFault)] == []
    assert any(isinstance(event, InputFault) and event.kind == "clock" for event in events)
