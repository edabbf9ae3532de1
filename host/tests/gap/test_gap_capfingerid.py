"""The diagnosis on measured touches: against themselves, and against themselves without their known faults."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.recording import GraspDataset, TouchRecording, load_recording, recordings

pytestmark = pytest.mark.slow

FOLDER = Path(__file__).resolve().parents[3] / "tools" / "gap"
FEW, MORE = 3, 5
"""Touches of each recording."""

SEED = 0


@pytest.fixture(scope="module")
def tool():
    sys.path.insert(0, str(FOLDER))
    names = ("measured_touches", "capfingerid")
    yield SimpleNamespace(**{name: importlib.import_module(name) for name in names})
    for name in names:
        del sys.modules[name]
    sys.path.remove(str(FOLDER))


@pytest.fixture(scope="module")
def frames(tool):
    return [tool.measured_touches.Frames.of(load_recording(name)) for name in recordings()]


@pytest.fixture(scope="module")
def looks(tool, frames):
    print("seed", SEED)
    return tool.capfingerid.deal(frames, SEED, FEW)


def made_up(tool, values) -> object:
    """Frames of a recording that holds `values` [T, 405], a frame every 70 ms."""
    count = len(values)
    grid = np.asarray(values, np.int16).reshape(count, 27, 15)
    return tool.measured_touches.Frames.of(
        TouchRecording("made up", 0.07 * np.arange(count), grid, np.full(count, "TAP"))
    )


def test_half_the_looks_against_the_other_half_are_no_gap(tool, frames, tmp_path):
    print("seed", SEED)
    said = tool.capfingerid.split_half(tmp_path, tool.capfingerid.deal(frames, SEED, MORE))
    assert (said["status"], said["effects"]) == ("no_gap", [])


@pytest.mark.parametrize("missing", ["both", "stale prefixes", "impulses"])
def test_what_the_comparison_lacks_is_unknown_or_what_it_resembles_and_on_the_torn_rows(tool, looks, tmp_path, missing):
    wanted = next(one for one in tool.capfingerid.COMPARISONS if one.name == missing)
    found = tool.capfingerid.compare(tmp_path, looks, wanted)
    assert set(found["effects"]) <= {"unknown", *tool.capfingerid.RESEMBLED}
    assert found["status"] != "no_gap"
    assert found["differs"]["rows"] == list(range(12))
    assert set(found["rows_found"]) <= set(range(12))
    assert found["differs"]["worst_row"] == 0
    assert 0 in found["rows_found"]
    assert found["share_on_rows"] > 0.95
    assert found["right"]


def test_the_faults_are_as_large_as_the_page_says(frames):
    for one in frames:
        figures = one.figures()
        assert figures["repeat_share"] == pytest.approx(0.177, abs=0.003)
        assert figures["torn_share"] == pytest.approx(0.977, abs=0.003)
        assert figures["prefix_cells"] == {"median": 87.0, "p90": pytest.approx(149.0, abs=1.0), "most": 177.0}
        assert figures["impulse_born_share"] == pytest.approx(0.445, abs=0.003)
        assert figures["impulse_present_share"] == pytest.approx(0.807, abs=0.01)
        assert figures["impulse_upward_share"] == pytest.approx(0.80, abs=0.01)
        assert not any(figures["share_by_row"]["stale"][12:])


def test_a_stale_prefix_and_its_impulse_are_found_and_mended(tool):
    truth = np.arange(8)[:, None] + 3.0 * np.arange(405) % 50
    torn = truth.copy()
    torn[3, :20] = torn[2, :20]
    torn[3, 20] = 200.0
    torn[4, :30] = torn[3, :30]  # the impulse stays
    frames = made_up(tool, np.repeat(torn, [1, 1, 1, 1, 1, 1, 2, 1], axis=0))
    assert frames.repeats == 1
    assert frames.first.tolist() == [0, 0, 0, 20, 30, 0, 0, 0]
    assert np.argwhere(frames.impulses).tolist() == [[3, 20], [4, 20]]
    assert np.abs(frames.mended - truth)[:, 1:30].max() < 0.5 + 1.0  # the repeat moved time by a frame
    assert frames.without_prefixes[3, 20] == 200.0
    assert frames.without_prefixes[4, 20] < 60.0
    assert frames.without_impulses[4, 19] == frames.without_impulses[2, 19]


def test_every_look_gets_one_frame_of_each_block_and_no_two_the_same(tool, frames):
    looks = tool.capfingerid.deal(frames, SEED, 1)
    for one in frames:
        own = [look for look in looks if look.touch.frames is one]
        assert len(own) == tool.capfingerid.LOOKS
        blocks = np.sort(np.stack([look.frames for look in own], axis=1), axis=1)
        assert len(np.unique(blocks)) == blocks.size
        assert (np.diff(blocks.ravel()) > 0).all()
        assert (np.bincount(own[0].phase)[:2] == [10, 1]).all()


def test_both_halves_hold_the_same_touches_and_four_sessions(tool, looks, tmp_path):
    held = []
    for number, half in enumerate(tool.measured_touches.halves(looks)):
        path = tmp_path / f"{number}.h5"
        tool.capfingerid.write_looks(path, half, "measured")
        with GraspDataset(path, baseline_frames=10) as data:
            data.check()
            held.append({(grasp.object, grasp.approach, grasp.session) for grasp in data})
    assert held[0] == held[1]
    assert {session for _, _, session in held[0]} == {0, 1, 2, 3}


def test_a_folder_without_recordings_is_refused_in_one_line(tool, tmp_path):
    with pytest.raises(Exception, match=r"expected CapMatrix_<name>\.txt, found none"):
        tool.capfingerid.recordings_of(tmp_path)
