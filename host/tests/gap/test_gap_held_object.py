"""An object between two boards at an angle, held elsewhere: who bears more, and by how much."""

from __future__ import annotations

import numpy as np
import pytest

from host.tests.gap.test_gap_pressed_anew import HARDENING, ball, pressed_to
from taxel.gap.effects import geometry as geometry_module
from taxel.gap.effects.geometry import LEVELS, Contact, Geometry
from taxel.gap.effects.held_object import LEAST_SHARE, Push, pushes_together, shifted_load
from taxel.hand.transforms import from_rotation_vector

SLOPE = np.sqrt(0.5)
LEFT = Push(0, 5.0, np.array([SLOPE, 0.0, SLOPE]), np.array([-0.01, 0.0, 0.0]))
RIGHT = Push(3, 5.0, np.array([-SLOPE, 0.0, SLOPE]), np.array([0.01, 0.0, 0.0]))


def seen(x_m: float, z_m: float = 0.0) -> np.ndarray:
    """A board's motion as an object sees it that has itself moved by so much."""
    motion = np.eye(4)
    motion[:3, 3] = -x_m, 0.0, -z_m
    return motion


def test_a_laterally_held_object_redistributes_the_forces_of_two_inclined_boards():
    held = 3000.0
    more = shifted_load([LEFT, RIGHT], [seen(0.001)] * 2, [held] * 2)
    # Towards the right: the right board pushes it to the left by what the hold bears.
    assert more[3] > 0 > more[0]
    across = SLOPE * (5.0 + more[0]) - SLOPE * (5.0 + more[3])
    assert across == pytest.approx(-held * 0.001)
    assert more[0] + more[3] == pytest.approx(0.0, abs=1e-12)  # the push along its way is what it was


def test_displacement_along_the_contact_direction_changes_no_force_share():
    more = shifted_load([LEFT, RIGHT], [seen(0.0, 0.002)] * 2, [3000.0] * 2)
    assert more == pytest.approx({0: 0.0, 3: 0.0}, abs=1e-12)


def test_without_holding_stiffness_the_force_shares_are_unchanged():
    assert shifted_load([LEFT, RIGHT], [seen(0.001)] * 2, [0.0] * 2) == pytest.approx({0: 0.0, 3: 0.0})


def test_the_force_of_a_board_has_a_lower_limit():
    more = shifted_load([LEFT, RIGHT], [seen(0.02)] * 2, [3000.0] * 2)
    assert more[0] == pytest.approx((LEAST_SHARE - 1.0) * 5.0)


def test_only_boards_that_push_in_one_direction_are_coupled_by_the_object():
    against = Push(7, 5.0, -LEFT.direction, np.zeros(3))
    assert pushes_together({0: [LEFT], 1: [LEFT, RIGHT], 2: [LEFT, against]}) == [[LEFT, RIGHT]]


def test_taxel_forces_of_coupled_boards_follow_their_changed_net_forces(monkeypatch):
    depth, force = ball(), 6.0
    pressure = pressed_to(HARDENING, depth, force)
    up, points = np.repeat([[0.0, 0.0, 1.0]], 49, axis=0), np.zeros((49, 9, 3))
    poses = [from_rotation_vector(np.array([0.0, turn, 0.0])) for turn in (np.pi / 4, -np.pi / 4)]
    contacts = tuple(
        Contact(0, board, np.arange(49), pressure.mean(axis=1), points, up, pose) for board, pose in enumerate(poses)
    )
    corner = Geometry(contacts, {}, HARDENING, HARDENING, (depth, depth), (pressure, pressure))
    monkeypatch.setattr(geometry_module, "piece_depths", lambda state, meshes, own, poses: [depth for _ in own])
    assert [[push.number for push in own] for own in corner.together] == [[0, 1]]
    aside = dict.fromkeys((0, 1), seen(0.001))
    held = dict.fromkeys((0, 1), 1000.0)
    more = shifted_load(corner.together[0], [aside[0], aside[1]], [1000.0, 1000.0])
    changed = corner.displaced(None, aside, held)
    for number, (kept, gained) in changed.items():
        rest = np.array([pressed_to(HARDENING, depth, level * force).mean(axis=1) for level in LEVELS])
        net = (kept * rest + gained).sum(axis=1)
        wanted = LEVELS * force + more[number]
        np.testing.assert_allclose(net, np.maximum(wanted, LEAST_SHARE * LEVELS * force), rtol=1e-6)
    freely = corner.displaced(None, aside)
    assert all((kept == 1.0).all() and (gained == 0.0).all() for kept, gained in freely.values())
