"""A recording behind a pseudo-terminal: any program opens it as the hub's serial port, and the hub's frames come."""

from __future__ import annotations

import contextlib
import errno
import os
import select
import time
import tty
import zlib
from collections.abc import Callable
from contextlib import closing
from types import TracebackType
from typing import Any, Final, Self

from taxel.hand import Board, Hand
from taxel.link import CaptureError, Link
from taxel.stream.encoder import encode_on_wire
from taxel.stream.timed import Beginning, beginning_of, timed_bytes
from taxel_protocol import PROTOCOL_VERSION, PROTOCOL_VERSION_MIN, Command, FrameType, ReferenceDecoder
from taxel_protocol.frames import FRAMES, BoardInfo, HubHello, Log, Reply
from taxel_protocol.layout import fields_of, pack, unpack
from taxel_protocol.limits import REGISTER_MAP_VERSION, SNAPSHOT_OVERHEAD
from taxel_protocol.registers import Identity

PATIENCE_S: Final = 1.0
"""Who has opened the port and said nothing for so long only listens: then the recording begins."""

REPLIES: Final = 64
"""Numbers kept free before the first recorded frame's, for answers; those left over go to empty log frames, so that no
frame seems lost.
"""
_TICK_S: Final = 0.02
_NUMBERS: Final = 1 << 16


class PortGoneError(Exception):
    """Nobody has the port open any more."""


class VirtualPort:
    """A pseudo-terminal on which a recording plays. `device` is its name, such as /dev/pts/3.

    `open_link` opens the recording anew at each call. To a host that greets, it answers as the hub did: greeting,
    boards, settings, start; after the start it only plays. `speed`: times real time; None: as fast as the program
    reads. Raises `CaptureError` for a recording without a taxel frame.
    """

    def __init__(self, open_link: Callable[[], Link], hand: Hand, speed: float | None = 1.0) -> None:
        self._open_link = open_link
        self._hand = hand
        self._speed = speed
        with closing(open_link()) as link:
            beginning = beginning_of(link)
            if beginning is None:
                raise CaptureError(link.name, "has no taxel frame to play")
        self._beginning: Beginning = beginning
        self._sequence = (beginning.sequence - REPLIES) % _NUMBERS
        self._decoder = ReferenceDecoder()
        self._is_started = False
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.device = os.ttyname(slave)
        os.close(slave)  # whether somebody has it open is seen on the other end
        os.set_blocking(self._master, False)

    def play(self, wait_s: float | None = None) -> bool:
        """Wait for a program to open the port, at most `wait_s` (None: for ever), and play the recording to it.

        Returns whether the recording came to its end before the program closed the port. Raises what the recording
        raises.
        """
        deadline = None if wait_s is None else time.monotonic() + wait_s
        while not self._is_open():
            if deadline is not None and time.monotonic() > deadline:
                return False
            time.sleep(_TICK_S)
        try:
            self._greet()
            self._fill()
            self._play()
        except PortGoneError:
            return False
        with contextlib.suppress(PortGoneError):
            self._drain()
        return True

    def _is_open(self) -> bool:
        poll = select.poll()
        poll.register(self._master, select.POLLIN)
        return not any(event & select.POLLHUP for _, event in poll.poll(0))

    def _greet(self) -> None:
        """Answer until START, or until a silent listener's patience has been shown."""
        silent_until_s = time.monotonic() + PATIENCE_S
        is_silent = True
        while not self._is_started and (not is_silent or time.monotonic() < silent_until_s):
            for kind, _, payload in self._decoder.push(self._read(_TICK_S)):
                is_silent = False
                self._answer(FrameType(kind), payload)

    def _read(self, timeout_s: float) -> bytes:
        if not select.select([self._master], [], [], timeout_s)[0]:
            return b""
        try:
            return os.read(self._master, 4096)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno == errno.EIO:
                raise PortGoneError from None
            raise

    def _answer(self, kind: FrameType, payload: bytes) -> None:
        if kind is FrameType.HOST_HELLO:
            fields: dict[str, Any] = {field.name: 0 for field in fields_of(HubHello)}
            fields |= {"tag": payload[0], "unique_id": bytes(8), "version_chosen": PROTOCOL_VERSION}
            fields |= {"version_min": PROTOCOL_VERSION_MIN, "version_max": PROTOCOL_VERSION}
            self._send(FrameType.HUB_HELLO, pack(HubHello, fields))
        elif kind is FrameType.COMMAND:
            asked, _ = unpack(FRAMES[kind].payload, payload)
            if asked["command"] == Command.GET_BOARD_INFO:
                for board in self._hand.boards:
                    self._send(FrameType.BOARD_INFO, pack(BoardInfo, _board_info(board)))
            self._is_started = asked["command"] == Command.START
            fields = {"tag": asked["tag"], "command": asked["command"], "status": 0}
            self._send(FrameType.REPLY, pack(Reply, fields))

    def _fill(self) -> None:
        empty = pack(Log, {field.name: 0 for field in fields_of(Log)})
        while 0 < (self._beginning.sequence - self._sequence) % _NUMBERS <= REPLIES:
            self._send(FrameType.LOG, empty)

    def _send(self, kind: FrameType, payload: bytes) -> None:
        self._write(encode_on_wire(kind, self._sequence, payload))
        self._sequence = (self._sequence + 1) % _NUMBERS

    def _write(self, data: bytes) -> None:
        while data:
            if not self._is_open():
                raise PortGoneError
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                self._read(0.0)  # what the host says meanwhile has no answer
                select.select([], [self._master], [], _TICK_S)

    def _play(self) -> None:
        skip = self._beginning.skip
        origin: tuple[float, float] | None = None
        with closing(self._open_link()) as link:
            for data, time_s in timed_bytes(link):
                if skip >= len(data):
                    skip -= len(data)
                    continue
                piece, skip = data[skip:], 0
                if self._speed is not None:
                    origin = origin or (time_s, time.monotonic())
                    self._wait_until(origin[1] + (time_s - origin[0]) / self._speed)
                self._write(piece)

    def _wait_until(self, due_s: float) -> None:
        while (left_s := due_s - time.monotonic()) > 0.0:
            self._read(min(left_s, _TICK_S))
            if not self._is_open():
                raise PortGoneError

    def _drain(self) -> None:
        """Let the program read what is still in the terminal: closing it would take that away."""
        while self._is_open():
            self._read(_TICK_S)

    def close(self) -> None:
        """Take the port away."""
        if self._master >= 0:
            os.close(self._master)
            self._master = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _board_info(board: Board) -> dict[str, Any]:
    kind = board.kind
    fields: dict[str, Any] = {field.name: field.constant or 0 for field in fields_of(Identity)}
    fields |= {"map_version": REGISTER_MAP_VERSION, "kind": kind.code, "address": board.address, "unique_id": bytes(8)}
    fields |= {"rows": kind.tx_count, "columns": kind.rx_count, "taxel_count": kind.taxel_count}
    fields |= {"snapshot_size": SNAPSHOT_OVERHEAD + 2 * kind.taxel_count, "crossing_map": kind.crossing_bitmap()}
    fields["crc32"] = zlib.crc32(pack(Identity, fields)[:-4])
    info: dict[str, Any] = {field.name: 0 for field in fields_of(BoardInfo)}
    return info | {f"identity_{name}": value for name, value in fields.items()}
