"""Effects of the emulated skin in indentations: each effect changes the expected taxels, phases or frames."""

from typing import NamedTuple

import numpy as np
import pytest

from taxel.campaign.indentation import IndentationDesign, indentation_settings, sample_indentation_plan
from taxel.campaign.indentation.emulated import EmulatedCampaign, run_indentation_session
from taxel.campaign.session import LEAD_IN_S
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand

TIMELINE = Timeline(baseline_s=0.6, closing_s=0.8, hold_s=0.5, release_s=0.5, recovery_s=0.4)
SLEEVE = 0x53
"""Address of the board "sleeve" of the rig."""
FREE_CLOSING_S = 0.22
"""Time from the start of the closing phase in which the object certainly does not touch the skin."""


class Counts(NamedTuple):
    """Counts of one session of I indentations on n taxels.

    hold, recovery: mean signal f64[I, n] in these phases: baseline minus raw counts. baseline: mean raw counts f64[I,
    n] in the baseline. records: dataset records of the indentations.
    """

    hold: np.ndarray
    recovery: np.ndarray
    baseline: np.ndarray
    records: list


@pytest.fixture(scope="module")
def hand():
    return load_hand("rig4")


@pytest.fixture(scope="module")
def plan(hand):
    return sample_indentation_plan(hand, 3, IndentationDesign(sessions=1, repeats=1, timeline=TIMELINE))


def run_session_with(plan, *effects: str) -> Counts:
    """Run one session of the plan without noise on an emulated skin with the given effects."""
    settings = indentation_settings(plan.hand, effects=effects, noise_counts=0.0)
    records = run_indentation_session(plan.setup, plan.indentations, EmulatedCampaign(plan, settings))
    baseline, hold, recovery = (
        np.stack([record.raw_counts[record.phase == phase].mean(axis=0) for record in records])
        for phase in (Phase.BASELINE, Phase.HOLD, Phase.RECOVERY)
    )
    return Counts(baseline - hold, baseline - recovery, baseline, records)


@pytest.fixture(scope="module")
def ideal(plan) -> Counts:
    """Return the counts of a skin without effects."""
    return run_session_with(plan)


@pytest.fixture(scope="module")
def loaded(ideal):
    """Return which taxels have a clear signal in each indentation of a skin without effects, bool[I, n]."""
    return ideal.hold > 100.0


@pytest.fixture(scope="module")
def unloaded(ideal):
    """Return which taxels have practically no signal in each indentation of a skin without effects, bool[I, n]."""
    return ideal.hold < 2.0


def compute_rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def test_an_ideal_skin_has_signal_only_at_the_contact_and_recovers(ideal, loaded, unloaded):
    assert (loaded.sum(axis=1) >= 3).all()  # every indentation loads at least three taxels
    assert unloaded.mean() > 0.8  # most taxels lie outside the contact
    assert compute_rms(ideal.recovery) < 1.0
    assert np.ptp(ideal.baseline, axis=0).max() < 1.0


def test_spread_gives_a_signal_on_unloaded_taxels(plan, unloaded):
    assert run_session_with(plan, "spread film length_m=0.005").hold[unloaded].max() > 50.0


def test_coupling_changes_the_signal_of_unloaded_taxels_and_the_baseline(plan, ideal, unloaded):
    result = run_session_with(plan, "coupling traces picofarad=2 tx_ohm=800 rx_ohm=800")
    assert compute_rms(result.hold[unloaded] - ideal.hold[unloaded]) > 0.5
    assert compute_rms(result.baseline - ideal.baseline) > 5.0


def test_gain_scales_each_taxel_by_a_random_factor(plan, ideal, loaded):
    ratio = run_session_with(plan, "gain electrode log_std=0.3").hold[loaded] / ideal.hold[loaded]
    assert np.std(np.log(ratio)) == pytest.approx(0.3, abs=0.12)


def test_rheology_leaves_a_signal_after_the_release(plan, ideal, loaded):
    result = run_session_with(plan, "rheology solid fraction=0.4 seconds=1")
    assert np.median(result.recovery[loaded]) > 5.0 > np.abs(ideal.recovery[loaded]).max()


def test_a_permanent_set_leaves_a_signal_after_the_release(plan, loaded):
    result = run_session_with(plan, "indent set fraction=0.5 threshold_m=0.0001 recovery_s=1000")
    assert result.recovery[loaded].max() > 20.0


def test_a_delay_shifts_the_signal_in_time_but_keeps_its_level(plan, ideal, loaded):
    late = run_session_with(plan, "late delay seconds=0.15")
    assert late.hold[loaded] == pytest.approx(ideal.hold[loaded], rel=0.05, abs=5.0)
    for index, taxels in enumerate(loaded):
        onset_s = []
        for counts in (ideal, late):
            record = counts.records[index]
            signal = counts.baseline[index, taxels].sum() - record.raw_counts[:, taxels].sum(axis=1)
            onset_s.append(record.timestamp[np.argmax(signal > 0.5 * counts.hold[index, taxels].sum())])
        assert onset_s[1] - onset_s[0] == pytest.approx(0.15, abs=0.08)


def test_frames_of_a_board_that_stopped_responding_are_invalid(plan):
    in_second_indentation_s = LEAD_IN_S + TIMELINE.duration_s + 0.5
    result = run_session_with(plan, f"silent from board=0x{SLEEVE:02X} seconds={in_second_indentation_s}")
    valid = [record.valid.all(axis=0).tolist() for record in result.records]
    assert valid[0] == [True] * 4
    assert all(boards == [True, True, True, False] for boards in valid[2:])


def test_drift_moves_the_baseline_further_in_each_indentation(plan, ideal):
    baseline = run_session_with(plan, "drift warm_up counts=300 seconds=20").baseline
    assert (np.diff(np.abs(baseline - ideal.baseline).mean(axis=1)) > 1.0).all()


def test_saturation_clips_large_signals_and_leaves_small_ones_unchanged(plan, ideal, loaded):
    result = run_session_with(plan, "saturation clip counts=300")
    assert ideal.hold.max() > 600.0 > 302.0 > result.hold.max()  # 300 counts and the rounding of two means
    is_unclipped = loaded & (ideal.hold < 250.0)
    assert result.hold[is_unclipped] == pytest.approx(ideal.hold[is_unclipped], abs=2.0)


def test_proximity_changes_the_counts_before_contact(plan, ideal):
    """The effect reaches 10 mm. The baseline is taken farther away, and hardly changes."""
    result = run_session_with(plan, "proximity image share=0.3 reach_m=0.01")
    assert compute_rms(result.baseline - ideal.baseline) < 10.0
    for index, record in enumerate(result.records):
        free_end_s = ideal.records[index].timestamp[0] + TIMELINE.baseline_s + FREE_CLOSING_S
        is_before_contact = (record.phase == Phase.CLOSING) & (record.timestamp < free_end_s)
        counts = record.raw_counts[is_before_contact].astype(float)
        assert np.abs(counts - result.baseline[index]).max() > 20.0


def test_an_open_line_has_no_signal_and_leaves_the_other_boards_unchanged(plan, hand, ideal):
    result = run_session_with(plan, f"line open board=0x{SLEEVE:02X} axis=0 index=2")  # axis 0: TX lines
    line = (hand.sensor == SLEEVE) & (hand.tx == 2)
    assert ideal.hold[:, line].max() > 100.0 > 10.0 > result.hold[:, line].max()
    assert result.hold[:, hand.sensor != SLEEVE] == pytest.approx(ideal.hold[:, hand.sensor != SLEEVE], abs=2.0)


def test_a_displaced_bracket_changes_only_the_indentations_of_its_board(plan, hand, ideal):
    result = run_session_with(plan, "bracket_offset sleeve 0.002 0 0 0 0 0")  # 2 mm in x
    is_on_sleeve = np.array([indentation.approach.boards == ("sleeve",) for indentation in plan.indentations])
    sleeve = hand.sensor == SLEEVE
    assert np.abs(result.hold - ideal.hold)[is_on_sleeve][:, sleeve].max() > 50.0
    assert result.hold[~is_on_sleeve] == pytest.approx(ideal.hold[~is_on_sleeve], abs=2.0)


def test_a_displaced_object_changes_only_the_indentations_with_this_object(plan, ideal):
    name = plan.indentations[0].approach.object
    # x, y, z in metres, and a rotation vector in radians
    result = run_session_with(plan, f"object_offset {name} 0.001 0.001 0 0.02 0.02 0")
    is_displaced = np.array([indentation.approach.object == name for indentation in plan.indentations])
    assert np.abs(result.hold - ideal.hold)[is_displaced].max() > 50.0
    assert result.hold[~is_displaced] == pytest.approx(ideal.hold[~is_displaced], abs=2.0)
