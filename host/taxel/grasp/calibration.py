"""Calibration files: measured poses of objects in the robot's base frame, and of remounted brackets on their links.

A file is TOML, in metres. An entry contains either a pose or the points measured by a tracker (thesis, section 5.5)::

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

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from taxel.grasp.calibration_errors import CalibrationError, CalibrationField
from taxel.grasp.calibration_schema import (
    FORMAT,
    KINDS,
    VERSION,
    parse_calibration,
)
from taxel.grasp.pose_estimate import PoseEstimate, fit_pose, make_pose_estimate
from taxel.hand.errors import format_path
from taxel.hand.toml_text import MAX_FILE_BYTES
from taxel.input_files import is_regular_file, read_regular_file

__all__ = [
    "Calibration",
    "CalibrationError",
    "PoseEstimate",
    "fit_pose",
    "load_calibration",
    "make_pose_estimate",
]


@dataclass(frozen=True, eq=False)
class Calibration:
    """Poses by name: objects in the robot's base frame, brackets (by sensor name) in the frames of their links."""

    objects: Mapping[str, PoseEstimate] = field(default_factory=dict)
    brackets: Mapping[str, PoseEstimate] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Make the tables of objects and brackets read-only."""
        for kind in KINDS:
            object.__setattr__(self, kind, MappingProxyType(dict(getattr(self, kind))))

    def __reduce__(self) -> tuple[type[Calibration], tuple[dict[str, PoseEstimate], ...]]:
        """Return how to pickle the calibration: its constructor and its tables of objects and brackets."""
        return Calibration, (dict(self.objects), dict(self.brackets))  # a mapping proxy cannot be pickled

    def warnings(self) -> tuple[str, ...]:
        """Return the warnings about measured points of objects and brackets, one line each."""
        entries = (*self.objects.values(), *self.brackets.values())
        return tuple(line for estimate in entries for line in estimate.warnings())

    def to_json(self) -> dict[str, Any]:
        """Convert the calibration to JSON values, which are stored with a campaign."""
        poses = {kind: {name: pose.to_json() for name, pose in getattr(self, kind).items()} for kind in KINDS}
        return {"format": FORMAT, "version": VERSION, **poses}


def load_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Load a calibration file and fit poses to its measured points.

    Raises CalibrationError: not readable, an error in the file, or points that do not determine a pose. Outliers and
    other suspicious points are reported by `Calibration.warnings()`.
    """
    file = format_path(os.fspath(path))
    document = parse_calibration(_read_bytes(Path(path), file), file)
    poses: dict[str, dict[str, PoseEstimate]] = {}
    for kind, key in KINDS.items():
        places = [CalibrationField(file).key(kind).item(index) for index in range(len(document[kind]))]
        pairs = zip(document[kind], places, strict=True)
        poses[kind] = {entry[key]: _build_estimate(entry, place) for entry, place in pairs}
    return Calibration(**poses)


def _read_bytes(path: Path, file: str) -> bytes:
    """Read the content of a calibration file of limited size. Raises CalibrationError. file: name, for messages."""
    top = CalibrationField(file)
    try:
        if not path.exists():
            top.fail("a file", "no such file", "check the file name")
        if not is_regular_file(path):
            top.fail("a regular file", "another file type", "name a regular file")
        if path.stat().st_size > MAX_FILE_BYTES:
            top.fail(f"at most {MAX_FILE_BYTES} bytes", str(path.stat().st_size), "use a calibration file")
        return read_regular_file(path, MAX_FILE_BYTES)
    except OSError as error:
        top.fail("a readable file", error.strerror or type(error).__name__, "check the permissions and the name")


def _build_estimate(entry: Mapping[str, Any], place: CalibrationField) -> PoseEstimate:
    """Make the pose of an object or bracket from a checked entry of a calibration file.

    The pose is given in the entry, or is fitted to the measured points of the entry. place: location of the entry, for
    errors.
    """
    if "pose" in entry:
        pose = entry["pose"]
        estimate = make_pose_estimate(pose["position_m"], pose["quaternion_wxyz"], str(place.key("pose")))
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
