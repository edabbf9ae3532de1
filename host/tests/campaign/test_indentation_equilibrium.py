"""Equilibrium of an indentation: both solvers balance the force of the mount and agree with each other."""

import numpy as np
import pytest

from taxel.campaign.indentation import IndentationDesign, indentation_settings, sample_indentation_plan
from taxel.campaign.indentation.emulated_equilibrium import EmulatedEquilibrium
from taxel.campaign.indentation.errors import EquilibriumError
from taxel.campaign.indentation.fixed_layer import FixedSkinLayer
from taxel.campaign.indentation.simulated_equilibrium import LEVELS, SimulatedEquilibrium
from taxel.campaign.session_world import format_session_world
from taxel.campaign.variation import NO_VARIATION
from taxel.emulated.contact import SkinContact
from taxel.hand import load_hand
from taxel.hand.transforms import inverse
from taxel.sim.sensor_model import SimSensor
from taxel.sim.soft_contact import LayerLaw, SoftContact


@pytest.fixture(scope="module")
def hand():
    return load_hand("rig4")


@pytest.fixture(scope="module")
def plan(hand):
    return sample_indentation_plan(hand, 0, IndentationDesign(sessions=1, repeats=1))


@pytest.fixture(scope="module")
def contact(hand, plan):
    """Yield a contact solver of the emulated skin without variation."""
    with SkinContact(
        format_session_world(plan.setup, indentation_settings(hand, variation=NO_VARIATION), 0)
    ) as skin_contact:
        yield skin_contact


def build_emulated_equilibrium(plan, contact, approach):
    """Build the solver for an approach against the emulated skin."""
    index, centre = list(plan.objects).index(approach.object), plan.centre(approach.object)
    return EmulatedEquilibrium(
        contact, index, plan.bracket_poses, plan.mount, centre, approach.touch_pose, approach.direction
    )


def build_simulated_equilibrium(plan, approach):
    """Build the solver for an approach against the simulated layer."""
    layer = FixedSkinLayer(plan.hand, plan.bracket_poses, LayerLaw())
    shape = plan.objects[approach.object].shape
    return SimulatedEquilibrium(layer, shape, plan.mount, approach.touch_pose, approach.direction)


def compute_mount_displacement(plan, approach, pose):
    """Compute how far the point at which the mount holds the object has moved from the touch pose, f64[3], metres."""
    centre = np.append(plan.centre(approach.object), 1.0)
    return ((pose - approach.touch_pose) @ centre)[:3]


@pytest.mark.parametrize("number", range(8))
def test_the_emulated_skin_balances_the_mount_and_the_travel_includes_the_compression_of_its_spring(
    plan, contact, number
):
    """The mount applies `force_n` along the direction of the approach, and is a spring in the lateral directions."""
    approach = plan.approaches[number]
    path = build_emulated_equilibrium(plan, contact, approach).solve_path(approach.force_n)
    load = contact.compute_load(list(plan.objects).index(approach.object), path.pose[-1], plan.bracket_poses)
    force_on_boards = np.einsum("sij,sj->i", plan.bracket_poses[:, :3, :3], load.wrench[:, :3])
    displacement = compute_mount_displacement(plan, approach, path.pose[-1])
    depth = displacement @ approach.direction
    lateral = displacement - depth * approach.direction
    expected = approach.force_n * approach.direction - plan.mount.n_per_m * lateral
    assert force_on_boards == pytest.approx(expected, abs=1e-3 * approach.force_n)
    assert path.travel_m[-1] == pytest.approx(depth + approach.force_n / plan.mount.n_per_m)
    assert (np.diff(path.travel_m) >= 0).all()


def test_emulated_and_simulated_equilibrium_and_counts_agree(plan, contact):
    """The two models differ only by their discretisation: 16 contact elements (emulated) or 25 springs per taxel."""
    differences = []
    for approach in plan.approaches:
        index = list(plan.objects).index(approach.object)
        emulated = build_emulated_equilibrium(plan, contact, approach).solve_path(approach.force_n)
        equilibrium = build_simulated_equilibrium(plan, approach)
        simulated = equilibrium.solve_path(approach.force_n)
        assert emulated.pose[-1][:3, 3] == pytest.approx(equilibrium.pose(simulated.motion)[:3, 3], abs=5e-5)
        assert emulated.travel_m[-1] == pytest.approx(simulated.travel_m, abs=4e-5)
        emulated_signal = SimSensor().predict_signal(
            contact.compute_forces(index, emulated.pose[-1], plan.bracket_poses)
        )
        simulated_signal = SimSensor().predict_signal(equilibrium.taxel_forces(simulated.motion))
        loaded = (emulated_signal > 10.0) | (simulated_signal > 10.0)
        differences.append(float(np.sqrt(np.mean((emulated_signal - simulated_signal)[loaded] ** 2))))
    assert np.median(differences) < 8.0
    assert max(differences) < 30.0


def test_a_displaced_bracket_shifts_the_first_contact(hand, plan, contact):
    approach = next(candidate for candidate in plan.approaches if candidate.boards == ("sleeve",))
    effects = ("bracket_offset sleeve 0 0 0.001 0 0 0",)
    settings = indentation_settings(hand, variation=NO_VARIATION, effects=effects)
    with SkinContact(format_session_world(plan.setup, settings, 0)) as skin:
        displaced = build_emulated_equilibrium(plan, skin, approach).solve_path(approach.force_n)
    nominal = build_emulated_equilibrium(plan, contact, approach).solve_path(approach.force_n)
    # The sleeve (board 3) is displaced by 1 mm along its normal; the skin is soft and curved, hence the tolerance.
    cosine = -(plan.bracket_poses[3, :3, 2] @ approach.direction)
    assert nominal.travel_m[0] - displaced.travel_m[0] == pytest.approx(1e-3 * cosine, abs=4e-4)


def test_the_fixed_layer_gives_the_forces_of_the_simulators_layer(plan):
    """`SoftContact` computes the forces by another method. Both methods agree if the fixed layer has many springs."""
    for approach in plan.approaches:
        shape = plan.objects[approach.object].shape
        expected = SoftContact(plan.hand, shape, LayerLaw()).compute_taxel_forces(
            plan.bracket_poses, approach.held_pose
        )
        layer = FixedSkinLayer(plan.hand, plan.bracket_poses, LayerLaw(), springs_per_side=12)
        forces = layer.taxel_forces(layer.near(shape, approach.held_pose), shape, approach.held_pose)
        assert expected.sum() > 1.0
        assert forces == pytest.approx(expected, abs=0.05 * expected.max())
        assert forces.sum() == pytest.approx(expected.sum(), rel=0.03)


@pytest.mark.parametrize("number", [0, 5])
def test_signals_interpolated_between_the_solved_forces_are_accurate_to_4_counts(plan, number):
    approach = plan.approaches[number]
    equilibrium = build_simulated_equilibrium(plan, approach)
    coarse = equilibrium.solve_path(approach.force_n)
    levels = tuple(sorted({*LEVELS, *np.geomspace(LEVELS[0], 1.0, 17).tolist()}))
    fine = equilibrium.solve_path(approach.force_n, levels)
    travel = np.linspace(coarse.curve.x[0], coarse.travel_m, 20)
    signals = []
    for path in (coarse, fine):
        motions = path.motions(travel, approach.direction)
        signals.append(SimSensor().predict_signal([equilibrium.taxel_forces(motion) for motion in motions]))
    loaded = signals[1].max(axis=0) > 10.0
    assert np.sqrt(np.mean((signals[0] - signals[1])[:, loaded] ** 2)) < 4.0


def test_an_object_that_meets_no_skin_raises_an_error(hand, plan, contact):
    approach = plan.approaches[0]
    distant_pose = approach.touch_pose.copy()
    distant_pose[:3, 3] += 0.5
    layer = FixedSkinLayer(hand, plan.bracket_poses, LayerLaw())
    shape, centre = plan.objects[approach.object].shape, plan.centre(approach.object)
    with pytest.raises(EquilibriumError, match="meets no skin"):
        SimulatedEquilibrium(layer, shape, plan.mount, distant_pose, approach.direction).solve_path(5.0)
    with pytest.raises(EquilibriumError, match="meets no skin"):
        EmulatedEquilibrium(
            contact, 0, plan.bracket_poses, plan.mount, centre, distant_pose, approach.direction
        ).solve_path(5.0)


def test_the_poses_of_the_path_are_rigid_transforms(plan, contact):
    poses = build_emulated_equilibrium(plan, contact, plan.approaches[1]).solve_path(10.0).pose
    assert inverse(poses) @ poses == pytest.approx(np.broadcast_to(np.eye(4), poses.shape))
