"""Forces of two inclined boards in contact with an object that is held at another position."""

from __future__ import annotations

import numpy as np
import pytest

from host.tests.gap.test_gap_contact_forces import HARDENING, make_ball_depths, solve_pressure
from taxel.gap.effects import geometry as geometry_module
from taxel.gap.effects.board_contacts import BoardContact
from taxel.gap.effects.force_changes import LEVELS
from taxel.gap.effects.geometry import ContactGeometry
from taxel.gap.effects.held_object import MIN_FORCE_SHARE, Push, compute_load_shifts, find_coupled_pushes
from taxel.hand.transforms import from_rotation_vector

SLOPE = np.sqrt(0.5)
FORCE_N = 5.0
LEFT_CONTACT, RIGHT_CONTACT = 0, 3
"""Indices of the contacts of the two boards, which are keys of the results (arbitrary)."""

LEFT_PUSH = Push(LEFT_CONTACT, FORCE_N, direction=np.array([SLOPE, 0.0, SLOPE]), place=np.array([-0.01, 0.0, 0.0]))
RIGHT_PUSH = Push(RIGHT_CONTACT, FORCE_N, direction=np.array([-SLOPE, 0.0, SLOPE]), place=np.array([0.01, 0.0, 0.0]))
"""Forces of a left board, which pushes the object upwards and to the right, and of a right board, upwards and to the
left."""


def move_object(x_m: float, z_m: float = 0.0) -> np.ndarray:
    """Return the motion of a board in the frame of an object that moves by x_m and z_m, f64[4, 4]."""
    motion = np.eye(4)
    motion[:3, 3] = -x_m, 0.0, -z_m
    return motion


def test_lateral_holding_force_of_an_object_is_distributed_over_two_inclined_boards():
    """Both boards push upwards at 45 degrees, one to the right, one to the left; SLOPE is the cosine of 45 degrees."""
    holding_stiffness = 3000.0
    force_changes = compute_load_shifts([LEFT_PUSH, RIGHT_PUSH], [move_object(0.001)] * 2, [holding_stiffness] * 2)
    # The object moves to the right: the right board pushes back with the force of the holding stiffness.
    assert force_changes[RIGHT_CONTACT] > 0 > force_changes[LEFT_CONTACT]
    lateral_force = SLOPE * (FORCE_N + force_changes[LEFT_CONTACT]) - SLOPE * (FORCE_N + force_changes[RIGHT_CONTACT])
    assert lateral_force == pytest.approx(-holding_stiffness * 0.001)
    # The upward force, SLOPE times the sum of both contact forces, is unchanged.
    assert force_changes[LEFT_CONTACT] + force_changes[RIGHT_CONTACT] == pytest.approx(0.0, abs=1e-12)


def test_displacement_along_the_contact_direction_changes_no_force():
    force_changes = compute_load_shifts([LEFT_PUSH, RIGHT_PUSH], [move_object(0.0, 0.002)] * 2, [3000.0] * 2)
    assert force_changes == pytest.approx({LEFT_CONTACT: 0.0, RIGHT_CONTACT: 0.0}, abs=1e-12)


def test_without_holding_stiffness_the_forces_are_unchanged():
    force_changes = compute_load_shifts([LEFT_PUSH, RIGHT_PUSH], [move_object(0.001)] * 2, [0.0] * 2)
    assert force_changes == pytest.approx({LEFT_CONTACT: 0.0, RIGHT_CONTACT: 0.0})


def test_the_force_of_a_board_keeps_its_smallest_share():
    force_changes = compute_load_shifts([LEFT_PUSH, RIGHT_PUSH], [move_object(0.02)] * 2, [3000.0] * 2)
    assert force_changes[LEFT_CONTACT] == pytest.approx((MIN_FORCE_SHARE - 1.0) * FORCE_N)


def test_only_boards_that_push_in_one_direction_are_coupled_by_the_object():
    opposite_push = Push(7, FORCE_N, direction=-LEFT_PUSH.direction, place=np.zeros(3))
    single_board, one_direction, clamped = [LEFT_PUSH], [LEFT_PUSH, RIGHT_PUSH], [LEFT_PUSH, opposite_push]
    assert find_coupled_pushes({0: single_board, 1: one_direction, 2: clamped}) == [one_direction]


def test_taxel_forces_of_coupled_boards_follow_their_changed_net_forces(monkeypatch):
    """Two boards, turned by 45 degrees in opposite directions, carry the same object, which is held 1 mm aside.

    The new force of a taxel is kept * simulated force + gained. The sum over a board must be its changed net force, but
    at least `MIN_FORCE_SHARE` of the simulated net force. Without a holding stiffness, no force changes.
    """
    depth, force = make_ball_depths(), 6.0
    pressure = solve_pressure(HARDENING, depth, force)
    up, points = np.repeat([[0.0, 0.0, 1.0]], 49, axis=0), np.zeros((49, 9, 3))
    poses = [from_rotation_vector(np.array([0.0, turn, 0.0])) for turn in (np.pi / 4, -np.pi / 4)]
    contacts = tuple(
        BoardContact(0, 0, board, np.arange(49), pressure.mean(axis=1), points, up, pose)
        for board, pose in enumerate(poses)
    )
    geometry = ContactGeometry(contacts, {}, HARDENING, HARDENING, (depth, depth), (pressure, pressure))
    monkeypatch.setattr(
        geometry_module, "compute_piece_depths", lambda state, meshes, contacts, poses: [depth for _ in contacts]
    )
    assert [[push.number for push in pushes] for pushes in geometry.coupled_pushes] == [[0, 1]]
    motions = dict.fromkeys((0, 1), move_object(0.001))
    holding_stiffness = dict.fromkeys((0, 1), 1000.0)
    force_changes = compute_load_shifts(geometry.coupled_pushes[0], [motions[0], motions[1]], [1000.0, 1000.0])
    changed = geometry.compute_displacement_changes(None, motions, holding_stiffness)
    for number, (kept, gained) in changed.items():
        simulated = np.array([solve_pressure(HARDENING, depth, level * force).mean(axis=1) for level in LEVELS])
        net = (kept * simulated + gained).sum(axis=1)
        expected = LEVELS * force + force_changes[number]
        np.testing.assert_allclose(net, np.maximum(expected, MIN_FORCE_SHARE * LEVELS * force), rtol=1e-6)
    without_stiffness = geometry.compute_displacement_changes(None, motions)
    assert all((kept == 1.0).all() and (gained == 0.0).all() for kept, gained in without_stiffness.values())
