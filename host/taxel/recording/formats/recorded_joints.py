"""Joint angles of a recording: where each format stores them."""

import os
from pathlib import Path
from typing import Any, Final

from taxel.hand import Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.joint_history import JointHistory, read_joint_file
from taxel.hand.kinematics import build_kinematics
from taxel.recording.formats.frame_table import fail
from taxel.skin.joint_recording import get_joint_path

CSV_JOINTS: Final = "joints.csv"
UNIX_TIME_S: Final = 1e9
"""Time from which on the times of a joint file are Unix times, seconds; times of a stream are far smaller."""


def get_joint_names(hand: Hand) -> tuple[str, ...]:
    """Return the names of the joints of the hand's robot; empty for a hand without geometry."""
    try:
        return tuple(build_kinematics(hand).robot.joint_names)
    except HandGeometryError:
        return ()


def load_recorded_joints(
    path: str | os.PathLike[str], format_name: str, hand: Hand, grasp: str | None = None
) -> JointHistory | None:
    """Return the measured joint angles of a recording, with times on the clock of its frames; None without angles.

    Also None for a hand without geometry, whose joints have no names. format_name: key of `conversion.FORMATS`. grasp:
    id of the grasp in a dataset; None: the first one. Raises JointFileError or RecordingFormatError for invalid angles.
    """
    names = get_joint_names(hand)
    source = Path(path)
    if not names:
        return None
    if format_name in ("capture", "pcapng"):
        file = get_joint_path(source)
        return read_joint_file(file, names) if file.exists() else None
    if format_name == "csv":
        return read_joint_file(source / CSV_JOINTS, names) if (source / CSV_JOINTS).exists() else None
    if format_name == "mcap":
        from taxel.ros.mcap_joints import read_mcap_joints  # needs the extra `ros`

        return read_mcap_joints(source, names)
    if format_name == "parquet":
        from taxel.recording.formats.parquet_format import read_parquet_joints

        return read_parquet_joints(source, names)
    return _read_dataset_joints(source, names, grasp)


def _read_dataset_joints(path: Path, names: tuple[str, ...], grasp: str | None) -> JointHistory | None:
    """Return the joint angles of one grasp of a dataset; None if the angles are missing.

    Constant angles count as missing, because a conversion without measured angles writes constant ones.
    """
    from taxel.recording.grasp_dataset import GraspDataset

    with GraspDataset(path) as data:
        record = data[grasp if grasp is not None else data.ids[0]]
        angles = record.joint_position
        if angles is None or (angles == angles[0]).all():
            return None
        if angles.shape[1] != len(names):
            fail(path, "joint_position", f"{len(names)} joints", angles.shape[1], "give the hand of the dataset")
        history = JointHistory(names, os.fspath(path))
        for time_s, row in zip(record.timestamp.tolist(), angles, strict=True):
            history.add(time_s, row)
    return history


def load_joint_file(path: str | os.PathLike[str], hand: Hand, header: dict[str, Any]) -> JointHistory:
    """Read a file of joint angles (option `--joint-file`); return the angles on the clock of the recording's frames.

    The times in the file are those of the stream, or Unix times if the first one is at least `UNIX_TIME_S`. Unix times
    are converted with the offset `epoch_offset_ns` of the recording's header: Unix time minus stream time. Raises
    JointFileError, HandGeometryError.
    """
    history = read_joint_file(path, build_kinematics(hand).robot.joint_names)
    if history.first_s >= UNIX_TIME_S:
        history.shift(-float(header.get("epoch_offset_ns", 0)) * 1e-9)
    return history
