"""The motion of a grasp: independent of effects that only change the counts, and shared by campaigns."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.blind.catalogue_causes import CATALOGUE_CAUSES
from taxel.campaign import emulated
from taxel.campaign.emulated import run_emulated
from taxel.campaign.performed_grasp import GraspMemory, perform_grasp, select_mechanical_settings
from taxel.campaign.session_world import format_session_world
from taxel.campaign.settings import EmulatedSettings
from taxel.emulated.contact import SkinContact
from taxel.recording.grasp_dataset import GraspDataset


@pytest.fixture(scope="module")
def settings(timeline):
    return EmulatedSettings(timeline=timeline, effects=())


@pytest.fixture(scope="module")
def grasp(setup, plan, settings):
    return perform_grasp(setup, plan[0], settings)


def compute_hold_load(setup, grasp, settings):
    """Compute the contact load on all boards at the recorded pose with the largest force; return its 43 values each."""
    number, motion = list(setup.objects).index(grasp.planned.object), grasp.motion
    with SkinContact(format_session_world(setup, settings, grasp.planned.session)) as contact:
        middle = len(motion.time_s) // 2
        load = contact.compute_load(number, motion.object_poses[middle], motion.bracket_poses[middle])
    return np.concatenate([load.wrench.ravel(), load.stiffness.ravel(), load.clearance_m])


def test_no_effect_of_the_catalogue_changes_the_load_of_a_contact_unless_it_displaces_a_part(setup, grasp, settings):
    reference, compared = compute_hold_load(setup, grasp, settings), 0
    assert np.abs(reference).max() > 0.1  # newtons: the hand holds the object
    for number, cause in enumerate(CATALOGUE_CAUSES):
        lines = cause.sample(np.random.default_rng(number), setup.hand, 1.0).lines
        effects = tuple(line for line in lines if not line.split()[0].endswith("_offset"))
        if effects and " OBJECT " not in " ".join(effects):
            compared += 1
            load = compute_hold_load(setup, grasp, replace(settings, effects=effects))
            assert np.array_equal(load, reference), cause.emulator_effect
    assert compared > 20


def test_displacements_remain_in_the_mechanical_settings_and_effects_of_the_skin_do_not(settings):
    lines = ("noise white counts=9", "object_offset cylinder 0 0 0.002 0 0 0", "bracket_offset palm 0 0 0 0 0 0.02")
    changed = replace(settings, effects=lines, noise_counts=7.0, scl_hz=100e3, baud=115200)
    assert select_mechanical_settings(changed).effects == lines[1:]
    assert select_mechanical_settings(replace(changed, effects=lines[:1])) == select_mechanical_settings(settings)


def test_a_second_campaign_performs_no_grasp_again_and_has_equal_records(setup, plan, settings, tmp_path, monkeypatch):
    """A drift of the counts does not change the motion, so the second campaign uses the stored grasps of the first."""
    noisy = replace(settings, effects=("drift warm_up counts=800 seconds=60",))
    memory, performed = GraspMemory(), []

    def count_grasps(*arguments):
        """Perform a grasp as usual and note it."""
        performed.append(arguments[1].id)
        return perform_grasp(*arguments)

    monkeypatch.setattr(emulated, "perform_grasp", count_grasps)
    run_emulated(tmp_path / "first.h5", plan, settings, setup, jobs=1, memory=memory)
    run_emulated(tmp_path / "shared.h5", plan, noisy, setup, jobs=1, memory=memory)
    assert performed == [planned.id for planned in plan]
    run_emulated(tmp_path / "alone.h5", plan, noisy, setup, jobs=1)
    assert performed == [planned.id for planned in plan] * 2
    with GraspDataset(tmp_path / "shared.h5") as shared, GraspDataset(tmp_path / "alone.h5") as alone:
        for first, second in zip(shared, alone, strict=True):
            assert np.array_equal(first.raw_counts, second.raw_counts)
            assert np.array_equal(first.joint_position, second.joint_position)


def test_a_displaced_object_is_grasped_again(setup, plan, settings, grasp):
    memory = GraspMemory()
    memory.add(grasp, settings)
    displaced = replace(settings, effects=("object_offset cylinder 0 0 0.002 0 0 0",))
    assert memory.list_missing(plan, settings) == [plan[1]]
    assert memory.list_missing(plan, displaced) == list(plan)
