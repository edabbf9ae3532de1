"""Writers of the project as cases of the fault campaign: prepare an old output, write a new one, read the result."""

import hashlib
import io
import sqlite3
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from taxel.blind.run_folder import open_sealed_worlds, seal_worlds
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files import write_cloud
from taxel.gap.apply.rewriting import DatasetEditor, copy_file, open_temporary_output
from taxel.hand.joint_history import JointFileWriter
from taxel.link import CaptureLink, CaptureWriter
from taxel.link.pcapng import PcapngWriter
from taxel.link.pcapng_link import PcapngLink
from taxel.output import AppendedLines, LiveOutput, open_whole_text, write_whole
from taxel.output.figure import save_figure
from taxel.recording.formats import convert, open_recording
from taxel.recording.general.format import Contact, GeneralHeader, Properties
from taxel.recording.general.writer import write_general
from taxel.recording.grasp_record import GraspRecord
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.recording.grasp_writer import DatasetHeader, GraspDatasetWriter
from taxel.ros import mcap_file
from taxel.ros.mcap_file import McapFile
from taxel.skin import Skin
from taxel_tools.bench.saving import save_record
from taxel_tools.testing.history import History
from taxel_tools.testing.record import Outcome, PhaseRecord, TestRecord

Acknowledge = Callable[[], None]
"""Called by a case when a record is complete: from then on it must not be lost."""

RECORDS = 4
"""Records of a case that appends: enough for a first, a middle and a last one."""


@dataclass(frozen=True)
class Case:
    """A writer.

    Attributes:
        name: for the table and the command line.
        guarantee: "whole" (the old or the new output), "live" (all complete records) or "append" (all complete
            records, old and new).
        prepare: writes the old output into a folder; the argument is the capture that conversions read.
        run: writes the new output into the folder, and calls its last argument after each complete record.
        read: content of the output in the folder, as a value that can be compared; raises if it is unreadable.
        names: names in the folder after a complete run.
    """

    name: str
    guarantee: str
    prepare: Callable[[Path, Path], None]
    run: Callable[[Path, Path, Acknowledge], None]
    read: Callable[[Path], Hashable]
    names: tuple[str, ...]


def _digest(*parts: bytes) -> str:
    """Return the first 16 hexadecimal digits of the SHA-256 of the parts, joined by zero bytes."""
    return hashlib.sha256(b"\0".join(parts)).hexdigest()[:16]


def _whole(name: str, file: str, write: Callable[[Path, bool], None], read: Callable[[Path], Hashable]) -> Case:
    """Create the case of a writer that replaces a file.

    write: called with the path, and whether it writes the new content. read: called with the path.
    """

    def run(folder: Path, source: Path, acknowledge: Acknowledge) -> None:
        write(folder / file, True)
        acknowledge()

    return Case(
        name, "whole", lambda folder, source: write(folder / file, False), run, lambda at: read(at / file), (file,)
    )


def _read_bytes(path: Path) -> str:
    """Return the digest of a file's bytes, or of the names and bytes of all files in a folder."""
    if path.is_dir():
        return _digest(*(part for file in sorted(path.iterdir()) for part in (file.name.encode(), file.read_bytes())))
    return _digest(path.read_bytes())


def _read_hdf5(path: Path) -> tuple[str, ...]:
    """Return the digests of the arrays in an HDF5 file, in the order of their names."""
    found: dict[str, str] = {}

    def visit(name: str, node: object) -> None:
        if isinstance(node, h5py.Dataset):
            found[name] = _digest(name.encode(), np.asarray(node[()]).astype("S").tobytes())

    with h5py.File(path, "r", locking=False) as file:
        file.visititems(visit)
    return tuple(found[name] for name in sorted(found))


def _read_grasps(path: Path) -> tuple[str, ...]:
    """Return the digest of the raw counts of each grasp in a dataset, in order of the grasps' names."""
    with h5py.File(path, "r", locking=False) as file:
        return tuple(
            _digest(name.encode(), file["grasps"][name]["raw_counts"][()].tobytes()) for name in file["grasps"]
        )


def _read_frames(path: Path) -> str:
    """Return one digest of all frames of a recording."""
    link, hand = open_recording(path)
    with Skin(link, hand) as skin:
        return _digest(*(frame.raw_counts.tobytes() + bytes([frame.address]) for frame in skin))


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


def _make_header() -> DatasetHeader:
    """Create the header of a dataset of 12 taxels on one board."""
    index = np.arange(12)
    taxels = TaxelTable(
        np.full(12, 8, np.uint8), (index // 4).astype(np.uint8), (index % 4).astype(np.uint8),
        index[:, None] * np.array([0.005, 0.0, 0.0]), np.tile([0.0, 0.0, 1.0], (12, 1)), np.full(12, 0.003),
    )  # fmt: skip
    sensors = SensorTable(np.array([8], np.uint8), ("pad",), ("kind",), np.ones(1))
    cube = ObjectMesh(np.eye(3), np.array([[0, 1, 2]], np.int32))
    return DatasetHeader("real", "pad", taxels, sensors, {"cube": cube}, "fault campaign", created="2024-01-01")


def _make_grasp(number: int) -> GraspRecord:
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
    with GraspDatasetWriter.create(path, _make_header(), overwrite=True) as out:
        for number in range(RECORDS):
            out.add(_make_grasp(first + number))
            acknowledge()


def _extend_dataset(folder: Path, source: Path, acknowledge: Acknowledge) -> None:
    """Append `RECORDS` grasps with the numbers from 100 to the dataset x.h5."""
    with GraspDatasetWriter.extend(folder / "x.h5") as out:
        for number in range(RECORDS):
            out.add(_make_grasp(100 + number))
            acknowledge()


def _apply(folder: Path, source: Path, acknowledge: Acknowledge) -> None:
    """Replace the counts of one grasp of x.h5 as `taxel gap apply` does: in a temporary copy that replaces the file."""
    target = folder / "x.h5"
    with open_temporary_output(target, (), overwrite=True) as whole:
        copy_file(target, whole)
        with DatasetEditor(whole) as file:
            file.replace_array("0001", "raw_counts", _make_grasp(50).raw_counts)
            file.add_provenance("changed")
    acknowledge()


def _convert(name: str, file: str, read: Callable[[Path], Hashable]) -> Case:
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


def _read_capture(path: Path) -> tuple[str, ...]:
    """Return the digest of each complete record of a capture; an incomplete last record is omitted."""
    with CaptureLink(path) as link:
        return _read_chunks(link)


def _read_chunks(link: CaptureLink | PcapngLink) -> tuple[str, ...]:
    """Return the digest of each chunk of an open recording, up to its end or up to an incomplete record."""
    found: list[str] = []
    while True:
        try:
            found.append(_digest(link.read().data))
        except (EOFError, ValueError):
            return tuple(found)
        except Exception as error:
            if "cut short" not in str(error):
                raise
            return tuple(found)


def _record_pcapng(path: Path, first: int, acknowledge: Acknowledge = lambda: None) -> None:
    """Record a PCAPNG file of `RECORDS` packets, whose bytes contain their numbers from `first`."""
    with PcapngWriter(path, {"note": "x"}, overwrite=True) as writer:
        for number in range(RECORDS):
            writer.write(f"record {first + number} ".encode() * 30 + b"\0", number)
            acknowledge()


def _read_pcapng(path: Path) -> tuple[str, ...]:
    """Return the digest of each complete packet of a PCAPNG file; an incomplete last packet is omitted."""
    with PcapngLink(path) as link:
        return _read_chunks(link)


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


def _read_mcap(path: Path) -> tuple[str, ...]:
    """Return the digest of each complete message of an MCAP file, read from front to back."""
    from mcap.records import Message
    from mcap.stream_reader import StreamReader

    found: list[str] = []
    with path.open("rb") as stream:
        records = StreamReader(stream, emit_chunks=False).records
        while True:
            try:
                record = next(records)
            except StopIteration:
                return tuple(found)
            except Exception as error:
                if type(error).__name__ not in ("EndOfFile", "RecordLengthLimitExceeded", "struct.error", "error"):
                    raise
                return tuple(found)
            if isinstance(record, Message):
                found.append(_digest(record.data))


def _record_joints(path: Path, first: int, acknowledge: Acknowledge = lambda: None) -> None:
    """Record a CSV file of joint angles with `RECORDS` rows; the first angle is the number of the row from `first`."""
    writer = JointFileWriter(LiveOutput(path, overwrite=True), ("a", "b"))
    try:
        for number in range(RECORDS):
            writer.write(float(number), np.array([first + number, 0.5]))
            acknowledge()
    finally:
        writer.close()


def _read_lines(path: Path) -> tuple[str, ...]:
    """Return the complete lines of a text file; an incomplete last line is omitted."""
    text = path.read_text()
    return tuple(text[: text.rfind("\n") + 1].splitlines())


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


def _read_history(folder: Path) -> tuple[str, ...]:
    """Return the serial numbers of the tests in a history, after an integrity check of the database."""
    connection = sqlite3.connect(folder / "history.sqlite")
    try:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        return tuple(row[0] for row in connection.execute("SELECT serial_number FROM run ORDER BY id"))
    finally:
        connection.close()


def _save_test(folder: Path, source: Path, acknowledge: Acknowledge) -> None:
    """Save a bench test as `taxel bench` does: its reports in a folder, and its entry in the history."""
    save_record(_make_test(1), folder / "tests", folder / "history.sqlite")
    acknowledge()


def _read_tests(folder: Path) -> tuple[str, ...]:
    """Return the names of the bench-test folders that have their final name.

    Raises AssertionError if such a folder does not contain exactly the three reports.
    """
    done = sorted(path for path in (folder / "tests").iterdir() if not path.name.startswith("."))
    for path in done:
        assert {file.name for file in path.iterdir()} == {"report.html", "result.json", "junit.xml"}, path
    return tuple(path.name for path in done)


def _seal(folder: Path, source: Path, acknowledge: Acknowledge) -> None:
    """Seal two worlds of a blind check in the folder check."""
    seal_worlds(folder / "check", 2, 0, 7)
    acknowledge()


def _read_seal(folder: Path) -> int:
    """Return the number of sealed worlds, each verified against its commitment; 0 without the file of keys."""
    return len(open_sealed_worlds(folder / "check")) if (folder / "check" / "sealed" / "keys.json").exists() else 0


def _live(name: str, file: str, write: Callable[..., None], read: Callable[[Path], Hashable]) -> Case:
    """Create the case of a recording that replaces another one.

    write: called with the path and the number of the first record.
    """
    return Case(
        name, "live", lambda folder, source: write(folder / file, 0),
        lambda folder, source, acknowledge: write(folder / file, 10, acknowledge), lambda at: read(at / file), (file,),
    )  # fmt: skip


CASES: tuple[Case, ...] = (
    _whole("report (JSON, HTML, JUnit)", "report.json", _write_text, _read_bytes),
    _whole("table (CSV)", "table.csv", _write_table, _read_bytes),
    _whole("picture (PNG)", "picture.png", _write_picture, _read_bytes),
    _whole("cloud (PLY)", "cloud.ply", _write_cloud, _read_bytes),
    _whole("import (HDF5)", "general.h5", _write_general, _read_hdf5),
    Case("gap apply (HDF5)", "whole", lambda folder, source: _write_dataset(folder / "x.h5", 0), _apply,
         lambda folder: _read_grasps(folder / "x.h5"), ("x.h5",)),
    _convert("capture", "x.bin", _read_frames),
    _convert("PCAPNG", "x.pcapng", _read_frames),
    _convert("MCAP", "x.mcap", _read_frames),
    _convert("HDF5", "x.h5", _read_grasps),
    _convert("Parquet", "x.parquet", _read_frames),
    _convert("CSV folder", "x.csv", _read_bytes),
    _live("record (capture)", "live.bin", _record_capture, _read_capture),
    _live("record (PCAPNG)", "live.pcapng", _record_pcapng, _read_pcapng),
    _live("record (MCAP)", "live.mcap", _record_mcap, _read_mcap),
    _live("record (joint angles)", "live.joints.csv", _record_joints, _read_lines),
    _live("grasp (HDF5)", "live.h5", _write_dataset, _read_grasps),
    Case("grasp --resume (HDF5)", "append", lambda folder, source: _write_dataset(folder / "x.h5", 0),
         _extend_dataset, lambda folder: _read_grasps(folder / "x.h5"), ("x.h5",)),
    Case("answers of a benchmark", "append", lambda folder, source: write_whole(folder / "answers.jsonl", "first\n"),
         _append_lines, lambda folder: _read_lines(folder / "answers.jsonl"), ("answers.jsonl",)),
    Case("bench history (SQLite)", "append", lambda folder, source: _add_to_history(folder, 0),
         lambda folder, source, acknowledge: _add_to_history(folder, 10, acknowledge), _read_history,
         ("history.sqlite",)),
    Case("bench reports (folder)", "whole", lambda folder, source: (folder / "tests").mkdir(), _save_test, _read_tests,
         ("history.sqlite", "tests")),
    Case("blind seal", "whole", lambda folder, source: None, _seal, _read_seal, ("check",)),
)  # fmt: skip
