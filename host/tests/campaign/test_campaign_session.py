"""One session through the emulator: what its records hold, and what decides them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from taxel.campaign.variation import NO_VARIATION
from taxel.campaign.session import LEAD_IN_S, check_world, run_session
from taxel.campaign.settings import EmulatedSettings
from taxel.emulated.contact import ContactLibraryError
from taxel.grasp.timeline import Phase

IDEAL = "noise white counts=0", "coupling traces picofarad=0 tx_ohm=0 rx_ohm=0", "spread film length_m=0.003 strength=0"


def arrays(record):
    return {name: value for name, value in vars(record).items() if isinstance(value, np.ndarray)}


def same(one, other) -> bool:
    """Are the records of two sessions equal, bit for bit?"""
    return all(
        value.tobytes() == getattr(b, name).tobytes()
        for a, b in zip(one, other, strict=True)
        for name, value in arrays(a).items()
    )


@pytest.fixture(scope="module")
def settings(timeline):
    return EmulatedSettings(timeline=timeline, effects=(), noise_counts=2.0)


@pytest.fixture(scope="module")
def records(setup, two_of_one_session, settings):
    return run_session(setup, two_of_one_session, settings)


def test_the_records_are_the_planned_grasps_in_order(records, two_of_one_session):
    found = [(record.object, record.approach, record.iteration, record.session) for record in records]
    assert found == [(grasp.object, grasp.approach, grasp.iteration, grasp.session) for grasp in two_of_one_session]


@pytest.fixture(scope="module")
def alone(setup, two_of_one_session, settings):
    """The first grasp as the only one of its session."""
    return run_session(setup, two_of_one_session[:1], settings)


def test_phases_are_as_commanded(records, timeline):
    for place, record in enumerate(records):
        since = record.timestamp - LEAD_IN_S - place * timeline.duration_s
        assert since[0] >= 0
        assert since[-1] < timeline.duration_s
        assert record.phase.tolist() == timeline.phase_at(since).tolist()
        assert set(record.phase.tolist()) == set(Phase)


def test_every_poll_gives_a_frame_of_every_board(records, timeline):
    for record in records:
        assert len(record.timestamp) > 18 * timeline.duration_s
        assert np.diff(record.timestamp).max() < 1.5 * np.median(np.diff(record.timestamp))
        assert record.valid.all()
        assert (np.diff(record.sensor_time, axis=0) > 0).all()


def test_counts_drop_in_hold_and_return_to_the_baseline(records):
    for record in records:
        still = record.raw_counts[record.phase == Phase.BASELINE].astype(float)
        rest, hold = still.mean(axis=0), record.raw_counts[record.phase == Phase.HOLD].mean(axis=0)
        after = record.raw_counts[record.phase == Phase.RECOVERY].mean(axis=0)
        assert (rest - still).max() < 8 * 2.0
        assert 10 < (rest - hold > 150).sum() < 300
        assert (rest - hold).min() > -5.0
        assert rest == pytest.approx(after, abs=5.0)


def test_sensor_poses_follow_from_the_mean_angles_of_the_hold(records, setup):
    for record in records:
        mean = record.joint_position[record.phase == Phase.HOLD].mean(axis=0)
        assert record.joint_position.shape == (len(record.timestamp), 22)
        assert record.sensor_pose == pytest.approx(setup.kinematics.sensor_poses(mean))


def test_the_arm_holds_the_planned_wrist_and_withdraws_it(records, setup, two_of_one_session):
    for record, planned in zip(records, two_of_one_session, strict=True):
        at, away = setup.arm_path(planned)
        assert np.abs(record.joint_position[record.phase == Phase.HOLD][:, :6] - at).max() < 1e-9
        assert record.joint_position[0, :6] == pytest.approx(away)


def test_the_object_is_believed_where_it_nominally_stands_while_it_truly_stands_elsewhere(
    records, setup, settings, two_of_one_session
):
    assert all((record.object_pose == setup.object_pose("cylinder")).all() for record in records)
    elsewhere = replace(settings, variation=replace(NO_VARIATION, object_m=2e-3))
    other = run_session(setup, two_of_one_session[:1], elsewhere)[0]
    assert (other.object_pose == records[0].object_pose).all()
    one, two = (record.raw_counts[record.phase == Phase.HOLD].mean(axis=0) for record in (other, records[0]))
    assert np.abs(one - two).max() > 100


def test_another_seed_gives_others(alone, setup, two_of_one_session, settings):
    other = run_session(setup, two_of_one_session[:1], replace(settings, seed=2))[0]
    assert (other.raw_counts != alone[0].raw_counts[: len(other.raw_counts)]).any()
    assert not np.array_equal(other.joint_position, alone[0].joint_position)


def test_a_grasp_is_the_same_whatever_follows_it(records, alone):
    """All but its times, which a host fits to all that it hears."""
    assert (records[0].raw_counts == alone[0].raw_counts).all()
    assert (records[0].sensor_time == alone[0].sensor_time).all()
    assert records[0].timestamp == pytest.approx(alone[0].timestamp, abs=1e-4)


def test_the_same_seed_gives_identical_arrays_and_effects_of_no_strength_are_none(
    alone, setup, two_of_one_session, settings
):
    weak = replace(settings, effects=IDEAL)
    assert same(alone, run_session(setup, two_of_one_session[:1], weak))


def test_effects_change_the_counts_and_neither_joints_nor_poses(alone, setup, two_of_one_session, settings):
    effects = replace(settings, effects=("spread film length_m=0.004",))
    spread = run_session(setup, two_of_one_session[:1], effects)[0]
    assert spread.joint_position == pytest.approx(alone[0].joint_position, abs=2e-3)
    assert spread.sensor_pose == pytest.approx(alone[0].sensor_pose, abs=1e-3)
    assert (spread.raw_counts != alone[0].raw_counts).any()


def test_a_board_that_is_silent_repeats_its_last_counts(setup, two_of_one_session, settings):
    begin = LEAD_IN_S + 1.0
    effects = (f"no_progress from board=0x22 seconds={begin}", "no_progress flaky p=0.2")
    record = run_session(setup, two_of_one_session[:1], replace(settings, effects=effects))[0]
    column = [board.address for board in setup.hand.boards].index(0x22)
    quiet = record.timestamp > begin + 0.1
    assert record.valid[record.timestamp < begin - 0.1, column].any()
    assert not record.valid[quiet, column].any()
    assert 0.5 < np.delete(record.valid, column, axis=1).mean() < 0.95
    counts = record.raw_counts[quiet][:, setup.hand.slice_of(0x22)]
    assert counts.min() > 0
    assert (counts == counts[0]).all()
    assert (np.diff(record.timestamp) > 0).all()


def test_effects_that_the_emulator_refuses_are_named_with_their_line(setup, settings):
    with pytest.raises(ContactLibraryError, match=r"^world file, line \d+: .* \(found 'effect noise purple'\)$"):
        check_world(setup, replace(settings, effects=("noise purple",)))
