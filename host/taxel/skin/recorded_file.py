"""The URL scheme `file`: a capture, a PCAPNG file, an MCAP file or a ROS 1 bag as a link."""

from taxel.hand import Hand
from taxel.link import Link, LinkError
from taxel.link.capture import CaptureLink
from taxel.link.pcapng_link import PcapngLink, is_pcapng
from taxel.link.url import get_recorded_path


def open_file(url: str, hand: Hand | None = None) -> Link:
    """Open the recording of a `file:` URL as a link. hand: not used, since a recording contains its own hand.

    Raises `LinkError` if the URL names no file, `CaptureError` if the file cannot be read, and `MissingPackageError` if
    the file needs a library that is not installed.
    """
    path = get_recorded_path(url)
    if path is None:
        raise LinkError(url, "is not a file: URL; expected file:capture.bin")
    from taxel.ros.mcap_signature import is_mcap, is_ros1_bag

    if is_ros1_bag(path):
        from taxel.ros.original_bag import open_original_bag  # needs the extra `ros`

        return open_original_bag(path)
    if not is_mcap(path):
        return PcapngLink(path) if is_pcapng(path) else CaptureLink(path)
    from taxel.ros.mcap_link import open_mcap  # needs the extra `ros`, which the core does not install

    return open_mcap(path)
