"""Grasp plan of Table 5.1, approaches and the phases of a grasp."""

from collections import Counter

import numpy as np
import pytest

from taxel.grasp.objects import ASSUMED_SIZES, make_thesis_objects
from taxel.grasp.plan import (
    ITERATIONS,
    PALM_PLACEMENTS,
    compute_palm_surface_m,
    make_thesis_approaches,
    make_thesis_plan,
)
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.hand.allegro.joints import JOINT_MAX_RAD, JOINT_MIN_RAD
from taxel.hand.transforms import apply, check_rigid, inverse

SIDES = [a for a in make_thesis_approaches() if a.name != "top"]
TOPS = [a for a in make_thesis_approaches() if a.name == "top"]


def compute_gap(approach, palm_pose):
    """Compute the distance from the palm surface to the object along the palm's x axis, metres; negative: overlap."""
    vertices = make_thesis_objects(ASSUMED_SIZES)[approach.object].shape.mesh()[0]
    return apply(inverse(palm_pose), vertices)[:, 0].min() - compute_palm_surface_m(load_hand("allegro"))


def get_name(approach):
    return f"{approach.object}-{approach.name}"


def test_the_plan_agrees_with_table_5_1():
    """Table 5.1 of the thesis: 144 grasps, with the number of iterations of each approach of each object."""
    plan = make_thesis_plan(seed=3)
    assert len(plan) == 144
    assert Counter((grasp.object, grasp.approach) for grasp in plan) == Counter(ITERATIONS)
    assert {(a.object, a.name) for a in make_thesis_approaches()} == set(ITERATIONS)


def test_every_session_has_every_approach_and_24_grasps():
    plan = make_thesis_plan(seed=3)
    for session in range(6):
        grasps = [grasp for grasp in plan if grasp.session == session]
        assert len(grasps) == 24
        assert {(grasp.object, grasp.approach) for grasp in grasps} == set(ITERATIONS)


def test_the_order_depends_only_on_the_seed():
    assert [g.id for g in make_thesis_plan(seed=1)] == [g.id for g in make_thesis_plan(seed=1)]
    assert [(g.object, g.approach) for g in make_thesis_plan(1)] != [
        (g.object, g.approach) for g in make_thesis_plan(2)
    ]


def test_grasp_ids_are_unique_and_sorted_and_iterations_are_consecutive():
    plan = make_thesis_plan(seed=5)
    assert [g.id for g in plan] == sorted({g.id for g in plan})
    for key, count in ITERATIONS.items():
        assert [g.iteration for g in plan if (g.object, g.approach) == key] == list(range(count))


@pytest.mark.parametrize("sessions", [0, 7])
def test_an_invalid_number_of_sessions_is_rejected(sessions):
    with pytest.raises(ValueError, match="sessions"):
        make_thesis_plan(seed=1, sessions=sessions)


@pytest.mark.parametrize("approach", make_thesis_approaches(withdraw_m=0.02), ids=get_name)
def test_the_palm_is_displaced_into_the_object_and_withdrawn_as_planned(approach):
    indentation_m = PALM_PLACEMENTS[approach.object, approach.name].indentation_m
    check_rigid(approach.palm_pose)
    assert compute_gap(approach, approach.compute_palm_pose_at(0.0)) == pytest.approx(-indentation_m, abs=1e-9)
    assert compute_gap(approach, approach.compute_palm_pose_at(1.0)) == pytest.approx(0.02 - indentation_m, abs=1e-9)


@pytest.mark.parametrize("approach", make_thesis_approaches(gap_m=0.003), ids=get_name)
def test_a_gap_moves_the_palm_away_from_the_object(approach):
    nominal = next(a for a in make_thesis_approaches() if get_name(a) == get_name(approach))
    displacement = approach.palm_pose[:3, 3] - nominal.palm_pose[:3, 3]
    assert np.allclose(displacement, -0.003 * nominal.palm_pose[:3, 0])


@pytest.mark.parametrize("approach", SIDES, ids=get_name)
def test_on_a_side_the_palm_y_axis_points_up_at_mid_height(approach):
    assert np.allclose(approach.palm_pose[:3, 1], [0, 0, 1])
    assert approach.palm_pose[2, 3] == pytest.approx(
        make_thesis_objects(ASSUMED_SIZES)[approach.object].shape.height / 2, abs=0.01
    )


@pytest.mark.parametrize("approach", TOPS, ids=get_name)
def test_on_top_the_palm_faces_down(approach):
    assert np.allclose(approach.palm_pose[:3, 0], [0, 0, -1])


def test_opposite_sides_differ_by_a_rotation_of_180_degrees():
    by_name = {get_name(a): a for a in make_thesis_approaches()}
    rotation = np.diag([-1.0, -1.0, 1.0, 1.0])
    for side in ("wide_side", "narrow_side"):
        first, second = (by_name[f"rectangular_prism-{side}_{k}"] for k in (1, 2))
        assert np.allclose(rotation @ first.palm_pose, second.palm_pose, atol=1e-12)


def test_all_approaches_have_equal_torques_and_angles_within_the_joint_ranges():
    first = make_thesis_approaches()[0]
    for approach in make_thesis_approaches():
        assert np.array_equal(approach.torque, first.torque)
        assert (approach.torque <= 0.7).all()
        assert np.array_equal(approach.is_held, first.is_held)
        assert (approach.torque[approach.is_held] == 0).all()
        angles = np.where(approach.is_held, approach.base_targets, approach.open_angles)
        assert ((angles >= JOINT_MIN_RAD) & (angles <= JOINT_MAX_RAD)).all()


def test_phases_are_contiguous_and_include_their_start():
    timeline = Timeline()
    assert timeline.duration_s == 13.0
    assert [timeline.get_start_s(phase) for phase in Phase] == [0.0, 6.0, 9.0, 10.5, 11.5]
    assert timeline.find_phases([0.0, 5.999, 6.0, 9.0, 10.5, 11.5]).tolist() == [0, 0, 1, 2, 3, 4]
    assert timeline.find_phases(0.0).dtype == np.uint8


def test_times_after_the_end_of_a_grasp_belong_to_its_last_phase():
    assert Timeline().find_phases([13.0, 99.0]).tolist() == [Phase.RECOVERY, Phase.RECOVERY]


def test_a_sample_at_a_phase_boundary_belongs_to_the_later_phase_despite_rounding():
    timeline = Timeline(0.1, 0.2, 0.3, 0.1, 0.1)
    assert len(timeline.make_sample_times(10.0)) == 8
    assert timeline.find_phases(timeline.make_sample_times(10.0)).tolist() == [0, 1, 1, 2, 2, 2, 3, 4]


def test_the_palm_is_at_the_object_whenever_the_torque_is_above_zero():
    timeline = Timeline()
    times = np.linspace(0, timeline.duration_s, 500)
    withdrawal = np.array([timeline.get_withdrawal(t) for t in times])
    torque_fraction = np.array([timeline.get_grip_fraction(t) for t in times])
    phase = timeline.find_phases(times)
    assert (withdrawal[phase == Phase.BASELINE] == 1).all()
    assert (withdrawal[phase == Phase.RECOVERY] == 1).all()
    assert ((withdrawal == 0) | (torque_fraction == 0)).all()
    assert (torque_fraction[phase == Phase.HOLD] == 1).all()


@pytest.mark.parametrize("durations", [{"hold_s": -1.0}, {"hold_s": np.inf}, {"closing_s": np.nan}])
def test_invalid_durations_are_rejected(durations):
    with pytest.raises(ValueError, match=next(iter(durations))):
        Timeline(**durations)


def test_a_sampling_rate_of_0_is_rejected():
    with pytest.raises(ValueError, match="rate_hz"):
        Timeline().make_sample_times(0.0)
