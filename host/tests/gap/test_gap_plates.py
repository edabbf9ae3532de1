"""Hands that press by a contact law of their own: what is found is what was put in."""

from __future__ import annotations

import numpy as np
import pytest

from host.tests.gap.pressed_plates import Plates
from taxel.gap.diagnosis import diagnose

pytestmark = pytest.mark.slow


def found(folder, plates: Plates) -> dict:
    return diagnose(*plates.write(folder)).report


def parameters(report: dict, name: str) -> dict[str, float]:
    own = next(entry for entry in report["effects"] if entry["name"] == name)["parameters"]
    return {key: one["value"] for key, one in own.items()}


@pytest.mark.parametrize("scale", [0.65, 1.6])
def test_another_layer_stiffness_is_identified_with_its_scale(tmp_path, scale):
    report = found(tmp_path, Plates(seed=11, scale=scale))
    assert report["verdict"]["effects"] == ["stiffness"]
    assert parameters(report, "stiffness")["half_force_scale"] == pytest.approx(scale, rel=0.05)
    assert report["after"]["reducible_shrink"] > 0.95


def test_a_displaced_bracket_is_identified_with_its_pose(tmp_path):
    moved = (0.002, -0.0015, 0.0, 0.03, -0.02, 0.04)
    report = found(tmp_path, Plates(seed=12, moved=((0.0,) * 6, moved, (0.0,) * 6)))
    assert report["verdict"]["effects"][0] == "pose_error"
    told = parameters(report, "pose_error")
    own = np.array([told[f"{axis}@33"] for axis in ("x_mm", "y_mm", "rx_deg", "ry_deg", "rz_deg")])
    true = np.array([2.0, -1.5, *np.degrees([0.03, -0.02, 0.04])])
    # A dropout beside the pose takes a part of the rotation.
    np.testing.assert_allclose(own[:2], true[:2], atol=0.4)
    np.testing.assert_allclose(own[2:], true[2:], atol=1.2)
    assert abs(told["z_mm@33"]) < 0.2  # no press tells it


def test_two_equal_hands_have_no_gap(tmp_path):
    assert found(tmp_path, Plates(seed=13))["verdict"]["status"] == "no_gap"
