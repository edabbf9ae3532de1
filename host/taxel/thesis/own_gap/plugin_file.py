"""Simulated grasps of the contact plug-in in a file, so that an interrupted evaluation continues where it ended."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final
from zipfile import BadZipFile

import numpy as np

from taxel.errors import TaxelError
from taxel.output import open_whole
from taxel.sim.contact_messages import ContactMessage, PairEntry
from taxel.thesis.own_gap.plugin import PluginGrasp

VERSION: Final = 1
"""Version of the file; a file of another version is refused."""


class PluginFileError(TaxelError):
    """A file of plug-in grasps cannot be read."""


def write_plugin_grasps(path: Path, grasps: Sequence[PluginGrasp], settings: str) -> None:
    """Write grasps to an NPZ file atomically: an interrupted call leaves no incomplete file.

    The messages of all grasps are stored in one array, and so are the entries of all messages and the points of all
    entries; the arrays `*_end` contain the bounds of the parts. settings: one-line description of the simulation;
    `read_plugin_grasps` refuses the file for any other description.
    """
    messages = [message for grasp in grasps for message in grasp.messages]
    entries = [entry for message in messages for entry in message.entries]
    arrays: dict[str, Any] = {
        "version": np.array(VERSION),
        "settings": np.array(settings),
        "object": np.array([grasp.object for grasp in grasps]),
        "approach": np.array([grasp.approach for grasp in grasps]),
        "iteration": np.array([grasp.iteration for grasp in grasps]),
        "sensor_pose": np.array([grasp.sensor_pose for grasp in grasps]),
        "object_pose": np.array([grasp.object_pose for grasp in grasps]),
        "saved_s": np.array([grasp.saved_s for grasp in grasps]),
        "message_end": np.cumsum([0, *(len(grasp.messages) for grasp in grasps)]),
        "message_time_s": np.array([message.time_s for message in messages]),
        "message_board": np.array([message.board for message in messages], np.int64),
        "entry_end": np.cumsum([0, *(len(message.entries) for message in messages)]),
        "entry_bodies": np.array([entry.bodies for entry in entries], np.int64).reshape(-1, 2),
        "point_end": np.cumsum([0, *(len(entry.position) for entry in entries)]),
        "position": np.concatenate([np.zeros((0, 3)), *(entry.position for entry in entries)]),
        "force_n": np.concatenate([np.zeros(0), *(entry.force_n for entry in entries)]),
    }
    with open_whole(path) as file:
        np.savez_compressed(file, **arrays)


def read_plugin_grasps(path: Path, settings: str) -> list[PluginGrasp]:
    """Read the grasps of a file that `write_plugin_grasps` wrote.

    Raises PluginFileError for a damaged file, another version, or settings other than `settings`.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            data = {name: stored[name] for name in stored.files}
        if int(data["version"]) != VERSION:
            raise PluginFileError(f"{path}: expected version {VERSION}, found {data['version']}; delete the file")
        if str(data["settings"]) != settings:
            raise PluginFileError(f"{path}: expected {settings}, found {data['settings']}; delete the file")
        entries = [
            PairEntry((int(first), int(second)), data["position"][start:end], data["force_n"][start:end])
            for (first, second), (start, end) in zip(data["entry_bodies"], pairwise(data["point_end"]), strict=True)
        ]
        rows = zip(data["message_time_s"], data["message_board"], pairwise(data["entry_end"]), strict=True)
        messages = [ContactMessage(float(time), int(board), tuple(entries[a:b])) for time, board, (a, b) in rows]
        return [
            PluginGrasp(
                str(data["object"][row]),
                str(data["approach"][row]),
                int(data["iteration"][row]),
                data["sensor_pose"][row],
                data["object_pose"][row],
                float(data["saved_s"][row]),
                tuple(messages[start:end]),
            )
            for row, (start, end) in enumerate(pairwise(data["message_end"]))
        ]
    except (OSError, ValueError, KeyError, IndexError, EOFError, BadZipFile) as error:
        raise PluginFileError(f"{path}: not a file of plug-in grasps ({error}); delete the file") from error
