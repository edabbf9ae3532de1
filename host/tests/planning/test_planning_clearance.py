"""Distances, the bound between samples, and the agreement with an independent model of the bodies."""

import itertools

import numpy as np
import pytest

from taxel.grasp.objects import GraspObject
from taxel.grasp.shapes import ConvexPolytope
from taxel.hand.transforms import make_pose
from taxel.planning.bodies import CLEARANCE_M, HAND_CLEARANCE_M, BodyModel, Surroundings
from taxel.planning.clearance import FLOOR_SHARE, Clearances

SEED = 40


@pytest.fixture(scope="module")
def clearances(setup, planner) -> Clearances:
    return planner.get_clearances(setup.objects["cylinder"], setup.object_pose("cylinder"))


def sample_postures(setup, count: int) -> np.ndarray:
    """Sample random postures of arm and hand within the joint limits and one turn, f64[count, 22]."""
    print(f"seed {SEED}")
    robot = setup.kinematics.robot
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    return np.random.default_rng(SEED).uniform(low, high, (count, len(low)))


def find_pairs(clearances, *labels: str) -> list[int]:
    """Return the indices of the pairs whose two bodies have these labels."""
    return [
        k
        for k in range(len(clearances.all_pairs))
        if set(clearances.bodies.format_pair(k).split(" and ")) == set(labels)
    ]


def test_boards_links_table_and_object_are_bodies_and_neighbours_are_not_paired(clearances, setup):
    labels = [body.label for body in clearances.bodies.bodies]
    assert {f"board {board.name}" for board in setup.hand.boards} <= set(labels)
    assert {"link upper_arm", "link forearm", "link wrist_2", "link palm", "table", "object cylinder"} <= set(labels)
    assert find_pairs(clearances, "board palm", "table")
    assert find_pairs(clearances, "link forearm", "object cylinder")
    assert find_pairs(clearances, "link upper_arm", "board fingertip_index")
    assert not find_pairs(clearances, "link upper_arm", "link forearm")
    assert not find_pairs(clearances, "link base", "table")


def test_pairs_within_the_hand_need_less_clearance(clearances):
    (pair,) = find_pairs(clearances, "board palm", "table")
    assert clearances.bodies.clearance[pair] == CLEARANCE_M
    (pair,) = find_pairs(clearances, "board fingertip_index", "board fingertip_middle")
    assert clearances.bodies.clearance[pair] == HAND_CLEARANCE_M


def test_an_object_above_the_table_stands_on_a_stand(setup):
    """The table is at 0.02 m, the object at 0.12 m: the stand is 0.1 m high and has the base of the object."""
    item = GraspObject("box", ConvexPolytope.box(0.06, 0.04, 0.1), "box")
    pose = make_pose([0.5, 0.0, 0.12], [1.0, 0.0, 0.0, 0.0])
    model = BodyModel(setup.kinematics.robot, setup.hand, Surroundings(0.02, item, pose))
    stand = next(k for k, body in enumerate(model.bodies) if body.label == "stand")
    geom = int(model.geom_ids[stand])
    assert model.model.geom_size[geom] == pytest.approx([0.03, 0.02, 0.05])
    assert model.model.geom_pos[geom] == pytest.approx([0.5, 0.0, 0.07])


def test_no_posture_without_collision_overlaps_by_the_independent_check(clearances, independent, setup):
    """The boards of the planner are slightly wider, so the planner rejects a few postures without an overlap, too."""
    postures = sample_postures(setup, 150)
    zero = np.zeros(len(clearances.all_pairs))
    is_free = np.array([clearances.find_collision(angles, zero) is None for angles in postures])
    overlaps = [independent.find_overlap(angles) for angles in postures]
    assert 5 < is_free.sum() < 100
    for free, overlap in zip(is_free, overlaps, strict=True):
        assert not (free and overlap is not None), overlap
    missed = [overlap for free, overlap in zip(is_free, overlaps, strict=True) if not free and overlap is None]
    assert len(missed) <= 0.05 * len(postures)


def test_no_distance_of_a_pair_changes_by_more_than_the_bound(clearances, setup):
    """The distance of a pair changes at most by lever arm times joint angle, summed over the joints."""
    postures = sample_postures(setup, 40)
    limit = np.full(len(clearances.all_pairs), 3.0)
    for begin, target in itertools.pairwise(postures):
        end = begin + 0.05 * (target - begin)
        change = np.abs(clearances.measure(end, limit) - clearances.measure(begin, limit))
        assert (change <= clearances.bodies.reach @ np.abs(end - begin) + 1e-6).all()


def test_a_collision_between_two_free_ends_of_a_segment_is_found(clearances, upright):
    """The stretched forearm turns above the table and passes through the cylinder."""
    begin, end = upright.copy(), upright.copy()
    begin[:6] = [np.pi / 2 - 0.5, 0.0, 0.0, 0.0, 0.0, 0.0]
    end[:6] = [np.pi / 2 + 0.5, 0.0, 0.0, 0.0, 0.0, 0.0]
    forearm = find_pairs(clearances, "link forearm", "object cylinder")
    required = np.full(len(clearances.all_pairs), -10.0)  # an overlap of 10 m is permitted: only one pair is checked
    required[forearm] = CLEARANCE_M
    for posture in (begin, end):
        assert (clearances.measure(posture, np.full(len(required), 0.5))[forearm] > 0.05).all()
    collision = clearances.check_segment(begin, end, required, np.where(required > 0, 0.0, -20.0))
    assert collision is not None
    assert collision.pair in forearm
    assert 0 < collision.share < 1


@pytest.mark.parametrize("index", range(3))
def test_free_segments_keep_the_floor_at_a_fine_resolution(clearances, setup, upright, index):
    """An accepted segment guarantees the floor, `FLOOR_SHARE` of the required clearance, also between its samples."""
    rng = np.random.default_rng([SEED, index])
    print(f"seed {[SEED, index]}")
    required = clearances.bodies.clearance
    is_arm_joint = np.arange(22) < 6
    ends = (upright + 0.6 * rng.normal(size=22) * is_arm_joint for _ in range(200))
    end = next(end for end in ends if clearances.check_segment(upright, end, required) is None)
    postures = upright + np.linspace(0, 1, 150)[:, None] * (end - upright)
    excess = [clearances.measure(posture, required) - FLOOR_SHARE * required for posture in postures]
    assert np.min(excess) >= 0
