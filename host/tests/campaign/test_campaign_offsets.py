"""Offsets of brackets and objects from their nominal poses: by effect lines, or by a calibration."""

import h5py
import numpy as np
import pytest

from taxel.campaign.session_world import _make_scene
from taxel.campaign.settings import EmulatedSettings, OffsetLineError
from taxel.campaign.setup import Setup
from taxel.campaign.store import open_campaign_writer
from taxel.campaign.variation import NO_VARIATION
from taxel.grasp.calibration import Calibration, make_pose_estimate
from taxel.hand import UnknownBoardError
from taxel.hand.transforms import to_quaternion

LINES = (
    "spread film length_m=0.002",
    "bracket_offset palm 0.001 0 0 0 0 0.02",
    "object_offset cylinder 0 0.002 0 0 0 0",
)
"""Effect lines. The six numbers of an offset: x, y, z in metres, and a rotation vector in radians."""


def test_offset_lines_move_the_scene_and_other_lines_are_effects():
    """`LINES`: an effect, the palm shifted by 1 mm in x and turned by 0.02 rad, the cylinder shifted by 2 mm in y."""
    settings = EmulatedSettings(variation=NO_VARIATION, effects=LINES)
    scene = _make_scene(Setup(), settings, session=0)
    assert settings.world_effect_lines() == [LINES[0]]
    assert scene.bracket_offsets["palm"][0, 3] == pytest.approx(0.001)
    assert scene.bracket_offsets["palm"][1, 0] == pytest.approx(np.sin(0.02))
    assert np.array_equal(scene.bracket_offsets["back_of_hand"], np.eye(4))
    assert scene.object_offsets["cylinder"][1, 3] == pytest.approx(0.002)


@pytest.mark.parametrize("line", ["bracket_offset palm 1 2 3", "bracket_offset", "object_offset cylinder a b c d e f"])
def test_an_offset_without_six_numbers_is_rejected(line):
    settings = EmulatedSettings(effects=(line,))
    with pytest.raises(OffsetLineError, match="six numbers"):
        _make_scene(Setup(), settings, 0)


def test_a_calibration_moves_only_the_calibrated_brackets_and_objects():
    planned = Setup()
    palm = planned.hand.find_board("palm")
    index = planned.hand.boards.index(palm)
    position = palm.pose[:3, 3] + np.array([0.0009, 0.0, 0.0])
    calibration = Calibration(
        objects={"cylinder": make_pose_estimate([0.6, 0.1, 0.1], [1, 0, 0, 0])},
        brackets={"palm": make_pose_estimate(position.tolist(), to_quaternion(palm.pose).tolist())},
    )
    measured = Setup(calibration=calibration)
    assert measured.object_pose("cylinder")[0, 3] == pytest.approx(0.6)
    assert np.array_equal(measured.object_pose("triangular_prism"), planned.object_pose("triangular_prism"))
    measured_poses, planned_poses = (each.kinematics.compute_sensor_poses(np.zeros(22)) for each in (measured, planned))
    difference = measured_poses - planned_poses
    assert np.linalg.norm(difference[index, :3, 3]) == pytest.approx(0.0009)
    assert np.abs(np.delete(difference, index, axis=0)).max() < 1e-12


def test_a_calibration_of_an_unknown_bracket_is_rejected():
    with pytest.raises(UnknownBoardError, match="elbow"):
        Setup(calibration=Calibration(objects={}, brackets={"elbow": make_pose_estimate([0, 0, 0], [1, 0, 0, 0])}))


def test_the_dataset_stores_the_calibration_and_the_source_date_epoch_and_is_reproducible(tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    setup = Setup(
        calibration=Calibration(objects={"cylinder": make_pose_estimate([0.6, 0.1, 0.1], [1, 0, 0, 0])}, brackets={})
    )
    for name in ("a.h5", "b.h5"):
        open_campaign_writer(tmp_path / name, "real", setup, 18.8, "a test").close()
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    with h5py.File(tmp_path / "a.h5") as file:
        assert "cylinder" in file.attrs["calibration"]
        assert file.attrs["created"] == "2023-11-14T22:13:20+00:00"
