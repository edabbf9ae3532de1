"""All writers of the project as cases of the fault campaign."""

import io
from collections.abc import Callable, Hashable
from pathlib import Path

import numpy as np
from crash_case import Acknowledge, Case, make_live_case, make_whole_case
from crash_readers import (
    read_bytes,
    read_capture,
    read_frames,
    read_grasps,
    read_hdf5,
    read_history,
    read_lines,
    read_mcap,
    read_pcapng,
    read_seal,
    read_tests,
)

from taxel.blind.run_folder import seal_worlds
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files import write_cloud
from taxel.gap.apply.rewriting import DatasetEditor, copy_file, open_temporary_output
from taxel.hand.joint_history import JointFileWriter
from taxel.link import CaptureWriter
from taxel.link.pcapng import PcapngWriter
from taxel.output import AppendedLines, LiveOutput, open_whole_text, write_whole
from taxel.output.figure import save_figure
from taxel.recording.formats import convert
from taxel.recording.general.format import Contact, GeneralHeader, Properties
from taxel.recording.general.writer import write_general
from taxel.recording.grasp_record import GraspRecord
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.recording.grasp_writer import DatasetHeader, GraspDatasetWriter
from taxel.ros import mcap_file
from taxel.ros.mcap_file import McapFile
from taxel_tools.bench.saving import save_record
from taxel_tools.testing.history import History
from taxel_tools.testing.record import Outcome, PhaseRecord, TestRecord

RECORDS = 4
"""Records of a case that appends: enough for a first, a middle and a last one."""


def _write_text(path: Path, is_new: bool) -> None:
    """Write a report of 16,000 (new) or 12,000 (old) characters."""
    write_whole(path, "new " * 4000 if is_new else "old " * 3000)


def _write_table(path: Path, is_new: bool) -> None:
    """Write a CSV table of 2,000 rows; the second column states whether the content is new."""
    with open_whole_text(path) as file:
        for row in range(2000):
            file.write(f"{row},{is_new}\n")


def _write_picture(path: Path, is_new: bool) -> None:
    """Write a picture of 150 kB through the function that saves figures."""

    class Figure:
        """Figure whose picture has the bytes of a large PNG file; the content is of no importance here."""

        def savefig(self, target: io.BytesIO, **options: object) -> None:
            target.write((b"new" if is_new else b"old") * 50_000)

    save_figure(Figure(), path)


def _write_cloud(path: Path, is_new: bool) -> None:
    """Write a cloud of 100 points; the new one is displaced by 1 m."""
    points = np.arange(300.0).reshape(-1, 3) + is_new
    write_cloud(ContactCloud.from_points(points), path, overwrite=True)


def _write_general(path: Path, is_new: bool) -> None:
    """Write an HDF5 file of the general format with three contacts; the new values are larger by 1."""
    header = GeneralHeader("real", "pad", generator="fault campaign", properties=Properties(contact="lowers"))
    values = np.full((40, 6), 100.0 + is_new)
    contacts = [Contact(f"{number:04}", 0, np.arange(40) / 100.0, values) for number in range(3)]
    write_general(path, header, contacts, overwrite=True)


def make_header() -> DatasetHeader:
    """Create the header of a dataset of 12 taxels on one board."""
    index = np.arange(12)
    taxels = TaxelTable(
        np.full(12, 8, np.uint8), (index // 4).astype(np.uint8), (index % 4).astype(np.uint8),
        index[:, None] * np.array([0.005, 0.0, 0.0]), np.tile([0.0, 0.0, 1.0], (12, 1)), np.full(12, 0.003),
    )  # fmt: skip
    sensors = SensorTable(np.array([8], np.uint8), ("pad",), ("kind",), np.ones(1))
    cube = ObjectMesh(np.eye(3), np.array([[0, 1, 2]], np.int32))
    return DatasetHeader("real", "pad", taxels, sensors, {"cube": cube}, "fault campaign", created="2024-01-01")


def make_grasp(number: int) -> GraspRecord:
    """Create a grasp whose counts depend on its number.

    The counts are random, so their compressed chunks are large enough for several write calls.
    """
    frames = 800
    phase = np.repeat(np.arange(4, dtype=np.uint8), frames // 4)
    counts = np.random.default_rng(number).integers(0, 65_536, (frames, 12)).astype(np.uint16)
    return GraspRecord(
        object="cube", approach="top", iteration=number, session=0, timestamp=np.arange(frames) / 100.0, phase=phase,
        raw_counts=counts, valid=np.ones((frames, 1), bool), sensor_pose=np.eye(4)[None], object_pose=np.eye(4),
    )  # fmt: skip


def _write_dataset(path: Path, first: int, acknowledge: Acknowledge = lambda: None) -> None:
    """Write a dataset of `RECORDS` grasps, numbered from `first`."""
    with GraspDatasetWriter.create(path, make_header(), overwrite=True) as out:
        for number in range(RECORDS):
            out.add(make_grasp(first + number))
            acknowledge()


def _extend_dataset(folder: Path, source: Path, acknowledge: Acknowledge) -> None:
    """Append `RECORDS` grasps with the numbers from 100 to the dataset x.h5 in `folder` (`Case.run`).

    source: not used. acknowledge: called after each complete grasp.
    """
    with GraspDatasetWriter.extend(folder / "x.h5") as out:
        for number in range(RECORDS):
            out.add(make_grasp(100 + number))
            acknowledge()


def _apply(folder: Path, source: Path, acknowledge: Acknowledge) -> None:
    """Replace the counts of one grasp of x.h5 as `taxel gap apply` does: in a temporary copy that replaces the file."""
    target = folder / "x.h5"
    with open_temporary_output(target, (), overwrite=True) as whole:
        copy_file(target, whole)
        with DatasetEditor(whole) as file:
            file.replace_array("0001", "raw_counts", make_grasp(50).raw_counts)
            file.add_provenance("changed")
    acknowledge()


def _make_conversion_case(name: str, file: str, read: Callable[[Path], Hashable]) -> Case:
    """Create the case of a conversion of a capture to another format.

    The old output contains the frames of a shorter capture.
    """

    def prepare(folder: Path, source: Path) -> None:
        convert(source.with_name("short.bin"), folder / file)

    def run(folder: Path, source: Path, acknowledge: Acknowledge) -> None:
        convert(source, folder / file, overwrite=True)
        acknowledge()

    return Case(f"convert to {name}", "whole", prepare, run, lambda folder: read(folder / file), (file,))


def _record_capture(path: Path, first: int, acknowledge: Acknowledge = lambda: None) -> None:
    """Record a capture of `RECORDS` chunks, whose bytes contain their numbers from `first`."""
    with CaptureWriter(path, {"note": "x"}, overwrite=True) as writer:
        for number in range(RECORDS):
            writer.write(f"record {first + number} ".encode() * 30, number)
            acknowledge()


def _record_pcapng(path: Path, first: int, acknowledge: Acknowledge = lambda: None) -> None:
    """Record a PCAPNG file of `RECORDS` packets, whose bytes contain their numbers from `first`."""
    with PcapngWriter(path, {"note": "x"}, overwrite=True) as writer:
        for number in range(RECORDS):
            writer.write(f"record {first + number} ".encode() * 30 + b"\0", number)
            acknowledge()


def _record_mcap(path: Path, first: int, acknowledge: Acknowledge = lambda: None) -> None:
    """Record an MCAP file of `RECORDS` messages, whose bytes contain their numbers from `first`."""
    longest = mcap_file.FLUSH_S
    mcap_file.FLUSH_S = 0.0  # type: ignore[misc] # a message is complete when it is flushed: flush each of them
    try:
        with McapFile(path, {"note": "x"}, overwrite=True) as file:
            for number in range(RECORDS):
                file.write_bytes(f"record {first + number} ".encode() * 30, number, number)
                acknowledge()
    finally:
        mcap_file.FLUSH_S = longest  # type: ignore[misc]


def _record_joints(path: Path, first: int, acknowledge: Acknowledge = lambda: None) -> None:
    """Record a CSV file of joint angles with `RECORDS` rows; the first angle is the number of the row from `first`."""
    writer = JointFileWriter(LiveOutput(path, overwrite=True), ("a", "b"))
    try:
        for number in range(RECORDS):
            writer.write(float(number), np.array([first + number, 0.5]))
            acknowledge()
    finally:
        writer.close()


def _append_lines(folder: Path, source: Path, acknowledge: Acknowledge) -> None:
    """Append `RECORDS` answers to answers.jsonl."""
    with AppendedLines(folder / "answers.jsonl") as file:
        for number in range(RECORDS):
            file.append(f'{{"number": {number}}}' + " " * 200)
            acknowledge()


def _make_test(number: int) -> TestRecord:
    """Create the record of a bench test without measurements; serial number and time contain `number`."""
    phase = PhaseRecord("scan", "Scan", Outcome.PASS, True, 1.0, [], [], [], [f"test {number}"], "")
    return TestRecord(
        f"AB-{number:04}", "", "bench", "plan", "1", "0" * 64, {}, "1.0", f"2024-01-01T00:00:{number:02}Z",
        Outcome.PASS, [phase], 1.0,
    )  # fmt: skip


def _add_to_history(folder: Path, first: int, acknowledge: Acknowledge = lambda: None) -> None:
    """Add two bench tests with the numbers from `first` to the history, each in a separate connection."""
    for number in range(2):
        with History(folder / "history.sqlite") as history:
            history.add(_make_test(first + number))
        acknowledge()


def _save_test(folder: Path, source: Path, acknowledge: Acknowledge) -> None:
    """Save a bench test as `taxel bench` does: its reports in a folder, and its entry in the history."""
    save_record(_make_test(1), folder / "tests", folder / "history.sqlite")
    acknowledge()


def _seal(folder: Path, source: Path, acknowledge: Acknowledge) -> None:
    """Seal two worlds of a blind check in the folder check."""
    seal_worlds(folder / "check", 2, 0, 7)
    acknowledge()


CASES: tuple[Case, ...] = (
    make_whole_case("report (JSON, HTML, JUnit)", "report.json", _write_text, read_bytes),
    make_whole_case("table (CSV)", "table.csv", _write_table, read_bytes),
    make_whole_case("picture (PNG)", "picture.png", _write_picture, read_bytes),
    make_whole_case("cloud (PLY)", "cloud.ply", _write_cloud, read_bytes),
    make_whole_case("import (HDF5)", "general.h5", _write_general, read_hdf5),
    Case("gap apply (HDF5)", "whole", lambda folder, source: _write_dataset(folder / "x.h5", 0), _apply,
         lambda folder: read_grasps(folder / "x.h5"), ("x.h5",)),
    _make_conversion_case("capture", "x.bin", read_frames),
    _make_conversion_case("PCAPNG", "x.pcapng", read_frames),
    _make_conversion_case("MCAP", "x.mcap", read_frames),
    _make_conversion_case("HDF5", "x.h5", read_grasps),
    _make_conversion_case("Parquet", "x.parquet", read_frames),
    _make_conversion_case("CSV folder", "x.csv", read_bytes),
    make_live_case("record (capture)", "live.bin", _record_capture, read_capture),
    make_live_case("record (PCAPNG)", "live.pcapng", _record_pcapng, read_pcapng),
    make_live_case("record (MCAP)", "live.mcap", _record_mcap, read_mcap),
    make_live_case("record (joint angles)", "live.joints.csv", _record_joints, read_lines),
    make_live_case("grasp (HDF5)", "live.h5", _write_dataset, read_grasps),
    Case("grasp --resume (HDF5)", "append", lambda folder, source: _write_dataset(folder / "x.h5", 0),
         _extend_dataset, lambda folder: read_grasps(folder / "x.h5"), ("x.h5",)),
    Case("answers of a benchmark", "append", lambda folder, source: write_whole(folder / "answers.jsonl", "first\n"),
         _append_lines, lambda folder: read_lines(folder / "answers.jsonl"), ("answers.jsonl",)),
    Case("bench history (SQLite)", "append", lambda folder, source: _add_to_history(folder, 0),
         lambda folder, source, acknowledge: _add_to_history(folder, 10, acknowledge), read_history,
         ("history.sqlite",)),
    Case("bench reports (folder)", "whole", lambda folder, source: (folder / "tests").mkdir(), _save_test, read_tests,
         ("history.sqlite", "tests")),
    Case("blind seal", "whole", lambda folder, source: None, _seal, read_seal, ("check",)),
)  # fmt: skip
