"""What departs from the ideal skin shows in presses, each effect where it should."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from taxel.campaign.press import press_settings, random_press_plan
from taxel.campaign.press.pressed import Work, press_session
from taxel.campaign.session import LEAD_IN_S
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand

TIMELINE = Timeline(0.6, 0.8, 0.5, 0.5, 0.4)
SLEEVE = 0x53


class Counts(NamedTuple):
    """Of every press of a session, f64[presses, taxels]: mean drop in hold and recovery, mean rest; and the rows."""

    hold: np.ndarray
    after: np.ndarray
    rest: np.ndarray
    records: list


@pytest.fixture(scope="module")
def hand():
    return load_hand("rig4")


@pytest.fixture(scope="module")
def plan(hand):
    return random_press_plan(hand, 3, sessions=1, repeats=1, timeline=TIMELINE)


def made(plan, *effects: str) -> Counts:
    settings = press_settings(plan.hand, effects=effects, noise_counts=0.0)
    records = press_session(plan.setup, plan.presses, Work(plan, settings))
    rest, hold, after = (
        np.stack([record.raw_counts[record.phase == phase].mean(axis=0) for record in records])
        for phase in (Phase.BASELINE, Phase.HOLD, Phase.RECOVERY)
    )
    return Counts(rest - hold, rest - after, rest, records)


@pytest.fixture(scope="module")
def ideal(plan) -> Counts:
    return made(plan)


@pytest.fixture(scope="module")
def pressed(ideal):
    return ideal.hold > 100.0


@pytest.fixture(scope="module")
def untouched(ideal):
    return ideal.hold < 2.0


def rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def test_an_ideal_skin_feels_where_it_is_pressed_and_nothing_stays(ideal, pressed, untouched):
    assert (pressed.sum(axis=1) >= 3).all()
    assert untouched.mean() > 0.8
    assert rms(ideal.after) < 1.0
    assert np.ptp(ideal.rest, axis=0).max() < 1.0


def test_spread_reaches_taxels_that_nothing_touches(plan, untouched):
    assert made(plan, "spread film length_m=0.005").hold[untouched].max() > 50.0


def test_coupling_moves_counts_of_taxels_that_nothing_touches(plan, ideal, untouched):
    found = made(plan, "coupling traces picofarad=2 tx_ohm=800 rx_ohm=800")
    assert rms(found.hold[untouched] - ideal.hold[untouched]) > 0.5
    assert rms(found.rest - ideal.rest) > 5.0


def test_gain_scales_every_taxel_by_its_own_factor(plan, ideal, pressed):
    ratio = made(plan, "gain electrode log_std=0.3").hold[pressed] / ideal.hold[pressed]
    assert np.std(np.log(ratio)) == pytest.approx(0.3, abs=0.12)


def test_rheology_leaves_something_after_the_release(plan, ideal, pressed):
    found = made(plan, "rheology solid fraction=0.4 seconds=1")
    assert np.median(found.after[pressed]) > 5.0 > np.abs(ideal.after[pressed]).max()


def test_indentation_stays(plan, pressed):
    found = made(plan, "indent set fraction=0.5 threshold_m=0.0001 recovery_s=1000")
    assert found.after[pressed].max() > 20.0


def test_a_late_board_falls_later_and_as_far(plan, ideal, pressed):
    late = made(plan, "late delay seconds=0.15")
    assert late.hold[pressed] == pytest.approx(ideal.hold[pressed], rel=0.05, abs=5.0)
    for press, own in enumerate(pressed):
        fallen = []
        for counts in (ideal, late):
            record = counts.records[press]
            drop = counts.rest[press, own].sum() - record.raw_counts[:, own].sum(axis=1)
            fallen.append(record.timestamp[np.argmax(drop > 0.5 * counts.hold[press, own].sum())])
        assert fallen[1] - fallen[0] == pytest.approx(0.15, abs=0.08)


def test_a_silent_board_is_not_valid(plan):
    found = made(plan, f"silent from board=0x{SLEEVE:02X} seconds={LEAD_IN_S + TIMELINE.duration_s + 0.5}")
    valid = [record.valid.all(axis=0).tolist() for record in found.records]
    assert valid[0] == [True] * 4
    assert all(own == [True, True, True, False] for own in valid[2:])


def test_drift_moves_the_rest_from_press_to_press(plan, ideal):
    rest = made(plan, "drift warm_up counts=300 seconds=20").rest
    assert (np.diff(np.abs(rest - ideal.rest).mean(axis=1)) > 1.0).all()


def test_saturation_clips_the_drop(plan, ideal, pressed):
    found = made(plan, "saturation clip counts=300")
    assert ideal.hold.max() > 600.0 > 302.0 > found.hold.max()
    low = pressed & (ideal.hold < 250.0)
    assert found.hold[low] == pytest.approx(ideal.hold[low], abs=2.0)


def test_proximity_is_felt_before_the_touch(plan, ideal):
    found = made(plan, "proximity image share=0.3 reach_m=0.01")
    assert rms(found.rest - ideal.rest) < 10.0
    for press, record in enumerate(found.records):
        still = ideal.records[press]
        coming = (record.phase == Phase.CLOSING) & (record.timestamp < still.timestamp[0] + 0.6 + 0.22)
        moved = np.abs(record.raw_counts[coming].astype(float) - found.rest[press]).max()
        assert moved > 20.0


def test_an_open_line_feels_nothing(plan, hand, ideal):
    found = made(plan, f"line open board=0x{SLEEVE:02X} axis=0 index=2")
    line = (hand.sensor == SLEEVE) & (hand.tx == 2)
    assert ideal.hold[:, line].max() > 100.0 > 10.0 > found.hold[:, line].max()
    assert found.hold[:, hand.sensor != SLEEVE] == pytest.approx(ideal.hold[:, hand.sensor != SLEEVE], abs=2.0)


def test_a_displaced_bracket_shifts_the_patch_on_its_board_alone(plan, hand, ideal):
    found = made(plan, "bracket_offset sleeve 0.002 0 0 0 0 0")
    alone = [press.approach.boards == ("sleeve",) for press in plan.presses]
    sleeve = hand.sensor == SLEEVE
    assert np.abs(found.hold - ideal.hold)[alone][:, sleeve].max() > 50.0
    others = np.logical_not(alone)
    assert found.hold[others] == pytest.approx(ideal.hold[others], abs=2.0)


def test_a_displaced_object_is_felt_elsewhere_and_others_are_not(plan, ideal):
    name = plan.presses[0].approach.object
    found = made(plan, f"object_offset {name} 0.001 0.001 0 0.02 0.02 0")
    own = [press.approach.object == name for press in plan.presses]
    assert np.abs(found.hold - ideal.hold)[own].max() > 50.0
    assert found.hold[np.logical_not(own)] == pytest.approx(ideal.hold[np.logical_not(own)], abs=2.0)
