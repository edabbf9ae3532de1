"""Figures of the original hand as arrays: taxels, brackets, joints, boards, layouts (tools/hand/original)."""

import csv
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from taxel.types import FloatArray

FIGURES: Final = Path(__file__).parent / "original"
POSE_COLUMNS: Final = ("x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad")


class OriginalBoard(NamedTuple):
    """One board of the complete original hand. bracket: name of its bracket frame. is_fitted: False for the thumb."""

    address: int
    name: str
    finger: str
    kind: str
    taxels: int
    bracket: str
    is_fitted: bool


def read_rows(name: str) -> list[dict[str, str]]:
    """Read the rows of the file NAME.csv, as strings by column name."""
    with (FIGURES / f"{name}.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@lru_cache(maxsize=32)
def read_taxels(kind: str) -> FloatArray:
    """Read the taxel centres (metres) and outward normals of a board kind in the bracket's frame, f64[n, 6]."""
    columns = ("x_m", "y_m", "z_m", "nx", "ny", "nz")
    return np.array([[float(row[name]) for name in columns] for row in read_rows(f"taxels_{kind}")])


def read_coded_centres(kind: str) -> FloatArray | None:
    """Read the taxel centres f64[n, 3] that the original host program uses, in the bracket's frame, metres.

    Returns None for board kinds without such centres.
    """
    rows = read_rows(f"taxels_{kind}")
    if not rows[0]["coded_x_m"]:
        return None
    return np.array([[float(row[f"coded_{axis}_m"]) for axis in "xyz"] for row in rows])


def read_layout(kind: str) -> dict[int, tuple[int, int]]:
    """Read the row and column of each taxel in a board kind's heat map (at most 13 columns), by taxel index."""
    return {
        int(row[f"col{column}"]): (int(row["row"]), column)
        for row in read_rows("layout")
        if row["kind"] == kind
        for column in range(13)
        if row[f"col{column}"]
    }


def read_boards() -> list[OriginalBoard]:
    """Read the 22 boards of the complete hand, by address. "boh" is the board on the back of the hand."""
    brackets = {"palm": "palm_bracket", "boh": "boh_bracket"}
    return [
        OriginalBoard(
            int(row["number"]),
            row["name"],
            row["finger"],
            row["kind"],
            int(row["taxels"]),
            brackets.get(row["name"], f"{row['name']}_bracket"),
            row["fitted"] == "yes",
        )
        for row in read_rows("boards")
    ]


def compute_frames(joint_angles: Mapping[str, float] | None = None) -> dict[str, FloatArray]:
    """Compute the pose f64[4, 4] of every frame of the hand in the palm's frame, by the frame's name.

    joint_angles: radians by joint name ("joint_0_0" to "joint_15_0"); 0 for the others. All joints rotate about the z
    axis of their child frame.
    """
    angles = joint_angles or {}
    children: dict[str, list[tuple[dict[str, str], bool]]] = {}
    for name, is_joint in (("joints", True), ("brackets", False)):
        for row in read_rows(name):
            children.setdefault(row["parent"], []).append((row, is_joint))
    frames = {"palm_link": np.eye(4)}
    pending = ["palm_link"]
    while pending:
        parent = pending.pop()
        for row, is_joint in children.get(parent, []):
            pose = frames[parent] @ _make_pose(row)
            if is_joint:
                pose = pose @ _rotate_about_z(angles.get(row["joint"], 0.0))
            frames[row["child"]] = pose
            pending.append(row["child"])
    return frames


def _make_pose(row: Mapping[str, str]) -> FloatArray:
    """Return the pose f64[4, 4] of a table row with position (metres) and roll, pitch, yaw (radians, as in URDF)."""
    x, y, z, roll, pitch, yaw = (float(row[name]) for name in POSE_COLUMNS)
    pose = _rotate_about_z(yaw) @ _rotate_about_y(pitch) @ _rotate_about_x(roll)
    pose[:3, 3] = x, y, z
    return np.asarray(pose)


def _rotate_about_x(angle: float) -> FloatArray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0, 0, 0], [0, cosine, -sine, 0], [0, sine, cosine, 0], [0, 0, 0, 1]])


def _rotate_about_y(angle: float) -> FloatArray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, 0, sine, 0], [0, 1.0, 0, 0], [-sine, 0, cosine, 0], [0, 0, 0, 1]])


def _rotate_about_z(angle: float) -> FloatArray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0, 0], [sine, cosine, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1]])
