"""Playback of a recording on a pseudo-terminal, which any program can open as the serial port of the hub."""

import contextlib
import errno
import os
import select
import time
import tty
from collections.abc import Callable
from contextlib import closing
from types import TracebackType
from typing import Any, Final, Self

from taxel.hand import Hand
from taxel.hand.board_info import make_board_info
from taxel.link import CaptureError, Link
from taxel.stream.encoder import encode_on_wire
from taxel.stream.timed import StreamStart, find_stream_start, read_timed_bytes
from taxel_protocol import PROTOCOL_VERSION, PROTOCOL_VERSION_MIN, Command, FrameType, ReferenceDecoder
from taxel_protocol.frames import FRAMES, BoardInfo, HubHandshake, Log, Reply
from taxel_protocol.layout import list_fields, pack, unpack

HANDSHAKE_TIMEOUT_S: Final = 1.0
"""Time after which a program that has opened the port without sending anything is assumed to only read, seconds. The
playback then starts. A larger value delays the playback for such programs; a smaller one may miss the handshake of a
slow host.
"""

RESERVED_SEQUENCES: Final = 64
"""Number of sequence numbers before the first recorded frame that are reserved for replies. Empty log frames use the
remaining ones, so that the host counts no frame as lost.
"""
_POLL_PERIOD_S: Final = 0.02
_SEQUENCE_MODULUS: Final = 1 << 16


class PortClosedError(Exception):
    """Error: the program that read the pseudo-terminal has closed it."""


class VirtualPort:
    """A pseudo-terminal on which a recording is played.

    A host that opens the port gets the replies of a hub to handshake, board requests, settings and START. After START
    the port only plays. The attribute `device` is the name of the port, such as /dev/pts/3.
    """

    def __init__(self, open_link: Callable[[], Link], hand: Hand, speed: float | None = 1.0) -> None:
        """Create a pseudo-terminal on which a recording is played.

        open_link: function that opens the recording from its start; called several times. speed: factor on the recorded
        speed; None: as fast as the program reads. Raises CaptureError for a recording without a taxel frame.
        """
        self._open_link = open_link
        self._hand = hand
        self._speed = speed
        with closing(open_link()) as link:
            start = find_stream_start(link)
            if start is None:
                raise CaptureError(link.name, "has no taxel frame to play")
        self._start: StreamStart = start
        # The replies to the host use the sequence numbers directly before the first recorded frame.
        self._sequence = (start.sequence - RESERVED_SEQUENCES) % _SEQUENCE_MODULUS
        self._decoder = ReferenceDecoder()
        self._is_started = False
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.device = os.ttyname(slave)
        os.close(slave)  # the master reports a hang-up while no program has the port open, see `_is_open`
        os.set_blocking(self._master, False)

    def play(self, wait_s: float | None = None) -> bool:
        """Wait until a program opens the port, at most `wait_s` (None: without limit), and play the recording.

        Returns whether the recording was played to its end before the program closed the port. Raises the errors of the
        recording.
        """
        deadline = None if wait_s is None else time.monotonic() + wait_s
        while not self._is_open():
            if deadline is not None and time.monotonic() > deadline:
                return False
            time.sleep(_POLL_PERIOD_S)
        try:
            self._answer_handshake()
            self._send_padding()
            self._play()
        except PortClosedError:
            return False
        with contextlib.suppress(PortClosedError):
            self._wait_until_closed()
        return True

    def _is_open(self) -> bool:
        """Whether a program has the pseudo-terminal open."""
        poll = select.poll()
        poll.register(self._master, select.POLLIN)
        return not any(event & select.POLLHUP for _, event in poll.poll(0))

    def _answer_handshake(self) -> None:
        """Answer the frames of the host as a hub does, until the host sends START.

        Returns early if the host sends no frame within `HANDSHAKE_TIMEOUT_S`, because such a program only reads. After
        the first frame of the host, the wait for START has no limit.
        """
        deadline_s = time.monotonic() + HANDSHAKE_TIMEOUT_S
        is_silent = True
        while not self._is_started and (not is_silent or time.monotonic() < deadline_s):
            for kind, _, payload in self._decoder.push(self._read(_POLL_PERIOD_S)):
                is_silent = False
                self._answer(FrameType(kind), payload)

    def _read(self, timeout_s: float) -> bytes:
        """Return bytes of the host; empty after `timeout_s` seconds without a byte.

        Raises PortClosedError if no program has the pseudo-terminal open; the system then reports the error EIO.
        """
        if not select.select([self._master], [], [], timeout_s)[0]:
            return b""
        try:
            return os.read(self._master, 4096)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno == errno.EIO:
                raise PortClosedError from None
            raise

    def _answer(self, kind: FrameType, payload: bytes) -> None:
        """Reply to a frame of the host as a hub does; other frames than handshake and command get no reply.

        The command START sets `_is_started`.
        """
        if kind is FrameType.HOST_HANDSHAKE:
            fields: dict[str, Any] = {field.name: 0 for field in list_fields(HubHandshake)}
            fields |= {"tag": payload[0], "unique_id": bytes(8), "version_chosen": PROTOCOL_VERSION}
            fields |= {"version_min": PROTOCOL_VERSION_MIN, "version_max": PROTOCOL_VERSION}
            self._send(FrameType.HUB_HANDSHAKE, pack(HubHandshake, fields))
        elif kind is FrameType.COMMAND:
            request, _ = unpack(FRAMES[kind].payload, payload)
            if request["command"] == Command.GET_BOARD_INFO:
                for board in self._hand.boards:
                    self._send(FrameType.BOARD_INFO, pack(BoardInfo, make_board_info(board)))
            self._is_started = request["command"] == Command.START
            fields = {"tag": request["tag"], "command": request["command"], "status": 0}
            self._send(FrameType.REPLY, pack(Reply, fields))

    def _send_padding(self) -> None:
        """Send empty log frames with the sequence numbers that precede the first recorded frame.

        The host then counts no lost frames between the replies and the recording.
        """
        empty = pack(Log, {field.name: 0 for field in list_fields(Log)})
        # The upper bound ends the loop at once if the replies have used more numbers than are reserved.
        while 0 < (self._start.sequence - self._sequence) % _SEQUENCE_MODULUS <= RESERVED_SEQUENCES:
            self._send(FrameType.LOG, empty)

    def _send(self, kind: FrameType, payload: bytes) -> None:
        """Send one frame of a hub to the host, with the next sequence number."""
        self._write(encode_on_wire(kind, self._sequence, payload))
        self._sequence = (self._sequence + 1) % _SEQUENCE_MODULUS

    def _write(self, data: bytes) -> None:
        """Send bytes to the host. Raises PortClosedError if the host has closed the port."""
        while data:
            if not self._is_open():
                raise PortClosedError
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                self._read(0.0)  # frames of the host are discarded during the playback
                select.select([], [self._master], [], _POLL_PERIOD_S)

    def _play(self) -> None:
        """Send the recorded bytes, from the first taxel frame on, at the recorded times divided by the speed."""
        skip = self._start.skip
        origin: tuple[float, float] | None = None
        with closing(self._open_link()) as link:
            for data, time_s in read_timed_bytes(link):
                if skip >= len(data):
                    skip -= len(data)
                    continue
                data_to_send, skip = data[skip:], 0
                if self._speed is not None:
                    origin = origin or (time_s, time.monotonic())
                    self._wait_until(origin[1] + (time_s - origin[0]) / self._speed)
                self._write(data_to_send)

    def _wait_until(self, due_s: float) -> None:
        """Wait for a time of the monotonic clock, seconds. Raises PortClosedError if the host closes the port."""
        while (remaining_s := due_s - time.monotonic()) > 0.0:
            self._read(min(remaining_s, _POLL_PERIOD_S))
            if not self._is_open():
                raise PortClosedError

    def _wait_until_closed(self) -> None:
        """Wait for the program to close the port: closing the master would discard bytes that it has not read."""
        while self._is_open():
            self._read(_POLL_PERIOD_S)

    def close(self) -> None:
        """Remove the pseudo-terminal."""
        if self._master >= 0:
            os.close(self._master)
            self._master = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the pseudo-terminal at the end of the `with` block."""
        self.close()
