"""A skin whose bytes are written to a capture while they are used."""

import os

from taxel.emulated import open_emulator
from taxel.hand import Hand, load_hand
from taxel.link import CaptureError, CaptureWriter, Chunk, Link, open_link
from taxel.skin import Skin


class RecordingLink:
    """Another link, with every chunk that it brings appended to a capture before anybody sees it."""

    def __init__(self, link: Link, writer: CaptureWriter) -> None:
        self._link = link
        self._writer = writer
        self.name = link.name
        self.baud = link.baud
        self.is_real_time = link.is_real_time
        self.is_recorded = link.is_recorded
        self.holds_back = link.holds_back

    def read(self, timeout_s: float) -> Chunk | None:
        """The next bytes, written down."""
        chunk = self._link.read(timeout_s)
        if chunk is not None:
            self._writer.write(chunk.data, chunk.arrival_ns)
        return chunk

    def write(self, data: bytes) -> None:
        """Send bytes; they are not recorded."""
        self._link.write(data)

    def close(self) -> None:
        """Close link and capture."""
        self._link.close()
        self._writer.close()


def open_recorded(
    url: str, path: str | os.PathLike[str], hand: Hand | str = "allegro", overwrite: bool = False
) -> Skin:
    """As `taxel.open`, and everything that arrives goes to the capture `path` as well.

    Raises `CaptureError` before anything is opened if the file exists and `overwrite` is False.
    """
    description = hand if isinstance(hand, Hand) else load_hand(hand)
    if os.path.exists(path) and not overwrite:
        raise CaptureError(
            os.fspath(path), "exists already; choose another name, or ask for it to be overwritten (--overwrite)"
        )
    link = open_emulator(url, description) if url.startswith("emulator:") else open_link(url)
    try:
        writer = CaptureWriter(path, {"url": url, "hand": description.name, "baud": link.baud}, overwrite)
    except CaptureError:
        link.close()
        raise
    try:
        return Skin(RecordingLink(link, writer), description)
    except BaseException:
        if writer.records == 0:
            os.unlink(path)  # nothing ever came: an empty capture helps nobody
        raise
