"""Files of plug-in grasps: every field is read as it was written; other files give a one-line error."""

from pathlib import Path

import numpy as np
import pytest

from taxel.sim.contact_messages import OBJECT, ContactMessage, PairEntry
from taxel.thesis.own_gap.plugin import PluginGrasp
from taxel.thesis.own_gap.plugin_file import PluginFileError, read_plugin_grasps, write_plugin_grasps

SEED = 11


def make_grasp(rng: np.random.Generator, iteration: int) -> PluginGrasp:
    """Make a grasp with random poses and three messages with 0, 1 and 2 entries of 0 to 4 points."""
    messages = []
    for board in range(3):
        points = rng.integers(0, 5, board)
        entries = tuple(PairEntry((board, OBJECT), rng.normal(size=(n, 3)), rng.uniform(size=n)) for n in points)
        messages.append(ContactMessage(0.2 * (board + 1), board, entries))
    poses = rng.normal(size=(17, 4, 4))
    return PluginGrasp("cylinder", "top", iteration, poses, rng.normal(size=(4, 4)), 2.0, tuple(messages))


def test_read_grasps_equal_the_written_ones(tmp_path: Path) -> None:
    rng = np.random.default_rng(SEED)
    grasps = [make_grasp(rng, iteration) for iteration in range(3)]
    write_plugin_grasps(tmp_path / "a.npz", grasps, "settings 1")
    for read, written in zip(read_plugin_grasps(tmp_path / "a.npz", "settings 1"), grasps, strict=True):
        assert (read.object, read.approach, read.iteration) == (written.object, written.approach, written.iteration)
        assert np.array_equal(read.sensor_pose, written.sensor_pose)
        assert np.array_equal(read.object_pose, written.object_pose)
        assert read.saved_s == written.saved_s
        for one, other in zip(read.messages, written.messages, strict=True):
            assert (one.time_s, one.board) == (other.time_s, other.board)
            for entry, original in zip(one.entries, other.entries, strict=True):
                assert entry.bodies == original.bodies
                assert np.array_equal(entry.position, original.position)
                assert np.array_equal(entry.force_n, original.force_n)


def test_writing_leaves_no_temporary_file(tmp_path: Path) -> None:
    write_plugin_grasps(tmp_path / "a.npz", [make_grasp(np.random.default_rng(SEED), 0)], "settings 1")
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


def test_file_of_other_settings_is_refused(tmp_path: Path) -> None:
    write_plugin_grasps(tmp_path / "a.npz", [make_grasp(np.random.default_rng(SEED), 0)], "settings 1")
    with pytest.raises(PluginFileError, match="expected settings 2, found settings 1; delete the file"):
        read_plugin_grasps(tmp_path / "a.npz", "settings 2")


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 no archive"])
def test_file_that_is_no_npz_archive_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(PluginFileError, match="not a file of plug-in grasps") as error:
        read_plugin_grasps(tmp_path / "a.npz", "settings 1")
    assert "\n" not in str(error.value)
