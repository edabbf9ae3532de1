"""Conversion of a recording from one format to another.

The source is opened as a skin. The target is written from the frames of this skin.
"""

import importlib.metadata
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from taxel.errors import TaxelError
from taxel.hand import Hand, load_hand
from taxel.hand.joint_history import JointHistory
from taxel.link import CaptureError, Link
from taxel.recording.formats.csv_format import CsvSink, open_csv
from taxel.recording.formats.frame_table import FrameSink, check_target
from taxel.recording.formats.grasp_options import GraspOptions
from taxel.recording.formats.recorded_joints import load_recorded_joints
from taxel.recording.formats.recording_sink import RecordingSink
from taxel.ros.topics import SkinTopics
from taxel.skin import Skin, load_recorded_hand, open_source
from taxel.skin.recorder import make_joint_source, record_link
from taxel.skin.recording_link import make_recording_header
from taxel.stream.encoder import FramesLink
from taxel.types import FloatArray

FORMATS = {
    "capture": (".bin",), "pcapng": (".pcapng",), "mcap": (".mcap",),
    "hdf5": (".h5", ".hdf5"), "parquet": (".parquet",), "csv": (".csv", "/"),
}  # fmt: skip
"""Formats of a recording and the endings of their names. CSV is a folder."""

_NAMES = "x.bin (capture), x.pcapng (Wireshark), x.mcap, x.h5 (grasp dataset), x.parquet or x.csv (a folder)"

LOSSES = {
    "capture": "",
    "pcapng": "",
    "mcap": "",
    "csv": "CSV contains frames only: not the hub's messages, its bytes, or the number of frames lost on the wire",
    "parquet": "Parquet contains frames only: not the hub's messages, its bytes, or the number of frames lost on the "
    "wire",
    "hdf5": "a grasp dataset contains one row for each poll cycle: not the time of arrival of each board, the numbers "
    "of cycles and scans, or cycles in which no board answered",
}
"""Information that a format does not contain, as a sentence for the user; "" for a complete format."""

ENCODED_NOTE = (
    "the bytes are encoded from the frames: times have a resolution of 1 us, and the hub's clock is the clock of the "
    "recording"
)
"""Sentence for the user when a complete format is written from a source that contains frames only."""


@dataclass(frozen=True)
class ConversionResult:
    """Result of a conversion.

    frames: number of converted board frames. missing: number of board frames that are missing according to the numbers
    of the poll cycles. lost_on_wire: number of frames lost between hub and host. seconds: duration of the recording.
    notes: sentences about information that the target does not contain.
    """

    frames: int
    missing: int
    lost_on_wire: int
    seconds: float
    notes: list[str] = field(default_factory=list)


def format_of(path: str | os.PathLike[str]) -> str:
    """Return the format of a recording by its file name, a key of `FORMATS`. Raises TaxelError for another name."""
    text = os.fspath(path)
    if Path(text).is_dir():
        return "csv"
    for name, endings in FORMATS.items():
        if text.endswith(endings):
            return name
    raise TaxelError(f"{text}: expected a name such as {_NAMES}")


def open_recording(
    path: str | os.PathLike[str], hand: Hand | str | os.PathLike[str] | None = None, grasp: str | None = None
) -> tuple[Link, Hand]:
    """Open a recording in any format; return (link that plays the recording, description of its hand).

    hand: description, or its name or file; None: the hand that the recording contains or names. grasp: id of the grasp
    in a dataset with several grasps. Raises TaxelError for a file that is no recording.
    """
    text = os.fspath(path)
    table_formats = {ending: name for name in ("hdf5", "parquet") for ending in FORMATS[name]}
    format_name = "csv" if Path(text).is_dir() else table_formats.get(Path(text).suffix)
    if format_name is None:
        return open_source(f"file:{text}", hand)
    if not Path(text).exists():
        raise CaptureError(text, "cannot be read (No such file or directory)")
    link = _open_frames(Path(text), format_name, grasp)
    if hand is None:
        return link, load_recorded_hand(link)
    return link, hand if isinstance(hand, Hand) else load_hand(hand)


def _open_frames(path: Path, format_name: str, grasp: str | None) -> FramesLink:
    """Open a recording in a format without the hub's bytes ("csv", "parquet" or "hdf5") as a link.

    grasp: id of the grasp to open in a grasp dataset; None: its only grasp.
    """
    if format_name == "csv":
        return open_csv(path)
    if format_name == "parquet":
        from taxel.recording.formats.parquet_format import open_parquet

        return open_parquet(path)
    from taxel.recording.formats.hdf5_format import open_hdf5_recording  # needs h5py, which is optional

    return open_hdf5_recording(path, grasp)


def convert(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    hand: Hand | str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    joint_position: npt.ArrayLike | JointHistory | None = None,
    grasp: str | None = None,
    options: GraspOptions | None = None,
    progress: Callable[[float], None] = lambda seconds: None,
) -> ConversionResult:
    """Write the recording `source` as `target`, in the format of the target's name, with constant memory.

    hand, grasp: as for `open_recording`. joint_position: angles of the hand's robot, radians [j], or measured angles
    over time; None: the measured angles of every frame that the source contains, else its constant angles, else 0.
    options: grasp properties for a grasp dataset and for the active taxels in CSV. progress: called with the converted
    seconds. A truncated source is converted up to the truncation; then its `CaptureError` is raised. Raises TaxelError
    if the target exists and `overwrite` is False.
    """
    format_name = format_of(target)
    path = Path(os.fspath(target).rstrip("/") or "/")
    check_target(path, overwrite)
    link, description = open_recording(source, hand, grasp)
    try:
        header = make_recording_header(f"file:{os.fspath(source)}", link, description, hand)
    except BaseException:
        link.close()
        raise
    has_bytes = not isinstance(link, FramesLink)
    angles = _choose_joints(source, description, header, joint_position, grasp)
    if format_name in ("capture", "pcapng", "mcap"):
        try:
            recording = RecordingSink(path, overwrite, isinstance(angles, JointHistory) and format_name != "mcap")
        except BaseException:
            link.close()
            raise
        with recording.discarded_on_error():
            recorded = record_link(link, description, header, path, overwrite, angles, *recording.open())
        return _convert_frames(recorded, recording, [] if has_bytes else [ENCODED_NOTE], progress)
    skin = Skin(link, description)
    if isinstance(angles, JointHistory):
        header.pop("joint_position", None)
    elif angles is not None:
        header["joint_position"] = angles.tolist()
    try:
        sink = _open_sink(format_name, path, skin, header, options or GraspOptions(), angles, overwrite)
    except BaseException:
        skin.close()
        raise
    return _convert_frames(skin, sink, [LOSSES[format_name]], progress)


def _choose_joints(
    source: str | os.PathLike[str],
    hand: Hand,
    header: dict[str, Any],
    joint_position: npt.ArrayLike | JointHistory | None,
    grasp: str | None,
) -> FloatArray | JointHistory | None:
    """Return the joint angles to write: `joint_position` if it is given, else the angles of the source.

    The angles of the source are its measured angles over time, else the constant angles of its header; None: neither.
    """
    if isinstance(joint_position, JointHistory):
        return joint_position
    if joint_position is None:
        history = load_recorded_joints(source, get_source_format(source), hand, grasp)
        if history is not None:
            return history
        joint_position = header.get("joint_position")
    return None if joint_position is None else np.asarray(joint_position, dtype=np.float64)


def get_source_format(source: str | os.PathLike[str]) -> str:
    """Return the format of an existing recording, a key of `FORMATS`; "capture" for an unknown ending."""
    text = os.fspath(source)
    if Path(text).is_dir():
        return "csv"
    return next((name for name, endings in FORMATS.items() if text.endswith(endings)), "capture")


def _open_sink(
    format_name: str,
    path: Path,
    skin: Skin,
    header: dict[str, object],
    options: GraspOptions,
    angles: FloatArray | JointHistory | None,
    overwrite: bool,
) -> FrameSink:
    """Create the writer of a recording in format `format_name`.

    header: header of the recording. options: object, approach and session of the grasp. angles: joint angles of the
    hand's robot, f64[j], radians, or measured angles over time; None: not known.
    """
    measured = angles if isinstance(angles, JointHistory) else None
    if format_name == "csv":
        topics = SkinTopics(skin.hand, skin.hub, 0, make_joint_source(angles))
        return CsvSink(path, skin.hand, header, topics, (options.object, options.approach), measured, overwrite)
    if format_name == "parquet":
        from taxel.recording.formats.parquet_format import ParquetSink

        return ParquetSink(path, skin.hand, header, measured, overwrite)
    from taxel.recording.formats.hdf5_format import Hdf5Sink  # needs h5py, which is optional

    generator = f"taxel convert {importlib.metadata.version('taxel')}"
    return Hdf5Sink(path, skin.hand, generator, options, angles, overwrite)


def _convert_frames(
    skin: Skin, sink: FrameSink, notes: list[str], progress: Callable[[float], None]
) -> ConversionResult:
    """Pass all frames of the skin to the writer `sink`, close both, and return the numbers of the conversion.

    If the source is truncated, the target file is completed first and then the source's CaptureError is raised.
    progress: called with the converted seconds.
    """
    count, first, last = 0, float("inf"), 0.0
    truncation: CaptureError | None = None
    is_complete = False
    try:
        with skin:
            try:
                for frame in skin:
                    sink.take(frame)
                    count += 1
                    first, last = min(first, frame.time_s), max(last, frame.time_s)
                    if count % 1000 == 0:
                        progress(last - first)
            except CaptureError as error:
                if error.name != skin.link.name:
                    raise
                truncation = error
            losses = skin.losses
            missing = sum(board.missing for board in losses.boards.values())
            notes = [note for note in notes if note]
            result = ConversionResult(count, missing, losses.lost_on_wire, max(0.0, last - first), notes)
        is_complete = True
    finally:
        sink.close(is_complete)
    if truncation is not None:
        raise truncation
    return result
