"""An open skin: its board frames, its frames of the whole skin, and its losses."""

import contextlib
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType
from typing import Any, Literal, Self

import numpy as np

from taxel.errors import TaxelError
from taxel.hand import Hand
from taxel.link import Link, Reconnection, get_clock
from taxel.signal import BASELINE_SAMPLES, BaselineResult
from taxel.skin.baseline import measure_baseline
from taxel.skin.frame import SkinFrame
from taxel.stream import HubClient, LossAccount, TaxelFrame
from taxel.stream.cycles import CycleSorter
from taxel.stream.hub_client import HubError, VersionError

FrameFormat = Literal["plain", "compact"]
"""Frames on the wire: "plain", 16-bit raw counts; "compact", the same raw counts in fewer bytes."""

DISCOVERY_TIMEOUT_S = 1.0
"""Longest wait for boards that the hub has not found yet, in seconds. Boards start within 50 ms of power-up; a longer
time delays the opening of a skin with a missing board, a shorter one may miss a board that is still starting.
"""


class BoardMismatchError(TaxelError):
    """A board on the bus differs from the board that the hand description has at the same address."""


class Skin:
    """An open skin: an iterator over the frames of its boards (`TaxelFrame`), in the order of their arrival.

    Use the skin as a context manager. The iteration ends at the end of a recording. The iteration raises a one-line
    `TaxelError` if the port vanishes (unless its link opens the port again: `taxel.link.ReopeningLink`), or if a frame
    comes from a board that the hand does not have; all earlier frames are delivered first. After a restart of the hub,
    the handshake and START are repeated.
    """

    _is_recording = False

    def __init__(self, link: Link, hand: Hand, rate_hz: float | None = None, frames: FrameFormat = "plain") -> None:
        """Start the stream of taxel frames of a hub, unless the link is a recording.

        hand: description of the connected boards. rate_hz: highest rate of poll cycles; None: the rate that the bus
        permits. frames: format of the frames on the wire, "plain" or "compact". Raises TaxelError, and closes the link,
        if the hub does not respond or a board differs from the description.
        """
        self.hand = hand
        self.hub = HubClient(link)
        self._rate_hz = rate_hz
        self._compact = frames == "compact"
        self._stream = self.hub.stream
        if self._is_recording:
            self._stream.keep_undelivered()
        self._slices = {board.address: hand.get_slice(board.address) for board in hand.boards}
        self._sorter = CycleSorter(len(hand.boards))
        self._sizes = {board.address: board.kind.taxel_count for board in hand.boards}
        self.reconnection: Reconnection | None = getattr(link, "reconnection", None)
        """State of a port that is opened again after it has vanished; None: the skin ends with its port."""
        self._openings = 1
        try:
            if not link.is_recorded:
                self._start()
        except BaseException:
            self._stream.close()
            raise
        if self.reconnection is not None:
            self.reconnection.is_enabled = True

    def _start(self) -> None:
        """Make the handshake with the hub, check the boards, set the poll rate and start the stream of frames."""
        self.hub.handshake()
        self._discover_boards()
        for address, fields in sorted(self.hub.boards.items()):
            self._check_board(address, fields)
        self.hub.set_rate(self._rate_hz)
        self.hub.start(self._compact)

    def _resume(self) -> None:
        """Repeat handshake, poll rate and START after a restart of the hub or an interruption of the link."""
        self.hub.handshake()
        self.hub.set_rate(self._rate_hz)
        self.hub.start(self._compact, is_first=False)  # a restart of the hub resets the counting of poll cycles anyway

    def _resume_if_possible(self, reconnection: Reconnection) -> None:
        """Repeat handshake, poll rate and START if the port was opened again or the hub has restarted.

        Without a reply of the hub, the next call repeats the attempt. Frames that arrive meanwhile are kept. Raises
        `VersionError` for a hub of another protocol.
        """
        openings = reconnection.openings
        if not reconnection.is_open or (self.hub.has_handshake and openings == self._openings):
            return
        # One attempt only: the caller also updates a display or a count, and must not wait longer than necessary.
        attempts, self.hub.attempts = self.hub.attempts, 1
        try:
            self._resume()
        except VersionError:
            raise
        except HubError:
            return
        finally:
            self.hub.attempts = attempts
        self._openings = openings

    def _discover_boards(self) -> None:
        """Read the hub's list of boards repeatedly, until the hub has found all boards of the hand.

        The reading ends at the latest after `DISCOVERY_TIMEOUT_S`; boards may then be missing in `hub.boards`.
        """
        now_s = get_clock(self._stream.link)
        deadline = now_s() + DISCOVERY_TIMEOUT_S
        while True:
            self.hub.read_boards()
            if len(self.hub.boards) >= len(self.hand.boards) or now_s() > deadline:
                return
            self.hub.wait(0.05)

    def _check_board(self, address: int, fields: dict[str, Any]) -> None:
        """Raise `BoardMismatchError` if the taxels of the board at `address` differ from those of the hand's board.

        fields: fields of the board's BOARD_INFO message. Raises UnknownBoardError if the hand has no board there.
        """
        board = self.hand.get_board(address)  # raises UnknownBoardError
        found = (fields["identity_rows"], fields["identity_columns"], fields["identity_taxel_count"])
        expected = (board.kind.tx_count, board.kind.rx_count, board.kind.taxel_count)
        if found != expected or fields["identity_crossing_map"] != board.kind.pack_crossings():
            raise BoardMismatchError(
                f"board 0x{address:02X} has {found[2]} taxels on {found[0]} TX x {found[1]} RX, but hand "
                f"'{self.hand.name}' has {board.name} there, kind {board.kind.name} with {expected[2]} taxels "
                f"on {expected[0]} TX x {expected[1]} RX; exchange the board or use the hand description of this board"
            )

    @property
    def missing_boards(self) -> list[str]:
        """Names of the hand's boards that the hub has not found; empty for a recording."""
        if self._stream.link.is_recorded:
            return []
        return [board.name for board in self.hand.boards if board.address not in self.hub.boards]

    @property
    def rate_hz(self) -> float | None:
        """Highest rate of scans that was requested; None: the rate that the bus permits."""
        return self._rate_hz

    @property
    def link(self) -> Link:
        """The link that delivers the bytes."""
        return self._stream.link

    @property
    def losses(self) -> LossAccount:
        """Counts of frames received, missing and lost since the skin was opened."""
        return self._stream.losses

    @property
    def bytes_received(self) -> int:
        """Number of bytes that have arrived since the skin was opened."""
        return self._stream.bytes_received

    @property
    def bytes_discarded(self) -> int:
        """Number of bytes that belonged to no valid frame."""
        return self._stream.bytes_discarded

    @property
    def bytes_waiting(self) -> int:
        """Number of bytes that have arrived and are not decoded yet. The number grows if the reader is too slow."""
        return self._stream.bytes_waiting

    def is_synchronised(self, address: int) -> bool:
        """True if the times of a board's frames come from the board's own clock (see `taxel.stream.ClockMap`)."""
        return self._stream.clock.is_synchronised(address)

    def __iter__(self) -> Iterator[TaxelFrame]:
        """Yield the taxel frames of all boards in the order of arrival, until a recording ends."""
        frames = self._stream.frames
        while True:
            while frames:
                yield self._check_frame(frames.popleft())
            try:
                self._read_link()
            except EOFError:
                return

    def poll(self, timeout_s: float = 0.1) -> list[TaxelFrame]:
        """Return all board frames that have arrived, for loops that must not block; an empty list if there are none.

        timeout_s: longest wait for the first frame, seconds. Raises EOFError at the end of a recording, and otherwise
        the errors of the iteration.
        """
        if not self._stream.frames:
            self._read_link(timeout_s)
        arrived = [self._check_frame(frame) for frame in self._stream.frames]
        self._stream.frames.clear()
        return arrived

    def _read_link(self, timeout_s: float = 0.1) -> None:
        """Wait up to `timeout_s` seconds for bytes of the hub and decode them.

        If the hub has restarted or the port was opened again, the stream is started again first. Raises EOFError at the
        end of a recording, and the errors of the link.
        """
        if self.reconnection is not None:
            self._resume_if_possible(self.reconnection)
        elif not (self.hub.has_handshake or self._stream.link.is_recorded):
            self._resume()
        self._stream.poll(timeout_s)

    def _check_frame(self, frame: TaxelFrame) -> TaxelFrame:
        """Return the frame, or raise an error if the hand has no board with this address and number of taxels."""
        if self._sizes.get(frame.address) != len(frame.raw_counts):
            self._raise_mismatch(frame)
        return frame

    def _raise_mismatch(self, frame: TaxelFrame) -> None:
        """Raise `BoardMismatchError` for a frame whose number of taxels differs from that of the hand's board."""
        board = self.hand.get_board(frame.address)  # raises UnknownBoardError
        raise BoardMismatchError(
            f"a frame of board 0x{frame.address:02X} has {len(frame.raw_counts)} taxels, but hand '{self.hand.name}' "
            f"has {board.name} with {board.kind.taxel_count} there; use the hand description of this skin"
        )

    def scans(self) -> Iterator[SkinFrame]:
        """Iterate over frames of the whole skin, one for each poll cycle.

        The taxels of a board whose frame is missing in a cycle are not valid in that cycle.
        """
        for frame in self:
            yield from self.collect_scans([frame])
        while (frames := self._sorter.pop(is_end=True)) is not None:
            yield self._combine_frames(frames)

    def expect_boards(self, count: int) -> None:
        """Set the number of boards whose frames complete a poll cycle, before the first scan.

        If the hand's boards are on several ports, this is the number of boards on this skin's port.
        """
        self._sorter = CycleSorter(max(count, 1))

    def collect_scans(self, frames: Iterable[TaxelFrame]) -> Iterator[SkinFrame]:
        """Add frames of boards to their poll cycles, and yield the frames of the whole skin that are then complete.

        frames: frames of this skin, in the order of their arrival. Incomplete cycles remain for the next call.
        """
        for frame in frames:
            self._sorter.add(frame)  # an incomplete cycle stays in the sorter, and a later call completes it
            while (complete := self._sorter.pop()) is not None:
                yield self._combine_frames(complete)

    def _combine_frames(self, frames: list[TaxelFrame]) -> SkinFrame:
        """Combine the frames of one poll cycle into one of the whole skin; taxels of missing boards are not valid."""
        counts = np.zeros(self.hand.n_taxels, dtype=np.uint16)
        valid = np.zeros(self.hand.n_taxels, dtype=bool)
        for frame in frames:
            taxels = self._slices[frame.address]
            counts[taxels] = frame.raw_counts
            valid[taxels] = True
        return SkinFrame(frames[0].cycle, min(frame.time_s for frame in frames), counts, valid)

    def take_baseline(
        self, samples: int = BASELINE_SAMPLES, progress: Callable[[float], None] | None = None
    ) -> BaselineResult:
        """Measure the baseline (mean, noise, disturbed taxels) over the next `samples` frames of all responding boards.

        Nothing may touch the skin meanwhile. The frames are consumed. Taxels of boards that do not respond are NaN.
        progress: called with the completed share, 0 to 1. Raises `TaxelError` if a recording ends before the baseline
        is complete.
        """
        return measure_baseline(self.hand.n_taxels, self.scans(), samples, progress, self._stream.link.name)

    def close(self) -> None:
        """Stop the stream of the hub and close the link."""
        link = self._stream.link
        if not link.is_recorded:
            with contextlib.suppress(TaxelError):  # a port that has vanished has no stream to stop
                self.hub.send_stop()
        self._stream.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the skin and its link at the end of the `with` block."""
        self.close()
