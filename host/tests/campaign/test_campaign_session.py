"""One session through the emulator: content of its records, and dependence on seed and settings."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.campaign import performed_grasp
from taxel.campaign.performed_grasp import perform_grasp
from taxel.campaign.session import LEAD_IN_S, run_session
from taxel.campaign.session_world import check_world
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.variation import NO_VARIATION, Variation
from taxel.emulated.contact import ContactLibraryError
from taxel.grasp.plan import make_thesis_plan
from taxel.grasp.timeline import Phase

NOISE_COUNTS = 2.0
SILENT_BOARD = 0x1C
"""Address of the board that stops responding."""

EFFECTS_OF_ZERO_STRENGTH = (
    "noise white counts=0",
    "coupling traces picofarad=0 tx_ohm=0 rx_ohm=0",
    "spread film length_m=0.003 strength=0",
)


def select_arrays(record):
    """Return the arrays of a record by name."""
    return {name: value for name, value in vars(record).items() if isinstance(value, np.ndarray)}


def are_identical(first_records, second_records) -> bool:
    """Return whether the records of two sessions are bit-identical."""
    return all(
        value.tobytes() == getattr(b, name).tobytes()
        for a, b in zip(first_records, second_records, strict=True)
        for name, value in select_arrays(a).items()
    )


def run_grasps(setup, plan, settings):
    """Perform planned grasps of one session and return their records."""
    return run_session(setup, [perform_grasp(setup, planned, settings) for planned in plan], settings)


@pytest.fixture(scope="module")
def settings(timeline):
    return EmulatedSettings(timeline=timeline, effects=(), noise_counts=NOISE_COUNTS)


@pytest.fixture(scope="module")
def grasps(setup, two_of_one_session, settings):
    """Perform the two grasps of a session without effects."""
    return [perform_grasp(setup, planned, settings) for planned in two_of_one_session]


@pytest.fixture(scope="module")
def records(setup, grasps, settings):
    return run_session(setup, grasps, settings)


def test_the_records_are_the_planned_grasps_in_order(records, two_of_one_session):
    recorded = [(record.object, record.approach, record.iteration, record.session) for record in records]
    assert recorded == [(grasp.object, grasp.approach, grasp.iteration, grasp.session) for grasp in two_of_one_session]


@pytest.fixture(scope="module")
def single_grasp_session(setup, grasps, settings):
    """Run a session that consists of the first grasp only; return its records."""
    return run_session(setup, grasps[:1], settings)


def test_phases_follow_the_timeline(records, timeline):
    for index, record in enumerate(records):
        elapsed = record.timestamp - LEAD_IN_S - index * timeline.duration_s
        assert elapsed[0] >= 0
        assert elapsed[-1] < timeline.duration_s
        assert record.phase.tolist() == timeline.find_phases(elapsed).tolist()
        assert set(record.phase.tolist()) == set(Phase)


def test_every_poll_cycle_has_a_frame_of_every_board_at_a_steady_rate_above_18_hz(records, timeline):
    for record in records:
        assert len(record.timestamp) > 18 * timeline.duration_s
        assert np.diff(record.timestamp).max() < 1.5 * np.median(np.diff(record.timestamp))
        assert record.valid.all()
        assert (np.diff(record.sensor_time, axis=0) > 0).all()


def test_counts_decrease_in_hold_and_return_to_the_baseline(records):
    for record in records:
        baseline_frames = record.raw_counts[record.phase == Phase.BASELINE].astype(float)
        baseline, hold = baseline_frames.mean(axis=0), record.raw_counts[record.phase == Phase.HOLD].mean(axis=0)
        recovery_frames = record.raw_counts[record.phase == Phase.RECOVERY]
        # Six standard errors of a difference of two means: 1 in 10^6 taxels exceeds it by noise.
        tolerance = 6.0 * NOISE_COUNTS * (1.0 / len(baseline_frames) + 1.0 / len(recovery_frames)) ** 0.5
        assert (baseline - baseline_frames).max() < 8 * NOISE_COUNTS  # no contact in the baseline, only noise
        assert 5 < (baseline - hold > 150).sum() < 300  # a plausible number of taxels with a clear signal
        assert (baseline - hold).min() > -tolerance
        assert baseline == pytest.approx(recovery_frames.mean(axis=0), abs=tolerance)


def test_sensor_poses_are_those_of_the_mean_joint_angles_in_hold(records, setup):
    for record in records:
        mean = record.joint_position[record.phase == Phase.HOLD].mean(axis=0)
        assert record.joint_position.shape == (len(record.timestamp), 22)
        assert record.sensor_pose == pytest.approx(setup.kinematics.compute_sensor_poses(mean))


def test_the_arm_starts_withdrawn_and_is_at_the_object_in_the_hold(records, setup, two_of_one_session):
    for record, planned in zip(records, two_of_one_session, strict=True):
        grasping, withdrawn = setup.arm_path(planned)
        assert np.abs(record.joint_position[record.phase == Phase.HOLD][:, :6] - grasping).max() < 1e-9
        assert record.joint_position[0, :6] == pytest.approx(withdrawn)


def test_the_record_has_the_nominal_object_pose_while_the_true_pose_varies(
    records, setup, settings, two_of_one_session
):
    assert all((record.object_pose == setup.object_pose("cylinder")).all() for record in records)
    varied_settings = replace(settings, variation=replace(NO_VARIATION, object_m=2e-3))
    varied = run_grasps(setup, two_of_one_session[:1], varied_settings)[0]
    assert (varied.object_pose == records[0].object_pose).all()
    varied_counts, nominal_counts = (
        record.raw_counts[record.phase == Phase.HOLD].mean(axis=0) for record in (varied, records[0])
    )
    assert np.abs(varied_counts - nominal_counts).max() > 100


@pytest.mark.slow
def test_another_seed_gives_another_record(single_grasp_session, setup, two_of_one_session, settings):
    reference = single_grasp_session[0]
    other_record = run_grasps(setup, two_of_one_session[:1], replace(settings, seed=2))[0]
    assert (other_record.raw_counts != reference.raw_counts[: len(other_record.raw_counts)]).any()
    assert not np.array_equal(other_record.joint_position, reference.joint_position)


def test_a_grasp_does_not_depend_on_later_grasps(records, single_grasp_session):
    """Only the times of a grasp may differ slightly, because the host fits the hub's clock to all received frames."""
    reference = single_grasp_session[0]
    assert (records[0].raw_counts == reference.raw_counts).all()
    assert (records[0].sensor_time == reference.sensor_time).all()
    assert records[0].timestamp == pytest.approx(reference.timestamp, abs=1e-4)


def test_effects_of_zero_strength_give_records_identical_to_those_without_effects(
    single_grasp_session, setup, grasps, settings
):
    zero_strength = replace(settings, effects=EFFECTS_OF_ZERO_STRENGTH)
    assert are_identical(single_grasp_session, run_session(setup, grasps[:1], zero_strength))


def test_effects_change_counts_but_not_joint_angles_or_poses(single_grasp_session, setup, grasps, settings):
    reference = single_grasp_session[0]
    effects = replace(settings, effects=("spread film length_m=0.004",))
    spread = run_session(setup, grasps[:1], effects)[0]
    assert spread.joint_position == pytest.approx(reference.joint_position, abs=2e-3)
    assert spread.sensor_pose == pytest.approx(reference.sensor_pose, abs=1e-3)
    assert (spread.raw_counts != reference.raw_counts).any()


def test_a_board_that_stops_responding_has_invalid_frames_with_its_latest_counts(setup, grasps, settings):
    silent_from_s = LEAD_IN_S + 1.0
    effects = (f"silent from board=0x{SILENT_BOARD:02X} seconds={silent_from_s}", "silent flaky p=0.2")
    record = run_session(setup, grasps[:1], replace(settings, effects=effects))[0]
    column = [board.address for board in setup.hand.boards].index(SILENT_BOARD)
    is_after = record.timestamp > silent_from_s + 0.1
    assert record.valid[record.timestamp < silent_from_s - 0.1, column].any()
    assert not record.valid[is_after, column].any()
    assert 0.5 < np.delete(record.valid, column, axis=1).mean() < 0.95  # the other boards lose a fifth of their frames
    counts = record.raw_counts[is_after][:, setup.hand.get_slice(SILENT_BOARD)]
    assert counts.min() > 0
    assert (counts == counts[0]).all()
    assert (np.diff(record.timestamp) > 0).all()


def test_the_error_for_a_rejected_effect_states_its_line(setup, settings):
    with pytest.raises(ContactLibraryError, match=r"^world file, line \d+: .* \(found 'effect noise purple'\)$"):
        check_world(setup, replace(settings, effects=("noise purple",)))


def test_successful_grasps_are_marked_as_first_attempts(records):
    assert [(record.attempts, record.failure) for record in records] == [(1, "none"), (1, "none")]


def test_a_grasp_that_fails_by_chance_is_repeated_with_another_variation(setup, plan, settings, monkeypatch):
    """In the first attempt the object is placed 0.1 m in front of the palm; the second attempt has no variation."""
    away = 0.1 * setup.approach(plan[0]).palm_pose[:3, 0]
    samples = (np.r_[away, np.zeros(4)], np.zeros(7))
    monkeypatch.setattr(performed_grasp, "sample_grasp_variation", lambda seed, grasp, attempt: samples[attempt])
    displaced = replace(settings, variation=replace(NO_VARIATION, object_m=1.0))
    record = run_grasps(setup, plan[:1], displaced)[0]
    assert (record.attempts, record.failure) == (2, "none")


def test_a_planned_grasp_that_turns_the_object_without_variation_fails_as_turned_and_is_not_repeated(setup, settings):
    """In the approach "side_edge" of the plan, the box turns by 45 degrees on the palm even without variation.

    The palm then lies against a face of the box, as in another approach. A repetition would be useless.
    """
    planned = next(grasp for grasp in make_thesis_plan(1) if grasp.approach == "side_edge")
    record = run_grasps(setup, [planned], replace(settings, variation=Variation()))[0]
    assert (record.attempts, record.failure) == (1, "turned")
