"""Forces of two inclined boards in contact with an object that is held at another position."""

from __future__ import annotations

import numpy as np
import pytest

from host.tests.gap.test_gap_contact_forces import HARDENING, make_ball_depths, solve_pressure
from taxel.gap.effects import geometry as geometry_module
from taxel.gap.effects.geometry import LEVELS, BoardContact, ContactGeometry
from taxel.gap.effects.held_object import MIN_FORCE_SHARE, Push, compute_load_shifts, find_coupled_pushes
from taxel.hand.transforms import from_rotation_vector

SLOPE = np.sqrt(0.5)
LEFT_PUSH = Push(0, 5.0, np.array([SLOPE, 0.0, SLOPE]), np.array([-0.01, 0.0, 0.0]))
RIGHT_PUSH = Push(3, 5.0, np.array([-SLOPE, 0.0, SLOPE]), np.array([0.01, 0.0, 0.0]))


def move_object(x_m: float, z_m: float = 0.0) -> np.ndarray:
    """Return the motion of a board in the frame of an object that moves by x_m and z_m, f64[4, 4]."""
    motion = np.eye(4)
    motion[:3, 3] = -x_m, 0.0, -z_m
    return motion


def test_a_laterally_held_object_redistributes_the_forces_of_two_inclined_boards():
    holding_stiffness = 3000.0
    force_changes = compute_load_shifts([LEFT_PUSH, RIGHT_PUSH], [move_object(0.001)] * 2, [holding_stiffness] * 2)
    # The object moves to the right: the right board pushes back with the force of the holding stiffness.
    assert force_changes[3] > 0 > force_changes[0]
    lateral_force = SLOPE * (5.0 + force_changes[0]) - SLOPE * (5.0 + force_changes[3])
    assert lateral_force == pytest.approx(-holding_stiffness * 0.001)
    # The force along the contact direction is unchanged.
    assert force_changes[0] + force_changes[3] == pytest.approx(0.0, abs=1e-12)


def test_displacement_along_the_contact_direction_changes_no_force_share():
    force_changes = compute_load_shifts([LEFT_PUSH, RIGHT_PUSH], [move_object(0.0, 0.002)] * 2, [3000.0] * 2)
    assert force_changes == pytest.approx({0: 0.0, 3: 0.0}, abs=1e-12)


def test_without_holding_stiffness_the_force_shares_are_unchanged():
    assert compute_load_shifts([LEFT_PUSH, RIGHT_PUSH], [move_object(0.001)] * 2, [0.0] * 2) == pytest.approx(
        {0: 0.0, 3: 0.0}
    )


def test_the_force_of_a_board_has_a_lower_limit():
    force_changes = compute_load_shifts([LEFT_PUSH, RIGHT_PUSH], [move_object(0.02)] * 2, [3000.0] * 2)
    assert force_changes[0] == pytest.approx((MIN_FORCE_SHARE - 1.0) * 5.0)


def test_only_boards_that_push_in_one_direction_are_coupled_by_the_object():
    opposite_push = Push(7, 5.0, -LEFT_PUSH.direction, np.zeros(3))
    assert find_coupled_pushes({0: [LEFT_PUSH], 1: [LEFT_PUSH, RIGHT_PUSH], 2: [LEFT_PUSH, opposite_push]}) == [
        [LEFT_PUSH, RIGHT_PUSH]
    ]


def test_taxel_forces_of_coupled_boards_follow_their_changed_net_forces(monkeypatch):
    depth, force = make_ball_depths(), 6.0
    pressure = solve_pressure(HARDENING, depth, force)
    up, points = np.repeat([[0.0, 0.0, 1.0]], 49, axis=0), np.zeros((49, 9, 3))
    poses = [from_rotation_vector(np.array([0.0, turn, 0.0])) for turn in (np.pi / 4, -np.pi / 4)]
    contacts = tuple(
        BoardContact(0, board, np.arange(49), pressure.mean(axis=1), points, up, pose)
        for board, pose in enumerate(poses)
    )
    geometry = ContactGeometry(contacts, {}, HARDENING, HARDENING, (depth, depth), (pressure, pressure))
    monkeypatch.setattr(geometry_module, "compute_piece_depths", lambda state, meshes, own, poses: [depth for _ in own])
    assert [[push.number for push in own] for own in geometry.coupled_pushes] == [[0, 1]]
    motions = dict.fromkeys((0, 1), move_object(0.001))
    holding_stiffness = dict.fromkeys((0, 1), 1000.0)
    force_changes = compute_load_shifts(geometry.coupled_pushes[0], [motions[0], motions[1]], [1000.0, 1000.0])
    changed = geometry.compute_displacement_changes(None, motions, holding_stiffness)
    for number, (kept, gained) in changed.items():
        rest = np.array([solve_pressure(HARDENING, depth, level * force).mean(axis=1) for level in LEVELS])
        net = (kept * rest + gained).sum(axis=1)
        expected = LEVELS * force + force_changes[number]
        np.testing.assert_allclose(net, np.maximum(expected, MIN_FORCE_SHARE * LEVELS * force), rtol=1e-6)
    without_stiffness = geometry.compute_displacement_changes(None, motions)
    assert all((kept == 1.0).all() and (gained == 0.0).all() for kept, gained in without_stiffness.values())
