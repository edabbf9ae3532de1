"""The twin reports changes of the skin, and nothing else."""

from dataclasses import replace
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


def make_twin(contacts) -> Twin:
    """Create a twin with the common reference; a false alarm is expected once in 24 hours at most."""
    _, reference, factors = learn_once()
    return Twin(reference, ContactSchedule(contacts), hours_per_false_alarm=24.0, factors=factors)


def make_skin(seed: int) -> SyntheticSkin:
    """Create the skin of the common reference with other random noise, drift and forces."""
    original, _, _ = learn_once()
    skin = SyntheticSkin(seed=seed)
    skin.patterns, skin._loading = original.patterns, original._loading
    return skin


def run_with_fault(seed: int, change, healthy: int = 20, faulty: int = 30):
    """Run a twin on `healthy` contacts, then `faulty` contacts of the skin after `change(skin)`.

    Returns the events, the time of the change in seconds, and the contacts after the change.
    """
    skin = make_skin(seed)
    first, before = skin.run_routine(healthy)
    onset = skin.time_s
    change(skin)
    second, after = skin.run_routine(faulty)
    cycles = tuple(np.concatenate(pair) for pair in zip(before, after, strict=True))
    return watch(make_twin([*first, *second]), cycles), onset, second


def test_healthy_skin_with_drift_gives_no_event_in_more_than_an_hour_and_a_half():
    skin = make_skin(7)
    contacts, cycles = skin.run_routine(500)
    assert cycles[0][-1] > 1.5 * 3600.0
    assert watch(make_twin(contacts), cycles) == []


@pytest.mark.parametrize("gain", [0.3, 0.1, 0.03])  # with 0.1 and 0.03, the contact makes no taxel active
def test_unannounced_contact_of_an_hour_gives_no_event(gain):
    skin = make_skin(8)
    skin.gain = np.full(TAXELS, gain)
    contact = skin.make_contact(("peg", "press_0"), 65.0)
    hold_s = contact.times_s[1]  # start of the hold, which is extended to an hour
    times = (*contact.times_s[:2], hold_s + 3600.0, hold_s + 3601.0, hold_s + 3602.0)
    cycles = skin.run(replace(contact, times_s=times), 3680.0)
    assert watch(make_twin([]), cycles) == []


def test_events_do_not_depend_on_the_sizes_of_the_blocks_in_which_frames_arrive():
    skin = make_skin(9)
    first, before = skin.run_routine(10)
    skin.gain[:SIDE] = 0.3
    second, after = skin.run_routine(10)
    cycles = tuple(np.concatenate(pair) for pair in zip(before, after, strict=True))
    in_one_block = watch(make_twin([*first, *second]), cycles, block=10**9)
    frame_by_frame = watch(make_twin([*first, *second]), cycles, block=1)
    in_blocks_of_37 = watch(make_twin([*first, *second]), cycles, block=37)
    assert in_one_block
    assert in_one_block == frame_by_frame == in_blocks_of_37


def halve_the_response_of_line_tx1(skin: SyntheticSkin) -> None:
    taxels, _ = make_tables()
    skin.gain[(taxels.sensor == ADDRESSES[0]) & (taxels.tx == 1)] = 0.5


def test_half_response_of_a_line_is_detected_within_six_contacts_with_place_size_and_onset():
    events, onset, contacts = run_with_fault(11, halve_the_response_of_line_tx1)
    alarm = next(event for event in events if isinstance(event, Alarm))
    assert (alarm.quantity, alarm.place.level, alarm.place.number) == ("gain", "tx", 1)
    assert sum(contact.end_s <= alarm.time_s + 1e-6 for contact in contacts) <= 6  # two of three load this board
    assert alarm.amplitude == pytest.approx(-0.5, abs=0.15)
    # The change happens in a pause of up to 12 s, where it is not visible.
    assert alarm.onset_ci95[0] - 1.0 <= onset <= alarm.onset_ci95[1] + 12.0


def test_shifted_count_of_a_taxel_without_contact_is_detected_with_place_and_size():
    def shift(skin: SyntheticSkin) -> None:
        skin.offset[5] = -40.0  # negative: the count rises, unlike in a contact

    events, _, _ = run_with_fault(12, shift)
    alarm = next(event for event in events if isinstance(event, Alarm))
    assert (alarm.quantity, alarm.place.level, alarm.place.number) == ("rest", "taxel", 5)
    assert alarm.size_counts == pytest.approx(40.0, abs=10.0)


def test_condition_whose_force_varies_more_than_that_of_others_gives_no_event():
    """A contact at the edge of a board loads the board with a force that differs from contact to contact."""
    original = SyntheticSkin(seed=5, force_deviation={("peg", "press_2"): 0.25})
    reference = learn(original)
    # The same skin and contacts as in the reference, with other random numbers.
    skin = SyntheticSkin(seed=16, force_deviation=original.force_deviation)
    skin.patterns, skin._loading = original.patterns, original._loading
    first, cycles = skin.run_routine(150)
    assert watch(Twin(reference, ContactSchedule(first)), cycles) == []


def test_lost_frames_of_a_board_raise_an_alarm_for_this_board():
    def lose(skin: SyntheticSkin) -> None:
        skin.lost[1] = 0.3

    events, _, _ = run_with_fault(13, lose)
    alarm = next(event for event in events if isinstance(event, Alarm))
    assert (alarm.quantity, alarm.place.level, alarm.place.name) == ("missing", "board", "right")


def test_threefold_noise_raises_an_alarm_for_the_noise():
    def disturb(skin: SyntheticSkin) -> None:
        skin.noise_counts *= 3.0

    events, _, _ = run_with_fault(seed=14, change=disturb)
    assert next(event for event in events if isinstance(event, Alarm)).quantity == "noise"


def test_removed_fault_clears_its_alarm():
    skin = make_skin(15)
    contacts, parts = [], []
    for gain in (1.0, 0.4, 1.0):
        skin.gain = np.full(TAXELS, gain)
        planned, cycles = skin.run_routine(20)
        contacts += planned
        parts.append(cycles)
    cycles = tuple(np.concatenate(columns) for columns in zip(*parts, strict=True))
    events = watch(make_twin(contacts), cycles)
    raised = [event for event in events if isinstance(event, Alarm)]
    cleared = [event.alarm for event in events if isinstance(event, Cleared)]
    assert raised[0] in cleared


def test_clock_that_steps_back_is_reported_as_an_input_fault_without_an_alarm():
    skin = make_skin(16)
    first, before = skin.run_routine(6)
    skin.time_s = 0.0
    _, after = skin.run_routine(6)
    cycles = tuple(np.concatenate(pair) for pair in zip(before, after, strict=True))
    events = watch(make_twin(first), cycles)
    assert [event.kind for event in events if isinstance(event, InputFault)] == ["clock"]
    assert len(events) == 1
