from collections import Counter

import numpy as np
import pytest

from taxel.grasp.objects import thesis_objects
from taxel.grasp.plan import ITERATIONS, PLACINGS, palm_surface_m, thesis_approaches, thesis_plan
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.hand.allegro.joints import JOINT_MAX_RAD, JOINT_MIN_RAD
from taxel.hand.transforms import apply, check_rigid, inverse

SIDES = [a for a in thesis_approaches() if a.name != "top"]
TOPS = [a for a in thesis_approaches() if a.name == "top"]


def gap(approach, palm_pose):
    """Distance from the palm's surface to the object, along the palm's x."""
    vertices = thesis_objects()[approach.object].shape.mesh()[0]
    return apply(inverse(palm_pose), vertices)[:, 0].min() - palm_surface_m(load_hand("allegro"))


def name_of(approach):
    return f"{approach.object}-{approach.name}"


def test_the_plan_is_table_5_1():
    plan = thesis_plan(seed=3)
    assert len(plan) == 144
    assert Counter((grasp.object, grasp.approach) for grasp in plan) == Counter(ITERATIONS)
    assert {(a.object, a.name) for a in thesis_approaches()} == set(ITERATIONS)


def test_every_session_has_every_approach_and_all_are_equally_long():
    plan = thesis_plan(seed=3)
    for session in range(6):
        made = [grasp for grasp in plan if grasp.session == session]
        assert len(made) == 24
        assert {(grasp.object, grasp.approach) for grasp in made} == set(ITERATIONS)


def test_the_order_depends_on_the_seed_alone():
    assert [g.id for g in thesis_plan(seed=1)] == [g.id for g in thesis_plan(seed=1)]
    assert [(g.object, g.approach) for g in thesis_plan(1)] != [(g.object, g.approach) for g in thesis_plan(2)]


def test_grasps_are_named_once_in_order_of_time_and_iterations_count_up():
    plan = thesis_plan(seed=5)
    assert [g.id for g in plan] == sorted({g.id for g in plan})
    for key, count in ITERATIONS.items():
        assert [g.iteration for g in plan if (g.object, g.approach) == key] == list(range(count))


@pytest.mark.parametrize("sessions", [0, 7])
def test_sessions_that_could_not_all_have_every_approach_are_refused(sessions):
    with pytest.raises(ValueError, match="sessions"):
        thesis_plan(seed=1, sessions=sessions)


@pytest.mark.parametrize("approach", thesis_approaches(withdraw_m=0.02), ids=name_of)
def test_the_palm_presses_on_the_object_as_planned_and_withdraws_from_it_if_told(approach):
    press_m = PLACINGS[approach.object, approach.name].press_m
    check_rigid(approach.palm_pose)
    assert gap(approach, approach.palm_pose_at(0.0)) == pytest.approx(-press_m, abs=1e-9)
    assert gap(approach, approach.palm_pose_at(1.0)) == pytest.approx(0.02 - press_m, abs=1e-9)


@pytest.mark.parametrize("approach", thesis_approaches(gap_m=0.003), ids=name_of)
def test_a_gap_moves_the_palm_away(approach):
    nominal = next(a for a in thesis_approaches() if name_of(a) == name_of(approach))
    moved = approach.palm_pose[:3, 3] - nominal.palm_pose[:3, 3]
    assert np.allclose(moved, -0.003 * nominal.palm_pose[:3, 0])


@pytest.mark.parametrize("approach", SIDES, ids=name_of)
def test_on_a_side_the_thumbs_side_is_up_and_the_middle_finger_at_mid_height(approach):
    assert np.allclose(approach.palm_pose[:3, 1], [0, 0, 1])
    assert approach.palm_pose[2, 3] == pytest.approx(thesis_objects()[approach.object].shape.height / 2, abs=0.01)


@pytest.mark.parametrize("approach", TOPS, ids=name_of)
def test_on_top_the_palm_looks_down(approach):
    assert np.allclose(approach.palm_pose[:3, 0], [0, 0, -1])


def test_opposite_sides_are_the_same_grasp_turned_by_half_a_turn():
    by_name = {name_of(a): a for a in thesis_approaches()}
    half_turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    for side in ("wide_side", "narrow_side"):
        one, two = (by_name[f"rectangular_prism-{side}_{k}"] for k in (1, 2))
        assert np.allclose(half_turn @ one.palm_pose, two.palm_pose, atol=1e-12)


def test_all_grasps_use_the_same_torques_within_the_joints_ranges():
    first = thesis_approaches()[0]
    for approach in thesis_approaches():
        assert np.array_equal(approach.torque, first.torque)
        assert (approach.torque <= 0.7).all()
        assert np.array_equal(approach.held, first.held)
        assert (approach.torque[approach.held] == 0).all()
        angles = np.where(approach.held, approach.base_targets, approach.open_angles)
        assert ((angles >= JOINT_MIN_RAD) & (angles <= JOINT_MAX_RAD)).all()


def test_phases_follow_one_another_and_begin_at_their_first_moment():
    line = Timeline()
    assert line.duration_s == 12.0
    assert [line.begin(phase) for phase in Phase] == [0.0, 6.0, 8.0, 9.5, 10.5]
    assert line.phase_at([0.0, 5.999, 6.0, 8.0, 9.5, 10.5, 12.0, 99.0]).tolist() == [0, 0, 1, 2, 3, 4, 4, 4]
    assert line.phase_at(0.0).dtype == np.uint8


def test_a_sample_at_a_border_belongs_to_the_phase_that_begins_there_in_spite_of_rounding():
    line = Timeline(0.1, 0.2, 0.3, 0.1, 0.1)
    assert len(line.sample_times(10.0)) == 8
    assert line.phase_at(line.sample_times(10.0)).tolist() == [0, 1, 1, 2, 2, 2, 3, 4]


def test_the_palm_is_on_the_object_before_the_grip_begins_and_until_it_is_over():
    line = Timeline()
    times = np.linspace(0, line.duration_s, 500)
    away = np.array([line.withdrawn_at(t) for t in times])
    grip = np.array([line.grip_at(t) for t in times])
    phase = line.phase_at(times)
    assert (away[phase == Phase.BASELINE] == 1).all()
    assert (away[phase == Phase.RECOVERY] == 1).all()
    assert ((away == 0) | (grip == 0)).all()
    assert (grip[phase == Phase.HOLD] == 1).all()


@pytest.mark.parametrize("given", [{"hold_s": -1.0}, {"hold_s": np.inf}, {"closing_s": np.nan}])
def test_impossible_durations_are_refused(given):
    with pytest.raises(ValueError, match=next(iter(given))):
        Timeline(**given)
    with pytest.raises(ValueError, match="rate_hz"):
        Timeline().sample_times(0.0)
