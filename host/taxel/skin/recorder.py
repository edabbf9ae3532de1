"""Opening of a skin that is recorded: its bytes, and in an MCAP file its topics, are written while frames are read."""

import os
from typing import Any

import numpy as np
import numpy.typing as npt

from taxel.hand import Hand
from taxel.hand.joint_history import JointHistory
from taxel.link import CaptureError, CaptureWriter, Link
from taxel.link.live_records import EXISTS, open_live_output
from taxel.link.pcapng import SUFFIX as PCAPNG_SUFFIX
from taxel.link.pcapng import PcapngWriter
from taxel.output import LiveOutput
from taxel.proximity import ProximityWatch, open_watch
from taxel.ros.topics import JointSource
from taxel.skin.capture_bytes import CaptureBytes
from taxel.skin.confirmed_bytes import PcapngBytes
from taxel.skin.joint_recording import JointRecordingSkin, get_joint_path
from taxel.skin.mcap_skin import McapSkin
from taxel.skin.opening import open_source, open_waiting_source
from taxel.skin.recording_link import RecordingLink, make_recording_header
from taxel.skin.recording_skin import RecordingSkin

MCAP_SUFFIX = ".mcap"


def open_recorded(
    url: str,
    path: str | os.PathLike[str],
    hand: Hand | str | None = None,
    overwrite: bool = False,
    joint_position: npt.ArrayLike | JointSource | None = None,
    waits: bool = False,
    proximity: str | os.PathLike[str] | None = None,
) -> RecordingSkin:
    """Open the skin at a URL with the same arguments as `taxel.open`, and record it to a file.

    path: a name that ends in .mcap makes an MCAP file with the hub's bytes and the skin's ROS topics (needs the extra
    `ros`); a name that ends in .pcapng makes a file for Wireshark, and any other name a capture, both with the bytes
    alone. joint_position: joint angles of the hand's robot, f64[j], radians, or a source of measured angles, as for
    `record_link`. waits: if the port vanishes, the recording waits for the port and continues in the same file
    (`Skin.reconnection` lists the gaps). proximity: calibration file, with which an MCAP file also contains distance
    and speed of objects that approach the skin. Raises `CaptureError`, before anything is opened, if the file exists
    and `overwrite` is False.
    """
    if os.path.exists(path) and not overwrite:
        raise CaptureError(os.fspath(path), EXISTS)
    link, description = (open_waiting_source if waits else open_source)(url, hand)
    try:
        header = make_recording_header(url, link, description, hand)
        watch = None if proximity is None else _open_recorded_watch(path, proximity, description)
    except BaseException:
        link.close()
        raise
    return record_link(link, description, header, path, overwrite, joint_position, proximity=watch)


def _open_recorded_watch(
    path: str | os.PathLike[str], calibration: str | os.PathLike[str], hand: Hand
) -> ProximityWatch:
    """Open the proximity estimators whose results are written to an MCAP file.

    path: the recording. calibration: proximity calibration file. Raises `CaptureError` for a recording of another
    format, which has no topics.
    """
    if not os.fspath(path).endswith(MCAP_SUFFIX):
        raise CaptureError(os.fspath(path), f"contains no topics; a file with proximity needs a name in {MCAP_SUFFIX}")
    return open_watch(calibration, hand)


def record_link(
    link: Link,
    hand: Hand,
    header: dict[str, Any],
    path: str | os.PathLike[str],
    overwrite: bool = False,
    joint_position: npt.ArrayLike | JointSource | None = None,
    output: LiveOutput | None = None,
    joint_output: LiveOutput | None = None,
    proximity: ProximityWatch | None = None,
) -> RecordingSkin:
    """Open a skin on an open link and record it as `open_recorded` does. If that fails, the link is closed.

    joint_position: joint angles of the hand's robot, for the TF tree and the contact cloud of an MCAP file. Constant
    angles, f64[j], radians, are stored in the header of every file. Measured angles (`JointHistory`) are recorded for
    every poll cycle: in an MCAP file as messages, beside another file in PATH.joints.csv. Another function that returns
    angles f64[j] is used for an MCAP file only. None: the constant angles in `header`, else all 0.

    header: header of the recording; constant joint angles are added to it. output: open output that is written instead
    of `path`; None: a new file. joint_output: the same for the file of measured joint angles beside a capture.
    proximity: estimators of distance and speed of approaching objects, for MCAP files.
    """
    try:
        if joint_position is None:
            joint_position = header.get("joint_position")
        elif isinstance(joint_position, JointHistory):
            # Samples of a live history have host times: they fit frames only if the frames have host times too.
            joint_position.uses_stream_time = not joint_position.is_live or header["clock"] == "host"
        elif not callable(joint_position):
            header["joint_position"] = np.asarray(joint_position, dtype=np.float64).tolist()
        if os.fspath(path).endswith(MCAP_SUFFIX):
            return _record_mcap(link, hand, header, path, overwrite, joint_position, output, proximity)
        return _record_bytes(link, hand, header, path, overwrite, joint_position, output, joint_output)
    except BaseException:
        link.close()
        raise


def _record_bytes(
    link: Link,
    hand: Hand,
    header: dict[str, Any],
    path: str | os.PathLike[str],
    overwrite: bool,
    joint_position: npt.ArrayLike | JointSource | None,
    output: LiveOutput | None,
    joint_output: LiveOutput | None,
) -> RecordingSkin:
    """Open a skin that is recorded to a capture or a PCAPNG file; arguments as for `record_link`.

    After an error an empty file is deleted; the caller closes the link.
    """
    writer = _open_writer(path, header, overwrite, output)
    try:
        if isinstance(joint_position, JointHistory):
            companion = joint_output or open_live_output(get_joint_path(path), overwrite)
            return JointRecordingSkin(RecordingLink(link, writer), hand, joint_position, companion)
        return RecordingSkin(RecordingLink(link, writer), hand)
    except BaseException:
        writer.discard()  # a capture without any bytes is of no use
        raise


def _open_writer(
    path: str | os.PathLike[str], header: dict[str, Any], overwrite: bool, output: LiveOutput | None
) -> CaptureBytes | PcapngBytes:
    """Create the writer of a PCAPNG file for a name that ends in .pcapng, else of a capture.

    output: open output that is written instead of `path`; None: a new file.
    """
    if os.fspath(path).endswith(PCAPNG_SUFFIX):
        return PcapngBytes(PcapngWriter(path, header, overwrite, output))
    return CaptureBytes(CaptureWriter(path, header, overwrite, output))


def make_joint_source(joint_position: npt.ArrayLike | JointSource | None) -> JointSource | None:
    """Return a function that returns joint angles, f64[j], radians: the given function, or one with constant angles.

    None for None.
    """
    if joint_position is None or callable(joint_position):
        return joint_position
    fixed = np.asarray(joint_position, dtype=np.float64)
    return lambda: fixed


def _record_mcap(
    link: Link,
    hand: Hand,
    header: dict[str, Any],
    path: str | os.PathLike[str],
    overwrite: bool,
    joint_position: npt.ArrayLike | JointSource | None,
    output: LiveOutput | None,
    proximity: ProximityWatch | None,
) -> RecordingSkin:
    """Open a skin that is recorded to an MCAP file; arguments as for `record_link`. proximity None: no such topics.

    After an error an empty file is deleted; the caller closes the link.
    """
    from taxel.ros.mcap_file import McapFile  # needs the extra `ros`, which the core does not install

    file = McapFile(path, header, overwrite, output)
    try:
        return McapSkin(link, hand, file, header, make_joint_source(joint_position), proximity)
    except BaseException:
        file.discard()
        raise
