"""Diagnosis of plates with known stiffness and poses, simulated by a contact law independent of the diagnosis."""

from __future__ import annotations

import numpy as np
import pytest

from host.tests.gap.pressed_plates import Plates
from taxel.gap.diagnosis import diagnose

pytestmark = pytest.mark.slow


def diagnose_plates(folder, plates: Plates) -> dict:
    return diagnose(*plates.write(folder)).report


def list_parameter_values(report: dict, name: str) -> dict[str, float]:
    parameters = next(entry for entry in report["effects"] if entry["name"] == name)["parameters"]
    return {label: parameter["value"] for label, parameter in parameters.items()}


@pytest.mark.parametrize("scale", [0.65, 1.6])
def test_another_layer_stiffness_is_identified_with_its_scale(tmp_path, scale):
    report = diagnose_plates(tmp_path, Plates(seed=11, stiffness_scale=scale))
    assert report["verdict"]["effects"] == ["stiffness"]
    assert list_parameter_values(report, "stiffness")["half_force_scale"] == pytest.approx(scale, rel=0.05)
    assert report["after"]["reducible_shrink"] > 0.95


def test_a_displaced_bracket_is_identified_with_its_pose(tmp_path):
    moved = (0.002, -0.0015, 0.0, 0.03, -0.02, 0.04)  # translation in metres, rotation vector in radians
    report = diagnose_plates(tmp_path, Plates(seed=12, displacements=((0.0,) * 6, moved, (0.0,) * 6)))
    assert report["verdict"]["effects"][0] == "pose_error"
    estimated = list_parameter_values(report, "pose_error")
    pose = np.array([estimated[f"{axis}@33"] for axis in ("x_mm", "y_mm", "rx_deg", "ry_deg", "rz_deg")])
    true_pose = np.array([2.0, -1.5, *np.degrees([0.03, -0.02, 0.04])])
    # A dropout in the same composite model accounts for a part of the rotation.
    np.testing.assert_allclose(pose[:2], true_pose[:2], atol=0.4)
    np.testing.assert_allclose(pose[2:], true_pose[2:], atol=1.2)
    assert abs(estimated["z_mm@33"]) < 0.2  # not identifiable from these contacts


def test_two_equal_hands_have_no_gap(tmp_path):
    assert diagnose_plates(tmp_path, Plates(seed=13))["verdict"]["status"] == "no_gap"
