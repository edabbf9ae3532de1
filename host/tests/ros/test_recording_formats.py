"""Conversion between the formats of a recording: fields that are kept, fields that are lost, and invalid files."""

import contextlib
import json
import shutil

import numpy as np
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from host.tests.recordings import ALL_FIELDS, TABLE_FIELDS, find_differing_fields, read_frames
from taxel.errors import TaxelError
from taxel.hand.kinematics import build_kinematics
from taxel.link import CaptureError, CaptureLink, CaptureWriter
from taxel.recording.formats import convert
from taxel.recording.formats.grasp_options import GraspOptions
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import Phase

pytest.importorskip("pyarrow")
NAMES = {
    "capture": "x.bin",
    "pcapng": "x.pcapng",
    "mcap": "x.mcap",
    "csv": "x.csv",
    "parquet": "x.parquet",
    "hdf5": "x.h5",
}
BYTE_S = 10 / 1e6
"""Duration of a byte on the wire (10 bits at 1 Mbaud), seconds. PCAPNG stores one packet for each frame, so the mapping
of the clocks has more points than in the capture, and its times differ by less than this.
"""


@pytest.fixture(scope="module")
def converted(recorded_rig, tmp_path_factory):
    """The recording in every format: (path, result of the conversion), by format name."""
    folder = tmp_path_factory.mktemp("formats")
    return {
        format_name: (folder / name, convert(recorded_rig.path, folder / name)) for format_name, name in NAMES.items()
    }


@pytest.fixture
def check_frames(recorded_rig):
    """A function that compares frames with those of the recording."""

    def check(frames, *names):
        """Assert that the fields `names` of the frames are equal, and their times equal to the microsecond."""
        assert find_differing_fields(frames, recorded_rig.frames, *names) == []
        time_errors_s = [a.time_s - b.time_s for a, b in zip(frames, recorded_rig.frames, strict=True)]
        assert max(map(abs, time_errors_s)) < 1e-6

    return check


@pytest.mark.parametrize("format_name", ["capture", "mcap"])
def test_capture_and_mcap_keep_all_fields_and_loss_counters(converted, recorded_rig, format_name):
    path, result = converted[format_name]
    frames, losses = read_frames(path)
    assert find_differing_fields(frames, recorded_rig.frames, *ALL_FIELDS) == []
    assert repr(losses) == repr(recorded_rig.losses)
    assert (result.frames, result.notes) == (len(recorded_rig.frames), [])


def test_pcapng_keeps_all_fields_and_loss_counters_and_times_within_one_byte_on_the_wire(converted, recorded_rig):
    path, result = converted["pcapng"]
    frames, losses = read_frames(path)
    assert find_differing_fields(frames, recorded_rig.frames, *TABLE_FIELDS, "hub_time_us") == []
    errors_s = [a.time_s - b.time_s for a, b in zip(frames, recorded_rig.frames, strict=True)]
    assert max(map(abs, errors_s)) < BYTE_S
    assert repr(losses) == repr(recorded_rig.losses)
    assert (result.frames, result.notes) == (len(recorded_rig.frames), [])


@pytest.mark.parametrize("format_name", ["csv", "parquet"])
def test_csv_and_parquet_keep_counts_sequences_cycles_and_times_and_note_the_losses(
    converted, check_frames, format_name
):
    path, result = converted[format_name]
    check_frames(read_frames(path)[0], *TABLE_FIELDS)
    assert len(result.notes) == 1  # tables do not contain the hub's messages, its bytes and the loss counters


@pytest.mark.parametrize(
    "chain", [("csv", "mcap", "parquet"), ("parquet", "capture", "csv"), ("mcap", "csv", "capture")]
)
def test_chain_of_conversions_keeps_the_fields_of_its_formats(converted, check_frames, tmp_path, chain):
    path = converted[chain[0]][0]
    for format_name in chain[1:]:
        target = tmp_path / NAMES[format_name]
        convert(path, target)
        path = target
    check_frames(read_frames(path)[0], *TABLE_FIELDS)


def test_dataset_keeps_counts_clocks_and_the_first_time_of_each_cycle(converted, recorded_rig, tmp_path):
    path, result = converted["hdf5"]
    # A dataset does not contain the arrival time of each board, and the numbers of cycles and scans.
    assert len(result.notes) == 1
    frames, _ = read_frames(path)
    assert find_differing_fields(frames, recorded_rig.frames, "address", "raw_counts", "board_time_us") == []
    first_time_of_cycle = {}
    for frame in recorded_rig.frames:
        earlier = first_time_of_cycle.get(frame.cycle, frame.time_s)
        first_time_of_cycle[frame.cycle] = min(earlier, frame.time_s)
    expected = [first_time_of_cycle[frame.cycle] for frame in recorded_rig.frames]
    assert np.abs(np.subtract([frame.time_s for frame in frames], expected)).max() < 1e-6


def test_counts_of_a_dataset_are_kept_in_a_conversion_to_mcap(converted, recorded_rig, tmp_path):
    path, _ = converted["hdf5"]
    convert(path, tmp_path / "back.mcap")
    frames_read_back, _ = read_frames(tmp_path / "back.mcap")
    assert find_differing_fields(frames_read_back, recorded_rig.frames, "address", "raw_counts") == []


def test_dataset_is_valid_and_has_the_poses_and_rates_of_the_boards(converted, recorded_rig):
    with GraspDataset(converted["hdf5"][0], baseline_frames=100) as data:
        data.check()
        (grasp,) = data
        assert (data.source, data.hand, grasp.object, grasp.approach) == ("real", "rig4", "unknown", "recording")
        assert (grasp.phase == Phase.BASELINE).sum() == 100
        assert np.array_equal(grasp.joint_position[0], [0.3])  # radians, the constant angle in the recording's header
        poses = build_kinematics(recorded_rig.hand).compute_sensor_poses(grasp.joint_position[0])
        assert np.allclose(grasp.sensor_pose, poses)
        times_of_board = {board.address: [] for board in recorded_rig.hand.boards}
        for frame in recorded_rig.frames:
            times_of_board[frame.address].append(frame.time_s)
        rates = [(len(times) - 1) / (times[-1] - times[0]) for times in times_of_board.values()]
        assert np.allclose(data.sensors.rate_hz, rates, rtol=0.02)


def test_dataset_has_the_labels_of_the_options(converted, tmp_path):
    options = GraspOptions("cylinder", "side_1", session=2, baseline_frames=10)
    convert(converted["parquet"][0], tmp_path / "x.h5", options=options)
    with GraspDataset(tmp_path / "x.h5") as data:
        grasp = data["0001"]
        assert (grasp.object, grasp.approach, grasp.session) == ("cylinder", "side_1", 2)
        assert len(data.objects["cylinder"].vertices) > 8  # more than a box


def test_conversion_with_an_unknown_object_lists_the_known_objects_and_writes_no_file(converted, tmp_path):
    with pytest.raises(TaxelError, match="cylinder, triangular_prism"):
        convert(converted["parquet"][0], tmp_path / "y.h5", options=GraspOptions("ball"))
    assert not (tmp_path / "y.h5").exists()


def write_damaged_copy(path, target, interval, size):
    """Copy a capture, and set the last `size` of every `interval` recorded bytes to 0; record headers stay intact."""
    at = 0
    with CaptureLink(path) as link, CaptureWriter(target, link.header) as out, contextlib.suppress(EOFError):
        while True:
            data, time_ns = link.read()
            offsets = range(at, at + len(data))
            pairs = zip(offsets, data, strict=True)
            out.write(bytes(0 if offset % interval >= interval - size else byte for offset, byte in pairs), time_ns)
            at = offsets.stop


def test_lost_frames_stay_missing_in_every_format(recorded_rig, tmp_path):
    """Tables keep the cycle and scan numbers, from which the missing frames follow."""
    damaged = tmp_path / "damaged.bin"
    write_damaged_copy(recorded_rig.path, damaged, interval=20_000, size=40)
    frames, losses = read_frames(damaged)
    missing = {address: board.missing for address, board in losses.boards.items()}
    assert losses.lost_on_wire >= sum(missing.values()) > 0
    for name in ("h.mcap", "h.csv", "h.parquet"):
        result = convert(damaged, tmp_path / name)
        assert result.missing == sum(missing.values())
        converted_frames, converted_losses = read_frames(tmp_path / name)
        assert find_differing_fields(converted_frames, frames, *TABLE_FIELDS) == []
        assert {address: board.missing for address, board in converted_losses.boards.items()} == missing
    convert(damaged, tmp_path / "h.h5")
    with GraspDataset(tmp_path / "h.h5") as dataset:
        assert dataset["0001"].valid.sum() == len(frames)


def test_csv_has_a_file_for_each_board_and_the_coordinates_of_active_taxels(converted, recorded_rig):
    folder = converted["csv"][0]
    names = {f"{board.name}.csv" for board in recorded_rig.hand.boards}
    assert {file.name for file in folder.iterdir()} == names | {"active.csv", "recording.json"}
    heading, first, *_ = (folder / "slab.csv").read_text().splitlines()
    assert heading.startswith("frame,address,time_s,sequence,cycle,board_time_us,hub_time_us,taxel_0,taxel_1,")
    slab = next(frame for frame in recorded_rig.frames if frame.address == 0x50)
    assert first.split(",")[7:] == [str(count) for count in slab.raw_counts]
    heading, *active = (folder / "active.csv").read_text().splitlines()
    assert heading == "grasp,object,approach,time,x,y,z,active"
    assert len(active) > 10
    x, y, z = map(float, active[-1].split(",")[4:7])
    centres = build_kinematics(recorded_rig.hand).compute_taxel_positions([0.3])
    assert np.linalg.norm(centres - [x, y, z], axis=1).min() < 1e-6
    assert json.loads((folder / "recording.json").read_text())["hand"] == "rig4"


def test_truncated_source_is_converted_up_to_the_truncation_and_then_an_error_is_raised(recorded_rig, tmp_path):
    truncated = tmp_path / "truncated.bin"
    truncated.write_bytes(recorded_rig.path.read_bytes()[:-999])
    with pytest.raises(CaptureError, match="is cut short"):
        convert(truncated, tmp_path / "x.parquet")
    frames, _ = read_frames(tmp_path / "x.parquet")
    assert 0.8 * len(recorded_rig.frames) < len(frames) < len(recorded_rig.frames)


@pytest.mark.parametrize("name", ["x.bin", "x.pcapng", "x.mcap", "x.csv", "x.parquet", "x.h5"])
def test_existing_target_is_kept_without_overwrite(recorded_rig, tmp_path, name):
    target = tmp_path / name
    target.write_bytes(b"existing")
    with pytest.raises(TaxelError, match="exists already"):
        convert(recorded_rig.path, target)
    assert target.read_bytes() == b"existing"


def test_folder_that_is_no_recording_is_never_replaced(recorded_rig, tmp_path, capsys):
    (tmp_path / "notes.csv").mkdir()
    (tmp_path / "notes.csv" / "notes.txt").write_text("notes")
    message = run_refused_command(capsys, "convert", recorded_rig.path, tmp_path / "notes.csv", "--overwrite")
    assert "is no folder of a recording" in message
    assert (tmp_path / "notes.csv" / "notes.txt").read_text() == "notes"


WRONG_CSV = {
    "count too large": (lambda text: text.replace(",0,", ",70000,", 1).replace(",2", ",99999", 1), "line 2"),
    "word instead of a number": (lambda text: text.replace("\n1,", "\n1,x", 1) + "x,\n", "line "),
    "truncated line": (lambda text: text[: len(text) // 2], "line "),
    "wrong heading": (lambda text: text.replace("sequence", "number", 1), "line 1"),
}
"""Change of the text of a CSV file, and the place that the error names."""


@pytest.mark.parametrize("case", WRONG_CSV)
def test_error_in_csv_names_file_and_line(converted, tmp_path, capsys, case):
    folder = tmp_path / "x.csv"
    shutil.copytree(converted["csv"][0], folder)
    change, place = WRONG_CSV[case]
    file = folder / "slab.csv"
    file.write_text(change(file.read_text()))
    message = run_refused_command(capsys, "convert", folder, tmp_path / "y.parquet")
    assert f"slab.csv: {place}" in message
    assert not (tmp_path / "y.parquet").exists()


@pytest.mark.parametrize("name", ["x.parquet", "x.h5", "x.mcap", "x.pcapng", "x.bin"])
def test_file_that_is_no_recording_is_refused_and_nothing_is_written(tmp_path, capsys, name):
    (tmp_path / name).write_bytes(b"\x89MCAP0\r\nnothing" if name == "x.mcap" else b"nothing")
    assert name in run_refused_command(capsys, "convert", tmp_path / name, tmp_path / "y.bin")
    assert [file.name for file in tmp_path.iterdir()] == [name]


def test_missing_source_and_folder_without_a_recording_are_refused(tmp_path, capsys):
    assert "none.parquet" in run_refused_command(capsys, "convert", tmp_path / "none.parquet", tmp_path / "y.bin")
    (tmp_path / "empty.csv").mkdir()
    assert "recording.json" in run_refused_command(capsys, "convert", tmp_path / "empty.csv", tmp_path / "y.bin")
    assert [file.name for file in tmp_path.iterdir()] == ["empty.csv"]


@pytest.mark.parametrize(
    ("target", "options", "expected_text"),
    [
        ("y.avi", (), "expected a name such as"),
        ("y.h5", ("--joint-angles", "1,2"), "robot 'plate': expected 1 joint angles"),
        ("y.h5", ("--joint-angles", "a,2"), "--joint-angles: expected numbers"),
    ],
)
def test_invalid_arguments_of_a_conversion_are_refused_and_nothing_is_written(
    tmp_path, capsys, converted, target, options, expected_text
):
    message = run_refused_command(capsys, "convert", converted["mcap"][0], tmp_path / target, *options)
    assert expected_text in message
    assert list(tmp_path.iterdir()) == []


def test_missing_pyarrow_gives_the_install_command(converted, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    message = run_refused_command(capsys, "convert", converted["capture"][0], tmp_path / "y.parquet")
    assert "pip install 'taxel[parquet]'" in message


def test_replay_reports_the_frames_of_every_format(converted, recorded_rig, capsys):
    for format_name, (path, _) in converted.items():
        assert run_taxel("replay", path, "--json") == 0
        summary = json.loads(capsys.readouterr().out)
        assert sum(board["frames"] for board in summary["boards"]) == len(recorded_rig.frames), format_name
