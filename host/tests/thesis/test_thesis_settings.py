"""The settings for the reproduction of chapter 5: effects of the emulator, tool poses of the original files."""

import numpy as np
import pytest

from taxel.campaign.session_world import check_world
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.emulated.contact import ContactLibraryError
from taxel.grasp.plan import make_thesis_plan
from taxel.thesis.settings import EFFECTS, OBJECT_VARIATION


def test_emulator_accepts_the_effects_of_the_reproduction():
    check_world(Setup(), EmulatedSettings(effects=EFFECTS, variation=OBJECT_VARIATION))


def test_emulator_refuses_an_effect_without_its_parameters():
    with pytest.raises(ContactLibraryError):
        check_world(Setup(), EmulatedSettings(effects=(*EFFECTS, "saturation clip")))


@pytest.fixture(scope="module")
def palm_shifts_m():
    """Distance between the palm positions of hardware and simulation, metres, by object and approach."""
    plan = {(planned.object, planned.approach): planned for planned in make_thesis_plan(1)}
    hardware, simulation = Setup(setting="hardware"), Setup(setting="simulation")
    return {
        key: float(np.linalg.norm((simulation.approach(one).palm_pose - hardware.approach(one).palm_pose)[:3, 3]))
        for key, one in plan.items()
    }


def test_palm_of_the_simulation_is_displaced_by_1_2_to_12_mm_in_each_of_the_fifteen_approaches(palm_shifts_m):
    assert len(palm_shifts_m) == 15
    assert min(palm_shifts_m.values()) >= 0.0012
    assert max(palm_shifts_m.values()) < 0.012  # displacement and rotation of the tool together


def test_palm_is_displaced_equally_in_the_three_side_approaches_to_the_prism(palm_shifts_m):
    sides = [palm_shifts_m["triangular_prism", f"side_{index}"] for index in (1, 2, 3)]
    assert sides == pytest.approx([sides[0]] * 3)  # one recorded pose, rotated about the axis of the prism
