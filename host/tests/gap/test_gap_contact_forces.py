"""Contact forces recomputed with the force law of the layer at the net forces of the simulator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from taxel.gap.data.pair import read_pair
from taxel.gap.effects import geometry as geometry_module
from taxel.gap.effects.board_contacts import BoardContact
from taxel.gap.effects.effect import BOARD
from taxel.gap.effects.force_changes import LEVELS, apply_change, make_neutral_change
from taxel.gap.effects.geometry import ContactGeometry
from taxel.gap.effects.layer_law import BOARDS_PER_BATCH, ForceDepthLaw, fit_piece_law, solve_board_pressures
from taxel.gap.effects.pose_error import PoseError
from taxel.gap.effects.stiffness import Sinking, Stiffness
from taxel.gap.features.features import FeatureLayout
from taxel.gap.fitting.state import build_state

HARDENING = ForceDepthLaw(np.array([0.0, 5e-4, 1e-3, 1.5e-3]), np.array([0.0, 0.2, 1.0, 3.0]))


def solve_pressures(law: ForceDepthLaw, depth: np.ndarray, nets: np.ndarray) -> np.ndarray:
    """Return the pressures of one board at L net forces in N, f64[L, m, 9]."""
    return solve_board_pressures(law, [depth], nets[None])[0]


def solve_pressure(law: ForceDepthLaw, depth: np.ndarray, net_n: float) -> np.ndarray:
    """Return the pressures of one board at one net force in N, f64[m, 9]."""
    return solve_pressures(law, depth, np.array([net_n]))[0]


def make_ball_depths(height_m: float = 0.0, pitch_m: float = 5e-3) -> np.ndarray:
    """Return the depth of a ball with a radius of 15 mm in the nine pieces of 7 x 7 taxels in metres, f64[49, 9]."""
    taxel = pitch_m * (np.arange(7) - 3.0)
    piece = pitch_m * np.array([-1.0, 0.0, 1.0]) / 3.0
    along = (taxel[:, None] + piece).ravel()
    x, y = np.meshgrid(along, along, indexing="ij")
    depth = np.sqrt(np.maximum(0.015**2 - x**2 - y**2, 0.0)) - 0.015 + height_m
    return depth.reshape(7, 3, 7, 3).transpose(0, 2, 1, 3).reshape(49, 9)


def make_geometry(net_n: float = 12.0) -> ContactGeometry:
    """Return the geometry of one board in contact with a ball."""
    depth = make_ball_depths()
    pressure = solve_pressure(HARDENING, depth, net_n)
    nowhere = np.zeros((49, 9, 3))
    contact = BoardContact(0, 0, 0, np.arange(49), pressure.mean(axis=1), nowhere, nowhere[:, 0], np.eye(4))
    return ContactGeometry((contact,), {}, HARDENING, HARDENING, (depth,), (pressure,))


def test_the_pressures_of_a_board_add_up_to_each_net_force():
    """The board is shifted towards the ball until its force equals the net force.

    Pressures are f64[L, m, 9] in newtons (L net forces, m taxels, 9 pieces of each taxel). The force of a taxel is the
    mean over its pieces, and the net force is the sum over the taxels.
    """
    depth, nets = make_ball_depths(), np.array([0.3, 2.0, 9.0, 40.0])
    pressed = solve_pressures(HARDENING, depth, nets)
    np.testing.assert_allclose(pressed.mean(axis=2).sum(axis=1), nets, rtol=1e-9)
    for net, pressure in zip(nets.tolist(), pressed, strict=True):
        np.testing.assert_allclose(solve_pressure(HARDENING, depth, net), pressure, rtol=1e-12)
    loaded_pieces = (pressed > 0.0).sum(axis=(1, 2))
    assert (np.diff(loaded_pieces) >= 0).all()  # the larger the net force, the larger the contact area


def test_boards_solved_together_have_the_forces_of_single_boards():
    """The boards have different sizes and fill more than one batch; one board has contact only at its last taxel."""
    rng = np.random.default_rng(5)
    depths = [
        make_ball_depths(height)[: rng.integers(20, 49)] for height in rng.uniform(-2e-3, 2e-3, BOARDS_PER_BATCH + 3)
    ]
    depths.append(np.full((5, 9), -1.0))
    depths[-1][4, 8] = -0.02
    nets = rng.uniform(0.2, 30.0, (len(depths), 3))
    nets[-1] = 0.2, 0.01, 0.1  # one piece alone
    for depth, net, pressed in zip(depths, nets, solve_board_pressures(HARDENING, depths, nets), strict=True):
        np.testing.assert_allclose(pressed, solve_pressures(HARDENING, depth, net), rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(pressed.mean(axis=2).sum(axis=1), net, rtol=1e-9)
    assert solve_board_pressures(HARDENING, [], np.zeros((0, 3))) == []


def test_the_force_law_of_pieces_is_recovered_from_taxel_forces():
    """From a linear initial law, the fit finds the hardening of the layer."""
    rng = np.random.default_rng(3)
    depths = [make_ball_depths() + rng.uniform(-3e-3, 3e-3) for _ in range(6)]
    nets = range(3, 21, 3)
    forces = [solve_pressure(HARDENING, depth, net).mean(axis=1) for depth, net in zip(depths, nets, strict=True)]
    line = ForceDepthLaw(np.array([0.0, 1e-3]), np.array([0.0, 1.0]))
    contacts = list(zip(depths, forces, strict=True))
    found = fit_piece_law(line, contacts)

    def compute_largest_error(law: ForceDepthLaw) -> float:
        return max(float(np.abs(solve_pressure(law, d, f.sum()).mean(axis=1) - f).max()) for d, f in contacts)

    assert compute_largest_error(found) < 0.2 * compute_largest_error(line)
    assert fit_piece_law(HARDENING, contacts) is HARDENING  # no other law fits better
    assert fit_piece_law(line, []) is line


def test_a_softer_layer_spreads_the_same_net_force_over_more_taxels():
    pressed = make_geometry()
    simulated = np.asarray(solve_pressures(HARDENING, pressed.depths[0], 12.0 * LEVELS)).mean(axis=2)
    soft, hard = (
        kept * simulated + gained
        for kept, gained in (pressed.compute_stiffness_changes({0: scale})[0] for scale in (0.5, 2.0))
    )
    assert soft.shape == (len(LEVELS), 49)
    for now in (soft, hard):
        np.testing.assert_allclose(now.sum(axis=1), 12.0 * LEVELS, rtol=1e-8)
    hold, middle = int(np.flatnonzero(LEVELS == 1.0)[0]), 24  # taxel 24 is in the middle of 7 x 7 taxels
    assert soft[hold, middle] < simulated[hold, middle] < hard[hold, middle]
    assert (soft[hold] > 1e-9).sum() > (simulated[hold] > 1e-9).sum() >= (hard[hold] > 1e-9).sum()


@pytest.fixture(scope="module")
def state(write_world, tmp_path_factory):
    """State of the simulation of a world, without features. All taxels of a board have the same separation, because the
    object is a cube.
    """
    pair = read_pair(*write_world(tmp_path_factory.mktemp("pressed")))
    layout = FeatureLayout.from_time_grid(pair.time_grid)
    state = build_state(pair, layout, np.zeros((len(pair.conditions), layout.count, pair.n)))
    separation = state.base.separation.copy()
    for board in pair.boards:
        separation[..., board.taxels] = separation[..., board.taxels].mean(axis=2, keepdims=True)
    return replace(state, base=replace(state.base, separation=separation))


def test_force_changes_are_interpolated_between_net_force_levels(state):
    """A change has for each taxel and level of the net force a factor (index 0) and an added force in N (index 1).

    The added force is 0.01 N at the level 1, the hold, and 0 without contact.
    """
    change = make_neutral_change(state)
    np.testing.assert_allclose(apply_change(state, state.base, change).force, state.base.force, rtol=1e-12)
    change[:, 1] += (0.01 * LEVELS**2)[:, None]
    moved = apply_change(state, state.base, change)
    hold = state.base.force.sum(axis=2).mean(axis=0) > 0.99 * state.base.force.sum(axis=2).mean(axis=0).max()
    pressed = state.base.force[:, hold].mean(axis=1) > 0.1
    gained = (moved.force - state.base.force)[:, hold].mean(axis=1)
    np.testing.assert_allclose(gained[pressed], 0.01, rtol=0.02)
    nothing = state.base.force.sum(axis=2) == 0.0
    np.testing.assert_array_equal(moved.force[nothing], 0.0)


def test_taxels_that_lose_contact_have_no_force(state):
    """The force of these taxels is exactly 0, however much the simulated force differs from that of the geometry."""
    change = make_neutral_change(state)
    change[:, 0, :, :10] = 0.0
    moved = apply_change(state, state.base, change)
    np.testing.assert_array_equal(moved.force[:, :, :10], 0.0)
    np.testing.assert_allclose(moved.force[:, :, 10:], state.base.force[:, :, 10:], rtol=1e-12)


def test_on_a_flat_contact_both_stiffness_models_agree(state):
    """The face of the cube has the same depth on all taxels, where both forms of the stiffness are equal."""
    half = np.array([[0.6]])
    plain, sinking = (form.apply(state, state.base, half) for form in (Stiffness(), Sinking()))
    assert plain.law_scale == pytest.approx(0.6)
    assert sinking.law_scale == pytest.approx(0.6)
    np.testing.assert_allclose(sinking.force, plain.force, atol=5e-3)  # poses are estimated to some micrometres


def test_displacement_along_the_normal_of_a_flat_board_is_not_identifiable(state):
    """A rotated board is shifted along its normal until its net force is kept, so a displacement along the normal has
    no influence. The reported translation refers to the frame before the rotation.
    """
    form = PoseError(BOARD)
    # Translations x, y, z in mm and rotations in degrees of both boards.
    rotated = np.array([[1.13, 0.37], [0.29, 1.21], [0.0, 0.0], [2.0, 0.7], [-3.0, 1.1], [1.3, 0.4]])
    shifted = rotated.copy()
    shifted[2] = 2.0  # along the normal
    one, other = (form.apply(state, state.base, values).force for values in (rotated, shifted))
    np.testing.assert_allclose(other, one, atol=1e-6)
    assert np.abs(one - state.base.force).max() > 0.01
    reported = form.convert_to_reported(shifted)
    np.testing.assert_array_equal(reported[3:], shifted[3:])
    np.testing.assert_allclose(np.linalg.norm(reported[:3], axis=0), np.linalg.norm(shifted[:3], axis=0))
    assert np.abs(reported[:3] - shifted[:3]).max() > 0.1


def test_cached_contacts_stay_below_the_memory_limit(monkeypatch):
    geometry = make_geometry()
    size = geometry.compute_stiffness_changes({0: 1.5})[0].nbytes
    monkeypatch.setattr(geometry_module, "MAX_CACHE_BYTES", 3 * size)
    for scale in np.linspace(0.5, 2.0, 12):
        geometry.compute_stiffness_changes({0: scale})
        assert sum(change.nbytes for change in geometry._cache.values()) <= 3 * size
