"""Failed grasps: the definition on poses of hand and object, and the repetition of attempts."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.campaign.attempts import perform_attempts
from taxel.campaign.failure import Failure, make_grasp_check
from taxel.grasp.plan import make_thesis_plan
from taxel.hand.transforms import from_rotation_vector

FRAMES = 5
"""Number of poses in each hold."""


def find_planned(name: str, approach: str):
    return next(grasp for grasp in make_thesis_plan(1) if (grasp.object, grasp.approach) == (name, approach))


@pytest.fixture
def make_hold(setup):
    """Return a function that makes a hold in which the open hand is at an object and nothing moves."""

    def make(name: str, approach: str, motion=None):
        """Return the failure check, the object poses and the bracket poses of a hold.

        motion: displacement f64[4, 4] of the object from its planned pose, in its own frame.
        """
        planned = find_planned(name, approach)
        angles = np.r_[setup.arm_path(planned)[0], setup.approach(planned).open_angles]
        brackets = np.tile(setup.kinematics.compute_sensor_poses(angles), (FRAMES, 1, 1, 1))
        pose = setup.object_pose(name) @ (np.eye(4) if motion is None else motion)
        return make_grasp_check(setup, planned), np.tile(pose, (FRAMES, 1, 1)), brackets

    return make


def make_shift(x: float, y: float, z: float) -> np.ndarray:
    """Make a translation f64[4, 4] by x, y and z metres."""
    motion = np.eye(4)
    motion[:3, 3] = x, y, z
    return motion


def make_turn(degrees: float) -> np.ndarray:
    """Make a rotation f64[4, 4] about the object's vertical axis z."""
    return from_rotation_vector(np.radians([0.0, 0.0, degrees]))


def make_tilt(degrees: float) -> np.ndarray:
    """Make a rotation f64[4, 4] about the object's horizontal axis x."""
    return from_rotation_vector(np.radians([degrees, 0.0, 0.0]))


@pytest.mark.parametrize("key", [("cylinder", "side_2"), ("rectangular_prism", "side_edge"), ("cylinder", "top")])
def test_an_object_at_rest_at_its_planned_pose_is_a_successful_grasp(make_hold, key):
    check, objects, brackets = make_hold(*key)
    assert check.find_failure(objects, brackets) is None


def test_an_object_out_of_reach_of_every_taxel_is_lost(make_hold):
    check, objects, brackets = make_hold("cylinder", "side_2", make_shift(0.0, 0.0, 0.5))
    assert check.find_failure(objects, brackets) is Failure.LOST


def test_an_object_is_toppled_if_it_is_tilted_beyond_the_angle_at_which_it_falls(make_hold, setup):
    """The cylinder falls at 10.5 degrees: its radius is 20 mm, and its centre of mass is 107.5 mm above its base."""
    limit = np.degrees(np.arctan(0.020 / 0.1075))
    for degrees, expected in ((limit - 0.1, None), (limit + 0.1, Failure.TOPPLED), (179.0, Failure.TOPPLED)):
        check, _, brackets = make_hold("cylinder", "top")
        tilted = setup.object_pose("cylinder") @ make_tilt(degrees)
        brackets = tilted @ np.linalg.inv(setup.object_pose("cylinder")) @ brackets  # the hand follows the object
        check = replace(check, other_axes=np.empty((0, 3)))  # without other approaches, the grasp cannot be "turned"
        assert check.find_failure(np.tile(tilted, (FRAMES, 1, 1)), brackets) is expected


@pytest.mark.parametrize(
    ("key", "degrees"), [(("rectangular_prism", "side_edge"), 22.2), (("triangular_prism", "side_1"), -60.0)]
)
def test_an_object_is_turned_if_the_direction_of_the_palm_is_closer_to_another_approach(make_hold, setup, key, degrees):
    """`degrees` is half the angle between the palm directions of two neighbouring approaches, in the original plan.

    The plan's palm poses were recorded in an experiment; a margin of 1.5 degrees allows for their accuracy.
    """
    check, objects, brackets = make_hold(*key)
    for beyond, expected in ((-1.5, None), (1.5, Failure.TURNED)):
        turned = objects @ make_turn(degrees + np.sign(degrees) * beyond)
        follows = turned @ np.linalg.inv(objects)  # the boards stay at the object, so that they touch it
        assert check.find_failure(turned, follows[:, None] @ brackets) is expected


def test_motion_in_the_hold_is_a_failure_beyond_half_a_pitch(make_hold, setup):
    check, objects, brackets = make_hold("cylinder", "side_2")
    for share, expected in ((0.4, None), (0.6, Failure.MOVING)):
        moving = objects.copy()
        moving[:, 2, 3] += np.linspace(0.0, share * setup.hand.pitch_m, FRAMES)
        assert check.find_failure(moving, brackets) is expected


def test_a_finger_that_moves_on_an_object_at_rest_is_no_failure(make_hold, setup):
    """Only motion of the object is a failure; a finger may still settle on an object at rest."""
    check, objects, brackets = make_hold("cylinder", "side_2")
    column = [board.name for board in setup.hand.boards].index("fingertip_middle")
    brackets[:, column, :3, 3] += np.linspace(0.02, 0.0, FRAMES)[:, None]
    assert check.find_failure(objects, brackets) is None


def test_a_timeline_without_hold_has_no_failure(make_hold):
    check, objects, brackets = make_hold("cylinder", "side_2")
    assert check.find_failure(objects[:0], brackets[:0]) is None


def run_attempts(failures: dict[float, Failure], max_attempts: int = 3):
    """Perform a grasp with `perform_attempts`; return the kept attempt and the samples in the order of execution.

    All seven samples of an attempt are the number of the attempt plus 1 (1.0 for the first attempt); 0.0 is the grasp
    without variation. The motion of an attempt is its sample. failures: failure of the grasp by its sample.
    """
    performed: list[float] = []

    def perform(sample: np.ndarray) -> float:
        performed.append(float(sample[0]))
        return performed[-1]

    attempt = perform_attempts(perform, failures.get, lambda number: np.full(7, number + 1.0), max_attempts)
    return attempt, performed


def test_a_successful_grasp_is_performed_once():
    attempt, performed = run_attempts({})
    assert (attempt.motion, attempt.attempts, attempt.failure, performed) == (1.0, 1, None, [1.0])


def test_a_failed_grasp_is_repeated_with_other_samples_until_it_succeeds():
    attempt, performed = run_attempts({1.0: Failure.LOST, 2.0: Failure.MOVING})
    assert (attempt.motion, attempt.attempts, attempt.failure, performed) == (3.0, 3, None, [1.0, 0.0, 2.0, 3.0])


def test_the_first_attempt_is_kept_and_marked_if_all_attempts_fail():
    attempt, performed = run_attempts({1.0: Failure.LOST, 2.0: Failure.MOVING, 3.0: Failure.MOVING})
    assert (attempt.motion, attempt.attempts, attempt.failure) == (1.0, 3, Failure.LOST)
    assert performed == [1.0, 0.0, 2.0, 3.0]


def test_a_failure_of_the_planned_pose_is_not_repeated():
    attempt, performed = run_attempts({1.0: Failure.TURNED, 0.0: Failure.TURNED})
    assert (attempt.motion, attempt.attempts, attempt.failure, performed) == (1.0, 1, Failure.TURNED, [1.0, 0.0])


def test_a_failed_grasp_is_not_repeated_if_only_one_attempt_is_permitted():
    attempt, performed = run_attempts({1.0: Failure.LOST}, max_attempts=1)
    assert (attempt.attempts, attempt.failure, performed) == (1, Failure.LOST, [1.0])
