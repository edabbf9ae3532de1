"""tools/gap/capfingerid.py: the diagnosis on recordings against themselves, with and without their known faults."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.blind import measured_touches, touch_datasets
from taxel.recording import GraspDataset, TouchRecording, list_recordings, load_recording

pytestmark = pytest.mark.slow

FOLDER = Path(__file__).resolve().parents[3] / "tools" / "gap"
FEW_TOUCHES, MORE_TOUCHES = 3, 5
"""Numbers of touches of each recording."""

SEED = 0


@pytest.fixture(scope="module")
def tool():
    """The module tools/gap/capfingerid.py, whose folder is importable during the tests."""
    sys.path.insert(0, str(FOLDER))
    yield SimpleNamespace(capfingerid=importlib.import_module("capfingerid"))
    del sys.modules["capfingerid"]
    sys.path.remove(str(FOLDER))


@pytest.fixture(scope="module")
def frames(tool):
    return [measured_touches.Frames.from_recording(load_recording(name)) for name in list_recordings()]


@pytest.fixture(scope="module")
def repeats(tool, frames):
    print("seed", SEED)
    return tool.capfingerid.sample_repeats(frames, SEED, FEW_TOUCHES)


def build_frames(tool, values) -> object:
    """Return frames of a recording with `values` [T, 405], one frame every 70 ms."""
    count = len(values)
    grid = np.asarray(values, np.int16).reshape(count, 27, 15)
    return measured_touches.Frames.from_recording(
        TouchRecording("synthetic", 0.07 * np.arange(count), grid, np.full(count, "TAP"))
    )


def test_halves_of_the_repeats_have_no_gap(tool, frames, tmp_path):
    print("seed", SEED)
    result = tool.capfingerid.compare_halves(tmp_path, tool.capfingerid.sample_repeats(frames, SEED, MORE_TOUCHES))
    assert (result["status"], result["effects"]) == ("no_gap", [])


@pytest.mark.parametrize("missing", ["both", "stale prefixes", "impulses"])
def test_corrected_faults_are_reported_on_the_torn_rows(tool, repeats, tmp_path, missing):
    """The first taxels of a torn frame (rows 0 to 11) have the values of the frame before, most often in row 0.

    The recordings are compared with a version in which this fault, the impulses, or both are corrected.
    """
    comparison = next(item for item in tool.capfingerid.COMPARISONS if item.name == missing)
    result = tool.capfingerid.compare_versions(tmp_path, repeats, comparison)
    assert set(result["effects"]) <= {"unknown", *tool.capfingerid.SIMILAR_EFFECTS}
    assert result["status"] != "no_gap"
    assert result["differs"]["rows"] == list(range(12))
    assert set(result["rows_found"]) <= set(range(12))
    assert result["differs"]["worst_row"] == 0
    assert 0 in result["rows_found"]
    assert result["share_on_rows"] > 0.95
    assert result["right"]


def test_fault_statistics_of_the_recordings_equal_the_documented_ones(frames):
    """The values are those of docs/gap-diagnosis.md: repeated frames, stale prefixes (taxels) and impulses."""
    for recording in frames:
        figures = recording.summarise()
        assert figures["repeat_share"] == pytest.approx(0.177, abs=0.003)
        assert figures["torn_share"] == pytest.approx(0.977, abs=0.003)
        assert figures["prefix_cells"] == {"median": 87.0, "p90": pytest.approx(149.0, abs=1.0), "most": 177.0}
        assert figures["impulse_born_share"] == pytest.approx(0.445, abs=0.003)
        assert figures["impulse_present_share"] == pytest.approx(0.807, abs=0.01)
        assert figures["impulse_upward_share"] == pytest.approx(0.80, abs=0.01)
        assert not any(figures["share_by_row"]["stale"][12:])


def test_stale_prefix_and_impulse_are_detected_and_corrected(tool):
    truth = np.arange(8)[:, None] + 3.0 * np.arange(405) % 50  # eight frames of 405 taxels
    torn = truth.copy()
    torn[3, :20] = torn[2, :20]  # stale prefix
    torn[3, 20] = 200.0  # impulse at the first taxel with a new value
    torn[4, :30] = torn[3, :30]  # the impulse remains
    frames = build_frames(tool, np.repeat(torn, [1, 1, 1, 1, 1, 1, 2, 1], axis=0))
    assert frames.n_duplicates == 1
    assert frames.first.tolist() == [0, 0, 0, 20, 30, 0, 0, 0]
    assert np.argwhere(frames.impulses).tolist() == [[3, 20], [4, 20]]
    # Taxel 0 never has a valid value. The duplicate shifts the time by one frame, which changes the truth by 1 count.
    assert np.abs(frames.corrected - truth)[:, 1:30].max() < 0.5 + 1.0
    assert frames.without_prefixes[3, 20] == 200.0
    assert frames.without_prefixes[4, 20] < 60.0
    assert frames.without_impulses[4, 19] == frames.without_impulses[2, 19]


def test_every_repeat_has_one_frame_of_each_block_and_no_frame_is_used_twice(tool, frames):
    """The repeats of a touch are random subsets of its frames: each frame of a block goes to a different repeat."""
    repeats = tool.capfingerid.sample_repeats(frames, SEED, 1)
    for recording in frames:
        recording_repeats = [repeat for repeat in repeats if repeat.touch.frames is recording]
        assert len(recording_repeats) == tool.capfingerid.N_REPEATS
        blocks = np.sort(np.stack([repeat.frames for repeat in recording_repeats], axis=1), axis=1)
        assert len(np.unique(blocks)) == blocks.size
        assert (np.diff(blocks.ravel()) > 0).all()
        assert (np.bincount(recording_repeats[0].phase)[:2] == [10, 1]).all()  # frames of baseline and closing


def test_both_halves_have_the_same_touches_and_four_sessions(tool, repeats, tmp_path):
    contents = []
    for number, half in enumerate(measured_touches.split_halves(repeats)):
        path = tmp_path / f"{number}.h5"
        touch_datasets.write_dataset(path, half, "measured")
        with GraspDataset(path, baseline_frames=10) as data:
            data.check()
            contents.append({(grasp.object, grasp.approach, grasp.session) for grasp in data})
    assert contents[0] == contents[1]
    assert {session for _, _, session in contents[0]} == {0, 1, 2, 3}


def test_folder_without_recordings_is_rejected_with_one_line(tool, tmp_path):
    with pytest.raises(Exception, match=r"expected CapMatrix_<name>\.txt, found none"):
        tool.capfingerid.read_recordings(tmp_path)
