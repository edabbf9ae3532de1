"""Every form of a recording into every other: counts and sequences survive, and what cannot is said."""

from __future__ import annotations

import contextlib
import json
import shutil

import numpy as np
import pytest

from host.tests.command_line import exit_status, refusal
from host.tests.recordings import ALL, KEPT, differences, frames_in
from taxel.errors import TaxelError
from taxel.hand.kinematics import kinematics_of
from taxel.link import CaptureError, CaptureLink, CaptureWriter
from taxel.recording.forms import convert
from taxel.recording.forms.hdf5_form import GraspOptions
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import Phase

pytest.importorskip("pyarrow")
NAMES = {"capture": "x.bin", "mcap": "x.mcap", "csv": "x.csv", "parquet": "x.parquet", "hdf5": "x.h5"}


@pytest.fixture(scope="module")
def forms(small, tmp_path_factory):
    """The recording in every form: (path, what the conversion told)."""
    folder = tmp_path_factory.mktemp("forms")
    return {form: (folder / name, convert(small.path, folder / name)) for form, name in NAMES.items()}


@pytest.fixture
def exact(small):
    """A check of frames against the recording's; times to the microsecond."""

    def check(frames, *names):
        assert differences(frames, small.frames, *names) == []
        late = [a.time_s - b.time_s for a, b in zip(frames, small.frames, strict=True)]
        assert max(map(abs, late)) < 1e-6

    return check


@pytest.mark.parametrize("form", ["capture", "mcap"])
def test_what_keeps_bytes_keeps_everything(forms, small, form):
    path, told = forms[form]
    frames, losses = frames_in(path)
    assert differences(frames, small.frames, *ALL) == []
    assert repr(losses) == repr(small.losses)
    assert (told.frames, told.notes) == (len(small.frames), [])


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_tables_keep_counts_sequences_cycles_and_times(forms, exact, form):
    path, told = forms[form]
    exact(frames_in(path)[0], *KEPT)
    assert len(told.notes) == 1


@pytest.mark.parametrize(
    "chain", [("csv", "mcap", "parquet"), ("parquet", "capture", "csv"), ("mcap", "csv", "capture")]
)
def test_a_chain_of_conversions_loses_nothing_that_its_forms_carry(forms, exact, tmp_path, chain):
    path = forms[chain[0]][0]
    for form in chain[1:]:
        target = tmp_path / NAMES[form]
        convert(path, target)
        path = target
    exact(frames_in(path)[0], *KEPT)


def test_a_dataset_keeps_counts_and_clocks_and_the_first_time_of_each_cycle(forms, small, tmp_path):
    path, told = forms["hdf5"]
    assert len(told.notes) == 1
    frames, _ = frames_in(path)
    assert differences(frames, small.frames, "address", "raw_counts", "board_time_us") == []
    first = {}
    for frame in small.frames:
        first[frame.cycle] = min(first.get(frame.cycle, frame.time_s), frame.time_s)
    wanted = [first[frame.cycle] for frame in small.frames]
    assert np.abs(np.subtract([frame.time_s for frame in frames], wanted)).max() < 1e-6
    convert(path, tmp_path / "back.mcap")
    assert differences(frames_in(tmp_path / "back.mcap")[0], small.frames, "address", "raw_counts") == []


def test_a_dataset_is_valid_and_says_where_the_boards_were(forms, small):
    with GraspDataset(forms["hdf5"][0], baseline_frames=100) as data:
        data.check()
        (grasp,) = data
        assert (data.source, data.hand, grasp.object, grasp.approach) == ("real", "rig4", "unknown", "recording")
        assert (grasp.phase == Phase.BASELINE).sum() == 100
        assert np.array_equal(grasp.joint_position[0], [0.3])
        poses = kinematics_of(small.hand).sensor_poses(grasp.joint_position[0])
        assert np.allclose(grasp.sensor_pose, poses)
        spans = {board.address: [] for board in small.hand.boards}
        for frame in small.frames:
            spans[frame.address].append(frame.time_s)
        rates = [(len(times) - 1) / (times[-1] - times[0]) for times in spans.values()]
        assert np.allclose(data.sensors.rate_hz, rates, rtol=0.02)


def test_a_dataset_can_name_the_object(forms, tmp_path):
    options = GraspOptions("cylinder", "side_1", session=2, baseline_frames=10)
    convert(forms["parquet"][0], tmp_path / "x.h5", options=options)
    with GraspDataset(tmp_path / "x.h5") as data:
        grasp = data["0001"]
        assert (grasp.object, grasp.approach, grasp.session) == ("cylinder", "side_1", 2)
        assert len(data.objects["cylinder"].vertices) > 8
    with pytest.raises(TaxelError, match="cylinder, triangular_prism"):
        convert(forms["parquet"][0], tmp_path / "y.h5", options=GraspOptions("ball"))
    assert not (tmp_path / "y.h5").exists()


def _blank(path, target, every, size):
    """A capture whose bytes of the wire, not its heads of records, are 0 for `size` bytes in `every`."""
    at = 0
    with CaptureLink(path) as link, CaptureWriter(target, link.header) as out, contextlib.suppress(EOFError):
        while True:
            data, time_ns = link.read()
            places = range(at, at + len(data))
            whole = zip(places, data, strict=True)
            out.write(bytes(0 if place % every >= every - size else byte for place, byte in whole), time_ns)
            at = places.stop


def test_lost_frames_stay_missing_in_every_form(small, tmp_path):
    """Frames that did not arrive are told by cycles and scans, which tables keep."""
    hurt = tmp_path / "hurt.bin"
    _blank(small.path, hurt, every=20_000, size=40)
    frames, losses = frames_in(hurt)
    missing = {address: board.missing for address, board in losses.boards.items()}
    assert losses.lost_on_wire >= sum(missing.values()) > 0
    for name in ("h.mcap", "h.csv", "h.parquet"):
        told = convert(hurt, tmp_path / name)
        assert told.missing == sum(missing.values())
        again, found = frames_in(tmp_path / name)
        assert differences(again, frames, *KEPT) == []
        assert {address: board.missing for address, board in found.boards.items()} == missing
    convert(hurt, tmp_path / "h.h5")
    with GraspDataset(tmp_path / "h.h5") as dataset:
        assert dataset["0001"].valid.sum() == len(frames)


def test_csv_has_a_file_a_board_and_the_active_taxels_in_space(forms, small):
    folder = forms["csv"][0]
    names = {f"{board.name}.csv" for board in small.hand.boards}
    assert {file.name for file in folder.iterdir()} == names | {"active.csv", "recording.json"}
    heading, first, *_ = (folder / "slab.csv").read_text().splitlines()
    assert heading.startswith("frame,address,time_s,sequence,cycle,board_time_us,hub_time_us,taxel_0,taxel_1,")
    slab = next(frame for frame in small.frames if frame.address == 0x50)
    assert first.split(",")[7:] == [str(count) for count in slab.raw_counts]
    heading, *active = (folder / "active.csv").read_text().splitlines()
    assert heading == "grasp,object,approach,time,x,y,z,active"
    assert len(active) > 10
    x, y, z = map(float, active[-1].split(",")[4:7])
    places = kinematics_of(small.hand).taxel_positions([0.3])
    assert np.linalg.norm(places - [x, y, z], axis=1).min() < 1e-6
    assert json.loads((folder / "recording.json").read_text())["hand"] == "rig4"


def test_a_cut_source_is_converted_up_to_the_cut(small, tmp_path):
    cut = tmp_path / "cut.bin"
    cut.write_bytes(small.path.read_bytes()[:-999])
    with pytest.raises(CaptureError, match="is cut short"):
        convert(cut, tmp_path / "x.parquet")
    frames, _ = frames_in(tmp_path / "x.parquet")
    assert 0.8 * len(small.frames) < len(frames) < len(small.frames)


@pytest.mark.parametrize("name", ["x.bin", "x.mcap", "x.csv", "x.parquet", "x.h5"])
def test_what_exists_is_kept_unless_asked(small, tmp_path, name):
    target = tmp_path / name
    target.write_bytes(b"mine")
    with pytest.raises(TaxelError, match="exists already"):
        convert(small.path, target)
    assert target.read_bytes() == b"mine"


def test_a_folder_of_others_is_never_replaced(small, tmp_path, capsys):
    (tmp_path / "mine.csv").mkdir()
    (tmp_path / "mine.csv" / "notes.txt").write_text("mine")
    told = refusal(capsys, "convert", small.path, tmp_path / "mine.csv", "--overwrite")
    assert "is no folder of a recording" in told
    assert (tmp_path / "mine.csv" / "notes.txt").read_text() == "mine"


WRONG_CSV = {
    "count": (lambda text: text.replace(",0,", ",70000,", 1).replace(",2", ",99999", 1), "line 2"),
    "word": (lambda text: text.replace("\n1,", "\n1,x", 1) + "x,\n", "line "),
    "short": (lambda text: text[: len(text) // 2], "line "),
    "heading": (lambda text: text.replace("sequence", "number", 1), "line 1"),
}


@pytest.mark.parametrize("case", WRONG_CSV)
def test_a_mistake_in_csv_is_one_line_that_names_file_and_line(forms, tmp_path, capsys, case):
    folder = tmp_path / "x.csv"
    shutil.copytree(forms["csv"][0], folder)
    change, place = WRONG_CSV[case]
    file = folder / "slab.csv"
    file.write_text(change(file.read_text()))
    told = refusal(capsys, "convert", folder, tmp_path / "y.parquet")
    assert f"slab.csv: {place}" in told
    assert not (tmp_path / "y.parquet").exists()


def test_files_that_are_no_recordings_are_refused_with_one_line(tmp_path, capsys, forms):
    for name in ("x.parquet", "x.h5", "x.mcap", "x.bin"):
        (tmp_path / name).write_bytes(b"\x89MCAP0\r\nnothing" if name == "x.mcap" else b"nothing")
        assert name in refusal(capsys, "convert", tmp_path / name, tmp_path / "y.bin")
    assert "none.parquet" in refusal(capsys, "convert", tmp_path / "none.parquet", tmp_path / "y.bin")
    (tmp_path / "empty.csv").mkdir()
    assert "recording.json" in refusal(capsys, "convert", tmp_path / "empty.csv", tmp_path / "y.bin")
    assert "expected a name such as" in refusal(capsys, "convert", forms["mcap"][0], tmp_path / "y.avi")
    assert "robot 'plate': expected 1 joint angles" in refusal(
        capsys, "convert", forms["mcap"][0], tmp_path / "y.h5", "--joints", "1,2"
    )
    assert "--joints: expected numbers" in refusal(
        capsys, "convert", forms["mcap"][0], tmp_path / "y.h5", "--joints", "a,2"
    )
    assert [file.name for file in tmp_path.iterdir() if file.name.startswith((".", "y"))] == []


def test_a_missing_pyarrow_is_one_line(forms, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    told = refusal(capsys, "convert", forms["capture"][0], tmp_path / "y.parquet")
    assert "pip install 'taxel[parquet]'" in told


def test_replay_tells_what_is_in_every_form(forms, small, capsys):
    for form, (path, _) in forms.items():
        assert exit_status("replay", path, "--json") == 0
        told = json.loads(capsys.readouterr().out)
        assert sum(board["frames"] for board in told["boards"]) == len(small.frames), form
