"""The C dynamics of hand and object agree with a reference in NumPy on random states."""

from collections.abc import Iterator

import numpy as np
import pytest

from host.tests.campaign.reference_dynamics import ReferenceHand, ReferenceObject
from taxel.campaign.free_object import FreeObject
from taxel.campaign.hand_in_contact import HandInContact
from taxel.emulated.contact import SkinContact
from taxel.emulated.scene import EmulatedScene, format_scene
from taxel.grasp.controller import GraspController
from taxel.grasp.timeline import Timeline
from taxel.hand.transforms import from_rotation_vector

PERIOD_S = 0.003
TICKS = 220
SEEDS = range(3)
QUICK = Timeline(baseline_s=0.0, closing_s=0.3, hold_s=9.0, release_s=0.0, recovery_s=0.0)
TOLERANCE = 1e-10
"""Largest difference in metres and radians: rounding errors are below 1e-13."""


def make_offset(rng: np.random.Generator, metres: float, radians: float) -> np.ndarray:
    """Make a random small rigid motion f64[4, 4]. metres, radians: standard deviations per axis."""
    offset = from_rotation_vector(rng.normal(scale=radians, size=3))
    offset[:3, 3] = rng.normal(scale=metres, size=3)
    return offset


@pytest.fixture(scope="module")
def contacts(setup) -> Iterator[tuple[SkinContact, SkinContact]]:
    """Yield two contact solvers of the same skin with the same objects; each one contains the state of one hand."""
    rng = np.random.default_rng(2)
    brackets = {board.name: make_offset(rng, 2e-4, 0.01) for board in setup.hand.boards}
    shapes = {name: item.shape for name, item in setup.objects.items()}
    world = format_scene(setup.hand, EmulatedScene(shapes, brackets))
    with SkinContact(world) as first, SkinContact(world) as second:
        yield first, second


@pytest.fixture(params=SEEDS)
def rng(request) -> np.random.Generator:
    print(f"seed {request.param}")
    return np.random.default_rng(request.param)


@pytest.fixture
def random_object(rng, setup):
    """Return the name of a random object, and this object and its reference in the same random pose."""
    name = sorted(setup.objects)[int(rng.integers(len(setup.objects)))]
    shape, pose = setup.objects[name].shape, setup.object_pose(name) @ make_offset(rng, 1e-3, 0.02)
    item, reference = FreeObject(shape, pose), ReferenceObject(shape, pose)
    for each in (item, reference):  # in the first pose, rounding errors decide whether a vertex touches the stand
        each.move(np.array([0.0, 0.0, -2e-6, 0.0, 0.0, 0.0]), 1.0)
    return name, item, reference


def test_support_and_motion_of_an_object_agree_with_the_reference(random_object, rng):
    """The velocities (m/s, rad/s) are random, with a mean of 0.01 m/s downwards, towards the support."""
    _, item, reference = random_object
    for _ in range(40):
        velocity = rng.normal(scale=[0.02, 0.02, 0.02, 0.3, 0.3, 0.3]) - [0.0, 0.0, 0.01, 0.0, 0.0, 0.0]
        item.move(velocity, PERIOD_S)
        reference.move(velocity, PERIOD_S)
        assert item.pose == pytest.approx(reference.pose, abs=1e-13)
        for found, expected in zip(item.compute_support(), reference.compute_support(), strict=True):
            assert found == pytest.approx(expected, abs=1e-7 * max(1.0, np.abs(expected).max()))


def test_the_load_of_the_steadying_hand_agrees_with_the_reference(random_object, rng):
    """The firmness is 1 for a hand that steadies the object fully, and 0 for no hand.

    The sequence contains a hand that is withdrawn (0.0) and applied again (0.7).
    """
    _, item, reference = random_object
    for firmness in (1.0, 0.4, 0.0, 0.0, 0.7, 1.0):
        velocity = rng.normal(scale=[0.5, 0.5, 0.5, 20.0, 20.0, 20.0])
        for each in (item, reference):
            each.steady(firmness)
            each.move(velocity, PERIOD_S)
        for found, expected in zip(item.compute_steadying(), reference.compute_steadying(), strict=True):
            assert found == pytest.approx(expected, abs=1e-9 * max(1.0, np.abs(expected).max()))


def test_the_motion_of_a_closing_hand_agrees_with_the_reference(random_object, rng, setup, contacts):
    """The wrist moves, the experimenter lets go, the fingers close, and random torques disturb them."""
    name, item, reference_item = random_object
    approaches = setup.approaches_to(name)
    approach = approaches[sorted(approaches)[int(rng.integers(len(approaches)))]]
    wrist = setup.object_pose(name) @ approach.palm_pose
    index = list(setup.objects).index(name)
    arguments = (wrist, approach.open_angles)
    hand = HandInContact(setup.hand, setup.wrist_robot, contacts[0], index, item, *arguments)
    reference = ReferenceHand(setup.hand, setup.wrist_robot, contacts[1], index, reference_item, *arguments)
    controller, touched = GraspController(approach, QUICK), 0
    for tick in range(TICKS):
        noise = rng.normal(scale=0.01, size=16)
        torque = controller.compute_torque(PERIOD_S * tick, reference.angles, reference.velocities) + noise
        shifted = wrist.copy()
        shifted[:3, 3] += rng.normal(scale=2e-5, size=3)
        for each in (hand, reference):
            each.steady_object(1.0 if tick < TICKS // 2 else 0.1)
            each.hold_wrist(shifted)
            each.step(torque, PERIOD_S)
        assert hand.touched_count == reference.touched_count
        touched = max(touched, hand.touched_count)
    assert touched >= 2
    assert hand.angles == pytest.approx(reference.angles, abs=TOLERANCE)
    assert hand.velocities == pytest.approx(reference.velocities, abs=1e3 * TOLERANCE)
    assert hand.object_pose() == pytest.approx(reference.object_pose(), abs=TOLERANCE)
    assert hand.bracket_poses() == pytest.approx(reference.bracket_poses(), abs=TOLERANCE)


def test_arguments_of_another_shape_are_rejected(setup, contacts):
    name = next(iter(setup.objects))
    item = FreeObject(setup.objects[name].shape, setup.object_pose(name))
    hand = HandInContact(setup.hand, setup.wrist_robot, contacts[0], 0, item, np.eye(4), np.zeros(16))
    with pytest.raises(ValueError, match=r"torques of 16 joints, found shape \(15,\)"):
        hand.step(np.zeros(15), PERIOD_S)
    with pytest.raises(ValueError, match=r"velocity of 6 numbers, found shape \(3,\)"):
        item.move(np.zeros(3), PERIOD_S)


def test_a_step_with_a_closed_contact_solver_raises_an_error(setup):
    name = next(iter(setup.objects))
    world = format_scene(setup.hand, EmulatedScene({name: setup.objects[name].shape}))
    contact = SkinContact(world)
    item = FreeObject(setup.objects[name].shape, setup.object_pose(name))
    hand = HandInContact(setup.hand, setup.wrist_robot, contact, 0, item, np.eye(4), np.zeros(16))
    contact.close()
    with pytest.raises(ValueError, match="found a closed one"):
        hand.step(np.zeros(16), PERIOD_S)
