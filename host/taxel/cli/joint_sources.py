"""Sources of a command's joint angles: constant angles, a file, a recording, a ROS topic, or the hand on CAN."""

import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np

from taxel.cli.options import parse_joint_angles
from taxel.errors import TaxelError
from taxel.hand import Hand, load_hand
from taxel.hand.joint_history import JointHistory
from taxel.hand.kinematics import build_kinematics
from taxel.link.url import get_recorded_path
from taxel.recording.formats.conversion import get_source_format, open_recording
from taxel.recording.formats.recorded_joints import load_joint_file, load_recorded_joints
from taxel.skin import Skin
from taxel.types import FloatArray

FIRST_SAMPLE_S: Final = 3.0
"""Longest wait for the first joint angles of a live source, seconds."""


def choose_joints(
    source: str, hand: Hand | str | None, angles: str | None, file: Path | None, grasp: str | None
) -> FloatArray | JointHistory | None:
    """Return the joint angles for a recording: constant, f64[j], radians, or measured over time; None: not known.

    source: file of the recording. hand: its hand; None: that of the recording. angles, file: values of the options
    --joint-angles and --joint-file; without them the measured angles of the recording are used. grasp: id of the grasp
    in a dataset. Raises TaxelError for both options together, and the errors of the file and the recording.
    """
    _require_at_most_one("--joint-angles", angles, "--joint-file", file)
    if angles is not None:
        return parse_joint_angles(angles)
    link, description = open_recording(source, hand, grasp)
    header: dict[str, Any] = getattr(link, "header", {})
    link.close()
    if file is not None:
        return load_joint_file(file, description, header)
    return load_recorded_joints(source, get_source_format(source), description, grasp)


def choose_url_joints(url: str, skin: Skin, angles: str | None, file: Path | None) -> FloatArray | JointHistory | None:
    """Return the joint angles for the skin of a URL, constant or measured over time; None: not known.

    The angles of a recording (file:...) are those of `choose_joints`. A port has no measured angles, only those of the
    option --joint-angles. Raises TaxelError for a joint file with a port.
    """
    path = get_recorded_path(url)
    if path is not None:
        return choose_joints(str(path), skin.hand, angles, file, None)
    if file is not None:
        raise TaxelError(
            "--joint-file: needs a recording (file:...); use --joint-topic or --joint-angles for a live skin"
        )
    return parse_joint_angles(angles)


@contextmanager
def open_live_joints(
    hand: str | None, angles: FloatArray | None, topic: str | None, can_url: str | None
) -> Iterator[FloatArray | JointHistory | None]:
    """Context manager: the joint angles of a live recording, measured over time, or constant without a live source.

    angles: constant angles, radians, and with a live source the angles of the joints that it does not measure. topic:
    ROS topic. can_url: CAN channel of the hand. The block starts when the first angles have arrived. Raises TaxelError
    for two live sources, and for a source without angles within `FIRST_SAMPLE_S`.
    """
    _require_at_most_one("--joint-topic", topic, "--hand-can", can_url)
    if topic is None and can_url is None:
        yield angles
        return
    names = build_kinematics(load_hand(hand or "original")).robot.joint_names
    base = np.zeros(len(names)) if angles is None else angles
    if len(base) != len(names):
        raise TaxelError(
            f"--joint-angles: expected {len(names)} angles, found {len(base)}; give all joints of the robot"
        )
    with ExitStack() as stack:
        history = (
            _open_topic(stack, topic, names, base) if topic is not None else _open_can(stack, can_url, names, base)
        )
        history.on_silence = lambda text: print(text, file=sys.stderr, flush=True)
        end_s = time.monotonic() + FIRST_SAMPLE_S
        while not len(history):
            if time.monotonic() > end_s:
                raise TaxelError(
                    f"{history.name}: no joint angles in {FIRST_SAMPLE_S:g} s; start the program that sends them, "
                    "or check the name"
                )
            time.sleep(0.01)
        yield history


def _open_topic(stack: ExitStack, topic: str, names: tuple[str, ...], base: FloatArray) -> JointHistory:
    """Subscribe to a ROS topic of joint states until the stack is closed; return the angles over time.

    names: names of the robot's joints. base: angles of the joints that the topic does not contain, radians.
    """
    from taxel.ros.node import JointListener, SpinningNode, open_node  # needs ROS

    node = stack.enter_context(SpinningNode(open_node(None)))
    return JointListener(node, topic, names, base).record(topic)


def _open_can(stack: ExitStack, url: str | None, names: tuple[str, ...], base: FloatArray) -> JointHistory:
    """Listen to the hand on a CAN channel until the stack is closed; return the angles over time.

    names: names of the robot's joints. base: angles of the joints that the hand does not measure, radians.
    """
    from taxel.hand.allegro import open_bus
    from taxel.hand.allegro.listener import AllegroListener

    bus = open_bus(str(url))
    stack.callback(bus.shutdown)
    listener = AllegroListener(bus, names, base)
    stack.callback(listener.close)
    return listener.history


def _require_at_most_one(first: str, first_value: object, second: str, second_value: object) -> None:
    """Raise TaxelError if both options are given. first, second: their names; an option with None is not given."""
    if first_value is not None and second_value is not None:
        raise TaxelError(f"{first} and {second}: expected at most one source of joint angles; remove one")
