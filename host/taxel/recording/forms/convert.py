"""From every form of a recording to every other: one is read as a skin, the other takes the skin's frames."""

from __future__ import annotations

import importlib.metadata
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from taxel.errors import TaxelError
from taxel.hand import Hand, load_hand
from taxel.link import CaptureError, Link
from taxel.recorder import record_link, recording_header
from taxel.recording.forms.csv_form import CsvSink, open_csv
from taxel.recording.forms.frame_table import FrameSink, check_free
from taxel.recording.forms.hdf5_form import GraspOptions, Hdf5Sink, open_hdf5_recording
from taxel.recording.forms.parquet_form import ParquetSink, open_parquet
from taxel.ros.topics import SkinTopics
from taxel.skin import Skin, open_source, recorded_hand
from taxel.stream.encoder import FramesLink

FORMS = {
    "capture": (".bin",), "mcap": (".mcap",), "hdf5": (".h5", ".hdf5"), "parquet": (".parquet",), "csv": (".csv", "/"),
}  # fmt: skip
"""Forms of a recording, and how their names end; CSV is a folder."""

_NAMES = "x.bin (capture), x.mcap, x.h5 (grasp dataset), x.parquet or x.csv (a folder)"

NOTES = {
    "capture": "",
    "mcap": "",
    "csv": "CSV keeps frames: not the hub's messages, its bytes, or the count of frames lost on the wire",
    "parquet": "Parquet keeps frames: not the hub's messages, its bytes, or the count of frames lost on the wire",
    "hdf5": "a grasp dataset keeps a row a poll cycle: not each board's own time of arrival, the cycles' and scans' "
    "numbers, or cycles in which no board answered",
}
"""What a form cannot carry."""

MADE_NOTE = "bytes are made from the frames: times to the microsecond, the hub's clock is the recording's"


@dataclass(frozen=True)
class Converted:
    """What a conversion did. `missing`: frames that the cycles' numbers say did not arrive. `notes`: what the new form
    cannot carry.
    """

    frames: int
    missing: int
    lost_on_wire: int
    seconds: float
    notes: list[str] = field(default_factory=list)


def form_of(path: str | os.PathLike[str]) -> str:
    """The form that a file's name tells. Raises TaxelError for a name that tells none."""
    text = os.fspath(path)
    if Path(text).is_dir():
        return "csv"
    for form, endings in FORMS.items():
        if text.endswith(endings):
            return form
    raise TaxelError(f"{text}: expected a name such as {_NAMES}")


def open_recording(
    path: str | os.PathLike[str], hand: Hand | str | os.PathLike[str] | None = None, grasp: str | None = None
) -> tuple[Link, Hand]:
    """The link of a recording in any form, and its hand: the given one, or that which the recording carries or names.

    `grasp`: which one of a dataset. Raises TaxelError of one line for a file that is none.
    """
    text = os.fspath(path)
    endings = {ending: form for form in ("hdf5", "parquet") for ending in FORMS[form]}
    form = "csv" if Path(text).is_dir() else endings.get(Path(text).suffix)
    if form is None:
        return open_source(f"file:{text}", hand)
    if not Path(text).exists():
        raise CaptureError(text, "cannot be read (No such file or directory)")
    made: dict[str, Callable[[], FramesLink]] = {
        "csv": lambda: open_csv(Path(text)),
        "parquet": lambda: open_parquet(Path(text)),
        "hdf5": lambda: open_hdf5_recording(Path(text), grasp),
    }
    link = made[form]()
    if hand is None:
        return link, recorded_hand(link)
    return link, hand if isinstance(hand, Hand) else load_hand(hand)


def convert(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    hand: Hand | str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    joint_position: npt.ArrayLike | None = None,
    grasp: str | None = None,
    options: GraspOptions | None = None,
    progress: Callable[[float], None] = lambda seconds: None,
) -> Converted:
    """Write the recording `source` as `target`, in the form that its name tells; memory does not grow with its length.

    `joint_position`: of the hand's robot, radians [j], for forms that say where taxels are; None: as recorded, else 0.
    `options`: what a grasp dataset says beside. `progress`: told the recorded seconds so far. A source that is cut
    short is converted up to the cut; then its `CaptureError` is raised. Raises TaxelError for a name that is taken.
    """
    form = form_of(target)
    path = Path(os.fspath(target).rstrip("/") or "/")
    check_free(path, overwrite)
    link, description = open_recording(source, hand, grasp)
    try:
        header = recording_header(f"file:{os.fspath(source)}", link, description, hand)
    except BaseException:
        link.close()
        raise
    is_made = isinstance(link, FramesLink)
    joints = header.get("joint_position") if joint_position is None else joint_position
    angles = None if joints is None else np.asarray(joints, dtype=np.float64)
    if form in ("capture", "mcap"):
        skin = record_link(link, description, header, path, overwrite, angles)
        notes = [MADE_NOTE] if is_made else []
        return _pour(skin, None, notes, progress)
    skin = Skin(link, description)
    if angles is not None:
        header["joint_position"] = angles.tolist()
    try:
        sink = _sink(form, path, skin, header, options or GraspOptions(), angles, overwrite)
    except BaseException:
        skin.close()
        raise
    return _pour(skin, sink, [NOTES[form]], progress)


def _sink(
    form: str,
    path: Path,
    skin: Skin,
    header: dict[str, object],
    options: GraspOptions,
    angles: npt.NDArray[np.float64] | None,
    overwrite: bool,
) -> FrameSink:
    if form == "csv":
        joints = None if angles is None else lambda: angles
        return CsvSink(path, skin.hand, header, SkinTopics(skin.hand, skin.hub, 0, joints))
    if form == "parquet":
        return ParquetSink(path, skin.hand, header)
    generator = f"taxel convert {importlib.metadata.version('taxel')}"
    return Hdf5Sink(path, skin.hand, generator, options, angles, overwrite)


def _pour(skin: Skin, sink: FrameSink | None, notes: list[str], progress: Callable[[float], None]) -> Converted:
    """Move all frames; a sink is closed as whole also when the source is cut short."""
    count, first, last = 0, float("inf"), 0.0
    cut: CaptureError | None = None
    is_whole = False
    try:
        with skin:
            try:
                for frame in skin:
                    if sink is not None:
                        sink.take(frame)
                    count += 1
                    first, last = min(first, frame.time_s), max(last, frame.time_s)
                    if count % 1000 == 0:
                        progress(last - first)
            except CaptureError as error:
                if error.name != skin.link.name:
                    raise
                cut = error
            losses = skin.losses
            missing = sum(board.missing for board in losses.boards.values())
            done = Converted(count, missing, losses.lost_on_wire, max(0.0, last - first), [n for n in notes if n])
        is_whole = True
    finally:
        if sink is not None:
            sink.close(is_whole)
    if cut is not None:
        raise cut
    return done
