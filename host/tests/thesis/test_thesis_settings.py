"""The settings for the reproduction of chapter 5 are accepted by the emulator."""

import numpy as np
import pytest

from taxel.campaign.session import check_world
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.emulated.contact import ContactLibraryError
from taxel.grasp.plan import make_thesis_plan
from taxel.thesis.settings import EFFECTS, OBJECT_VARIATION


def test_emulator_accepts_the_effects():
    check_world(Setup(), EmulatedSettings(effects=EFFECTS, variation=OBJECT_VARIATION))


def test_effect_without_its_size_is_refused():
    with pytest.raises(ContactLibraryError):
        check_world(Setup(), EmulatedSettings(effects=(*EFFECTS, "saturation clip")))


def test_hardware_and_simulation_have_their_recorded_tool_poses():
    plan = {(planned.object, planned.approach): planned for planned in make_thesis_plan(1)}
    hardware, simulation = Setup(setting="hardware"), Setup(setting="simulation")
    shifts_m = {
        key: float(np.linalg.norm((simulation.approach(one).palm_pose - hardware.approach(one).palm_pose)[:3, 3]))
        for key, one in plan.items()
    }
    assert len(shifts_m) == 15
    assert min(shifts_m.values()) >= 0.0012
    assert max(shifts_m.values()) < 0.012  # at the palm: displacement and rotation of the tool
    sides = [shifts_m["triangular_prism", f"side_{index}"] for index in (1, 2, 3)]
    assert sides == pytest.approx([sides[0]] * 3)  # one recorded pose, turned about the axis of the prism
