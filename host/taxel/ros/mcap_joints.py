"""Joint angles of an MCAP recording, from its topic /joint_states."""

import os
from collections.abc import Sequence
from typing import Final

import numpy as np

from taxel.hand.joint_history import JointHistory
from taxel.input_files import open_regular_file, parse_json
from taxel.link.recording_header import check_recording_header
from taxel.optional import optional_import
from taxel.ros.cdr import CdrError, decode
from taxel.ros.mcap_file import METADATA
from taxel.ros.mcap_records import DAMAGE, read_records

with optional_import("mcap", "an MCAP file (.mcap)"):
    from mcap.records import Channel, Message, Metadata, Schema

JOINT_TOPIC: Final = "/joint_states"
JOINT_TYPE: Final = "sensor_msgs/JointState"


def read_mcap_joints(path: str | os.PathLike[str], names: Sequence[str]) -> JointHistory | None:
    """Read the joint angles of an MCAP file, with times on the clock of its stream.

    Returns None if no message has all joints of `names`. A damaged or truncated file gives the angles before the
    damage; no error is raised, because the reader of the frames reports the damage.
    """
    history = JointHistory(names, os.fspath(path))
    offset_s = 0.0
    schemas: dict[int, str] = {}
    channels: set[int] = set()
    try:
        with open_regular_file(path) as file:
            for record in read_records(file):
                if isinstance(record, Schema):
                    schemas[record.id] = record.name.replace("/msg/", "/")
                elif isinstance(record, Channel):
                    is_joint = record.topic == JOINT_TOPIC and record.message_encoding == "cdr"
                    if is_joint and schemas.get(record.schema_id) == JOINT_TYPE:
                        channels.add(record.id)
                elif isinstance(record, Metadata) and record.name == METADATA:
                    offset_ns = parse_json(record.metadata.get("epoch_offset_ns", "0").encode())
                    offset_s = float(check_recording_header({"epoch_offset_ns": offset_ns})["epoch_offset_ns"]) * 1e-9
                elif isinstance(record, Message) and record.channel_id in channels:
                    _add_message(history, record.data, offset_s)
    except (*DAMAGE, CdrError, OSError):
        pass
    return history if len(history) else None


def _add_message(history: JointHistory, data: bytes, offset_s: float) -> None:
    """Add the angles of a JointState message to the history, at the message's time on the clock of the stream.

    A message without all joints of the history is ignored. offset_s: Unix time minus stream time, seconds.
    """
    message = decode(JOINT_TYPE, data)
    angles = dict(zip(message.name, message.position.tolist(), strict=False))
    if all(name in angles for name in history.names):
        time_s = message.header.stamp.sec - offset_s + message.header.stamp.nanosec * 1e-9
        history.add(time_s, np.array([angles[name] for name in history.names]))
