"""How frames of one board come to the bench."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from typing import Final, Protocol

import numpy as np

from taxel.stream import TaxelFrame
from taxel_protocol.layout import packer_of, unpack
from taxel_protocol.limits import REGISTER_SNAPSHOT, SNAPSHOT_OVERHEAD
from taxel_protocol.registers import SnapshotHeader
from taxel_tools.application import RETRY_PAUSE_S
from taxel_tools.bench.capture import Capture, unwrapped
from taxel_tools.errors import BoardError, TransferError, WireError
from taxel_tools.scheduler import run
from taxel_tools.procedure import Pause, Procedure, Transfer
from taxel_tools.wires import BoardWire, HubWire

SILENCE_S: Final = 2.0
"""A board that gives nothing for so long has failed; the slowest scan takes a tenth of it."""
LATE_S: Final = 0.5
"""A record that ends with so long a silence is not whole."""
POLL_S: Final = 0.02
REPORT_S: Final = 0.05
"""How long after its reply the hub's counters may come."""
BUS_COUNTERS: Final = ("retries", "nacks", "timeouts", "crc_errors", "bus_errors")
"""Of the hub: reads of a board that the bus has spoilt, at the first attempt or at the second."""
US_PER_S: Final = 1e6

_HEADER: Final = packer_of(SnapshotHeader).size

Row = tuple[int, float, int, np.ndarray]  # sequence, host time in seconds, board's clock in us, counts


class Readout(Protocol):
    """Frames of one board, each scan once."""

    def begin(self) -> None:
        """Let frames come. What came before is thrown away."""
        ...

    def end(self) -> None:
        """Let no more come."""
        ...

    def frames(self, until: Callable[[int, float], bool]) -> Capture:
        """Frames from now on, until `until(frames, seconds)`.

        Raises `BoardError` if the board falls silent, `WireError` if the wire ends.
        """
        ...

    def bus_errors(self) -> tuple[int, int]:
        """How often this board was read in vain so far, and how often it was read at all."""
        ...


def _capture(rows: list[Row], taxels: int) -> Capture:
    counts = np.array([row[3] for row in rows], dtype=np.uint16).reshape(len(rows), taxels)
    clock = unwrapped(np.array([row[2] for row in rows], dtype=np.int64), 2**32)
    sequence = unwrapped(np.array([row[0] for row in rows], dtype=np.int64), 2**16)
    return Capture(counts, np.array([row[1] for row in rows], dtype=np.float64), clock / US_PER_S, sequence)


def _is_over(address: int, is_enough: bool, silent_s: float) -> bool:
    """Raises `BoardError` if nothing has come for too long."""
    if silent_s > (LATE_S if is_enough else SILENCE_S):
        raise BoardError(address, f"has sent no frame for {silent_s:.1f} s; check its plug and its power")
    return is_enough


class HubReadout:
    """The frames that the hub streams."""

    def __init__(self, wire: HubWire, address: int, taxels: int) -> None:
        self._hub = wire.hub
        self._name = wire.name
        self._address = address
        self._taxels = taxels

    def begin(self) -> None:
        """START."""
        self._hub.start()
        self._hub.stream.frames.clear()

    def end(self) -> None:
        """STOP."""
        self._hub.stop()
        self._hub.stream.frames.clear()

    def frames(self, until: Callable[[int, float], bool]) -> Capture:
        """As `Readout`."""
        rows: list[Row] = []
        waiting = self._hub.stream.frames
        self._poll(0.0)
        waiting.clear()
        began = heard = self._hub.now_s()
        last = -1
        while True:
            now = self._hub.now_s()
            if _is_over(self._address, until(len(rows), now - began), now - heard):
                return _capture(rows, self._taxels)
            self._poll(POLL_S)
            while waiting:
                frame: TaxelFrame = waiting.popleft()
                if frame.address == self._address and frame.sequence != last and len(frame.raw_counts) == self._taxels:
                    last, heard = frame.sequence, now
                    rows.append((frame.sequence, frame.time_s, frame.board_time_us, frame.raw_counts))

    def _poll(self, timeout_s: float) -> None:
        try:
            self._hub.stream.poll(timeout_s)
        except EOFError:
            raise WireError(self._name, "ended while frames were read; check the connection") from None

    def bus_errors(self) -> tuple[int, int]:
        """As the hub counts them."""
        self._hub.read_status()
        until = self._hub.now_s() + REPORT_S
        while self._hub.now_s() < until:
            self._poll(POLL_S)
        counters = self._hub.board_status.get(self._address, {})
        return sum(int(counters.get(name, 0)) for name in BUS_COUNTERS), int(counters.get("polls", 0))


class AdapterReadout:
    """Snapshots read from the board's registers, as fast as the adapter reads."""

    def __init__(self, wire: BoardWire, address: int, taxels: int) -> None:
        self._wire = wire
        self._address = address
        self._taxels = taxels
        self._size = SNAPSHOT_OVERHEAD + 2 * taxels
        self._reads = self._damaged = 0

    def begin(self) -> None:
        """Nothing: boards always scan."""

    def end(self) -> None:
        """Nothing."""

    def frames(self, until: Callable[[int, float], bool]) -> Capture:
        """As `Readout`."""
        rows: list[Row] = []
        began = heard = self._wire.now_s()
        last = -1
        while True:
            now = self._wire.now_s()
            if _is_over(self._address, until(len(rows), now - began), now - heard):
                return _capture(rows, self._taxels)
            data = run(self._wire, self._read())
            if data is None:
                continue
            header = unpack(SnapshotHeader, data[:_HEADER])[0]
            if header["sequence"] != last:
                last, heard = header["sequence"], now
                counts = np.frombuffer(data, dtype="<u2", count=self._taxels, offset=_HEADER)
                rows.append((last, self._wire.now_s(), header["timestamp_us"], counts))

    def bus_errors(self) -> tuple[int, int]:
        """As they were counted here."""
        return self._damaged, self._reads

    def _read(self) -> Procedure[bytes | None]:
        self._reads += 1
        try:
            data = yield Transfer(self._address, bytes([REGISTER_SNAPSHOT]), self._size)
        except TransferError:
            self._damaged += 1
            yield Pause(RETRY_PAUSE_S)
            return None
        crc = zlib.crc32(data[:-4], zlib.crc32(bytes([self._address])))
        if crc != int.from_bytes(data[-4:], "little"):
            self._damaged += 1
            return None
        return data


def readout_of(wire: BoardWire, address: int, taxels: int) -> Readout:
    """What fits the wire."""
    return HubReadout(wire, address, taxels) if isinstance(wire, HubWire) else AdapterReadout(wire, address, taxels)
