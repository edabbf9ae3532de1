"""Calibration files: where the objects stand in the robot's base frame, and re-mounted brackets on their links.

A file is TOML, in metres; an entry has either a pose or the points that a tracker measured (thesis, section 5.5)::

    format = "taxel-calibration"
    version = 1

    [[objects]]
    name = "cylinder"
    measured = 2024-05-17
    instrument = "C-Track 780"
    sigma_m = 25e-6
    points = [  # name, x, y, z in the object's frame, X, Y, Z as measured in the base frame
        ["a", 0.0, 0.0, 0.0, 0.612, 0.104, 0.021],
        ...
    ]

    [[brackets]]
    sensor = "palm"
    pose = { position_m = [0.0, 0.0, 0.0951], quaternion_wxyz = [1.0, 0.0, 0.0, 0.0] }
"""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from taxel.grasp.calibration_errors import CalibrationError, Place
from taxel.grasp.calibration_schema import (
    FORMAT,
    KINDS,
    ROW,
    VERSION,
    check_coordinate,
    check_name,
    parse_calibration,
)
from taxel.grasp.pose_estimate import MeasuredPoints, PoseEstimate, fit_pose, given_pose
from taxel.hand.errors import format_path, format_value
from taxel.hand.toml_text import MAX_FILE_BYTES
from taxel.hand.transforms import to_quaternion

__all__ = [
    "Calibration",
    "CalibrationError",
    "PoseEstimate",
    "fit_pose",
    "given_pose",
    "load_calibration",
    "load_points",
    "save_calibration",
]


@dataclass(frozen=True, eq=False)
class Calibration:
    """Poses by name: objects in the robot's base frame, brackets (by sensor) in the frames of their links."""

    objects: Mapping[str, PoseEstimate] = field(default_factory=dict)
    brackets: Mapping[str, PoseEstimate] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for kind in KINDS:
            object.__setattr__(self, kind, MappingProxyType(dict(getattr(self, kind))))

    def __reduce__(self) -> tuple[type[Calibration], tuple[dict[str, PoseEstimate], ...]]:
        return Calibration, (dict(self.objects), dict(self.brackets))  # a mapping proxy cannot be pickled

    def warnings(self) -> tuple[str, ...]:
        """One line for each doubt about measured points (`PoseEstimate.warnings`)."""
        entries = (*self.objects.values(), *self.brackets.values())
        return tuple(line for estimate in entries for line in estimate.warnings())

    def to_json(self) -> dict[str, Any]:
        """The calibration as plain numbers, texts, lists and dicts, to be stored with a campaign."""
        poses = {kind: {name: pose.to_json() for name, pose in getattr(self, kind).items()} for kind in KINDS}
        return {"format": FORMAT, "version": VERSION, **poses}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Calibration:
        """The calibration that `to_json` wrote, to the last bit; CalibrationError for anything else."""
        top = Place("from_json")
        if not isinstance(data, Mapping) or (data.get("format"), data.get("version")) != (FORMAT, VERSION):
            top.fail(f"format {FORMAT!r} and version {VERSION}", "another", "store what to_json returns")
        poses: dict[str, dict[str, PoseEstimate]] = {}
        for kind in KINDS:
            entries = data.get(kind)
            if not isinstance(entries, Mapping):
                top.key(kind).fail("a table of poses", format_value(entries), "store what to_json returns")
            poses[kind] = {k: PoseEstimate.from_json(v, top.key(kind).key(k)) for k, v in entries.items()}
        return cls(**poses)


def load_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Load a calibration file and fit the poses that it gives by points.

    Raises CalibrationError: not readable, a mistake in it, or points from which no pose follows. Doubts that do not
    forbid a pose, such as an outlier, are in `Calibration.warnings()`.
    """
    file = format_path(os.fspath(path))
    document = parse_calibration(_read(Path(path), file), file)
    poses: dict[str, dict[str, PoseEstimate]] = {}
    for kind, key in KINDS.items():
        places = [Place(file).key(kind).item(index) for index in range(len(document[kind]))]
        pairs = zip(document[kind], places, strict=True)
        poses[kind] = {entry[key]: _estimate(entry, place) for entry, place in pairs}
    return Calibration(**poses)


def save_calibration(path: str | os.PathLike[str], calibration: Calibration, *, overwrite: bool = False) -> None:
    """Write a calibration file: the points where an estimate has them, else its pose; numbers to the last digit.

    Raises CalibrationError: the file exists and `overwrite` is false, it cannot be written, or `load_calibration`
    would refuse it.
    """
    file, target = format_path(os.fspath(path)), Path(path)
    text = _text_of(calibration)
    parse_calibration(text.encode(), file)  # no file is written that cannot be read back
    if target.exists() and not overwrite:
        Place(file).fail("a new file", "one that exists", "choose another name, or pass overwrite=True")
    beside = target.with_name(f"{target.name}.part")
    try:
        with beside.open("x", encoding="utf-8", newline="\n") as stream:
            stream.write(text)
        beside.replace(target)  # whole or not at all
    except OSError as error:
        reason = error.strerror or type(error).__name__
        Place(file).fail("a place to write to", reason, f"check the folder, its permissions and {beside.name}")


def load_points(path: str | os.PathLike[str]) -> MeasuredPoints:
    """Read points from CSV: the header ``name,x,y,z,X,Y,Z``, metres, then a row for each point.

    x, y, z are in the body's frame, X, Y, Z as measured. Give the result to `fit_pose`, field by field.
    Raises CalibrationError: not readable, or a mistake in a line.
    """
    file = format_path(os.fspath(path))
    try:
        text = _read(Path(path), file).decode("utf-8-sig")  # spreadsheets write the mark
    except UnicodeDecodeError:
        Place(file).fail("UTF-8 text", "other bytes", "save the file as UTF-8")
    reader = csv.reader(text.splitlines())
    header = ",".join(next(reader, []))
    if header != ",".join(ROW):
        Place(file, "line 1").fail(",".join(ROW), format_value(header), "name the columns so, with commas between")
    owners: dict[str, str] = {}
    rows = []
    for row in reader:
        place = Place(file, f"line {reader.line_num}")
        if not row:
            continue
        if len(row) != len(ROW):
            place.fail(
                f"{len(ROW)} values", str(len(row)), "give the name and both triples, with points in the numbers"
            )
        check_name(row[0].strip(), owners, place)
        rows.append([_number(value, place.key(key)) for key, value in zip(ROW[1:], row[1:], strict=True)])
    values = np.array(rows, dtype=np.float64).reshape(-1, 6)
    return MeasuredPoints(tuple(owners), values[:, :3], values[:, 3:], np.ones(len(rows)))


def _number(text: str, place: Place) -> float:
    try:
        value = float(text)
    except ValueError:
        place.fail("a number", format_value(text), "write it as 0.125")
    check_coordinate(value, place)
    return value


def _read(path: Path, file: str) -> bytes:
    whole = Place(file)
    try:
        if not path.exists():
            whole.fail("a file", "no such file", "check its name")
        if not path.is_file():  # a pipe or a device might never end
            whole.fail("a regular file", "something else", "name a file")
        if path.stat().st_size > MAX_FILE_BYTES:
            whole.fail(f"at most {MAX_FILE_BYTES} bytes", str(path.stat().st_size), "is it a calibration?")
        return path.read_bytes()
    except OSError as error:
        whole.fail("a readable file", error.strerror or type(error).__name__, "check its permissions and its name")


def _estimate(entry: Mapping[str, Any], place: Place) -> PoseEstimate:
    if "pose" in entry:
        pose = entry["pose"]
        estimate = given_pose(pose["position_m"], pose["quaternion_wxyz"], str(place.key("pose")))
    else:
        values = np.array([row[1:] for row in entry["points"]], dtype=np.float64).reshape(-1, 6)
        estimate = fit_pose(
            values[:, :3],
            values[:, 3:],
            names=[row[0] for row in entry["points"]],
            weights=entry.get("weights"),
            sigma_m=entry.get("sigma_m"),
            place=place.key("points"),
        )
    measured = entry["measured"].isoformat() if "measured" in entry else ""
    return replace(estimate, measured=measured, instrument=entry.get("instrument", ""))


def _text_of(calibration: Calibration) -> str:
    lines = [f'format = "{FORMAT}"', f"version = {VERSION}"]
    for kind, key in KINDS.items():
        for name, estimate in getattr(calibration, kind).items():
            # A JSON string is a TOML string; what is not printable is refused by the schema.
            lines += ["", f"[[{kind}]]", f"{key} = {json.dumps(name)}", *_entry_lines(estimate)]
    return "\n".join(lines) + "\n"


def _entry_lines(estimate: PoseEstimate) -> list[str]:
    lines = []
    if estimate.measured:
        lines.append(f"measured = {estimate.measured}")
    if estimate.instrument:
        lines.append(f"instrument = {json.dumps(estimate.instrument, ensure_ascii=False)}")
    points = estimate.points
    if points is None:
        lines.append(f"pose.position_m = {_list(estimate.transform[:3, 3])}")
        lines.append(f"pose.quaternion_wxyz = {_list(to_quaternion(estimate.transform))}")
        return lines
    if estimate.sigma_given:
        lines.append(f"sigma_m = {estimate.sigma_m!r}")
    if (points.weights != 1).any():
        lines += ["weights = [", *(f"    {weight!r}," for weight in points.weights.tolist()), "]"]
    lines.append("points = [")
    for name, known, measured in zip(points.names, points.known.tolist(), points.measured.tolist(), strict=True):
        # Two lines a point: TOML lines are kept below 200 bytes.
        lines.append(f"    [{json.dumps(name)}, {', '.join(map(repr, known))},")
        lines.append(f"        {', '.join(map(repr, measured))}],")
    return [*lines, "]"]


def _list(values: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    return f"[{', '.join(map(repr, values.tolist()))}]"
