"""Readout of the frames of one board, through the hub or over an adapter."""

import zlib
from collections.abc import Callable
from typing import Final, Protocol

import numpy as np

from taxel.stream import TaxelFrame
from taxel_protocol.layout import get_packer, unpack
from taxel_protocol.limits import REGISTER_SNAPSHOT, SNAPSHOT_OVERHEAD
from taxel_protocol.registers import SnapshotHeader
from taxel_tools.application import RETRY_PAUSE_S
from taxel_tools.bench.capture import Capture, unwrap_counter
from taxel_tools.errors import BoardError, TransferError, WireError
from taxel_tools.procedure import Pause, Procedure, Transfer
from taxel_tools.scheduler import run
from taxel_tools.wires import BoardWire, HubWire

NO_FRAME_TIMEOUT_S: Final = 2.0
"""A board without a frame for this time has failed; the slowest scan takes a tenth of it."""
END_TIMEOUT_S: Final = 0.5
"""A record that ends with a longer gap is incomplete."""
POLL_S: Final = 0.02
STATUS_WAIT_S: Final = 0.05
"""Time in which the hub's counters arrive after its reply."""
BUS_COUNTERS: Final = ("retries", "nacks", "timeouts", "crc_errors", "bus_errors")
"""Counters of the hub for failed reads of a board, at the first or second attempt."""
US_PER_S: Final = 1e6

_HEADER: Final = get_packer(SnapshotHeader).size

Row = tuple[int, float, int, np.ndarray]  # Sequence, host time in seconds, clock of the board in us, counts.


class Readout(Protocol):
    """Frames of one board, each scan once."""

    def start(self) -> None:
        """Start the frames of the board. Earlier frames are discarded."""
        ...

    def stop(self) -> None:
        """Stop the frames of the board."""
        ...

    def read_frames(self, is_enough: Callable[[int, float], bool]) -> Capture:
        """Receive frames from now on, until `is_enough(number of frames, elapsed seconds)` returns True.

        Raises `BoardError` if the board stops responding, `WireError` if the connection ends.
        """
        ...

    def read_bus_errors(self) -> tuple[int, int]:
        """Return the number of failed reads of this board so far, and the number of all its reads."""
        ...


def _build_capture(rows: list[Row], taxels: int) -> Capture:
    """Join frames that were read from a board, without the wraps of their counters.

    rows: one frame each: sequence number, host time in s, board clock in us, raw counts.
    """
    counts = np.array([row[3] for row in rows], dtype=np.uint16).reshape(len(rows), taxels)
    clock = unwrap_counter(np.array([row[2] for row in rows], dtype=np.int64), 2**32)
    sequence = unwrap_counter(np.array([row[0] for row in rows], dtype=np.int64), 2**16)
    return Capture(counts, np.array([row[1] for row in rows], dtype=np.float64), clock / US_PER_S, sequence)


def _is_complete(address: int, is_enough: bool, silent_s: float) -> bool:
    """Return whether a record is complete (`is_enough`), after a check that the frames have not stopped.

    is_enough: whether the record has the requested length. silent_s: seconds since the last frame. Raises `BoardError`
    if this time exceeds `END_TIMEOUT_S` for a record of the requested length, or `NO_FRAME_TIMEOUT_S` for a shorter
    one.
    """
    if silent_s > (END_TIMEOUT_S if is_enough else NO_FRAME_TIMEOUT_S):
        raise BoardError(address, f"no frame for {silent_s:.1f} s; check plug and power")
    return is_enough


class HubReadout:
    """Frames streamed by the hub."""

    def __init__(self, wire: HubWire, address: int, taxels: int) -> None:
        """Create a reader of the frames that the hub streams for one board. address: I2C address; taxels: counts
        per frame.
        """
        self._hub = wire.hub
        self._name = wire.name
        self._address = address
        self._taxels = taxels

    def start(self) -> None:
        """Send the command START to the hub, so that it streams frames."""
        self._hub.start()
        self._hub.stream.frames.clear()

    def stop(self) -> None:
        """Send the command STOP to the hub, so that it streams no frames."""
        self._hub.stop()
        self._hub.stream.frames.clear()

    def read_frames(self, is_enough: Callable[[int, float], bool]) -> Capture:
        """Receive frames of the board from the hub until `is_enough(number of frames, elapsed seconds)` returns True.

        Raises `BoardError` if the board stops responding, `WireError` if the connection ends.
        """
        rows: list[Row] = []
        queue = self._hub.stream.frames
        self._poll(0.0)
        queue.clear()
        start_s = last_frame_s = self._hub.now_s()
        last = -1
        while True:
            now = self._hub.now_s()
            if _is_complete(self._address, is_enough(len(rows), now - start_s), now - last_frame_s):
                return _build_capture(rows, self._taxels)
            self._poll(POLL_S)
            while queue:
                frame: TaxelFrame = queue.popleft()
                if frame.address == self._address and frame.sequence != last and len(frame.raw_counts) == self._taxels:
                    last, last_frame_s = frame.sequence, now
                    rows.append((frame.sequence, frame.time_s, frame.board_time_us, frame.raw_counts))

    def _poll(self, timeout_s: float) -> None:
        """Receive the frames that arrive within `timeout_s`. Raises `WireError` if the link has ended."""
        try:
            self._hub.stream.poll(timeout_s)
        except EOFError:
            raise WireError(self._name, "the link ended while frames were read; check the connection") from None

    def read_bus_errors(self) -> tuple[int, int]:
        """Return the number of failed reads of the board and of all its reads, from the counters of the hub.

        Requests the counters, and waits `STATUS_WAIT_S` for them.
        """
        self._hub.read_status()
        deadline_s = self._hub.now_s() + STATUS_WAIT_S
        while self._hub.now_s() < deadline_s:
            self._poll(POLL_S)
        counters = self._hub.board_status.get(self._address, {})
        return sum(int(counters.get(name, 0)) for name in BUS_COUNTERS), int(counters.get("polls", 0))


class AdapterReadout:
    """Snapshots read from the registers of the board, at the speed of the adapter."""

    def __init__(self, wire: BoardWire, address: int, taxels: int) -> None:
        """Create a reader of the snapshot register of one board. address: I2C address; taxels: counts per snapshot."""
        self._wire = wire
        self._address = address
        self._taxels = taxels
        self._size = SNAPSHOT_OVERHEAD + 2 * taxels
        self._reads = self._failed_reads = 0

    def start(self) -> None:
        """Do nothing, as a board scans permanently."""

    def stop(self) -> None:
        """Do nothing, as a board scans permanently."""

    def read_frames(self, is_enough: Callable[[int, float], bool]) -> Capture:
        """Read snapshots of the board through the adapter until `is_enough(frames, elapsed seconds)` returns True.

        A scan that was already read is skipped. Raises `BoardError` if the board stops responding, `WireError` if the
        connection ends.
        """
        rows: list[Row] = []
        start_s = last_frame_s = self._wire.now_s()
        last = -1
        while True:
            now = self._wire.now_s()
            if _is_complete(self._address, is_enough(len(rows), now - start_s), now - last_frame_s):
                return _build_capture(rows, self._taxels)
            data = run(self._wire, self._read())
            if data is None:
                continue
            header = unpack(SnapshotHeader, data[:_HEADER])[0]
            if header["sequence"] != last:
                last, last_frame_s = header["sequence"], now
                counts = np.frombuffer(data, dtype="<u2", count=self._taxels, offset=_HEADER)
                rows.append((last, self._wire.now_s(), header["timestamp_us"], counts))

    def read_bus_errors(self) -> tuple[int, int]:
        """Return the number of failed snapshot reads and of all snapshot reads by this object."""
        return self._failed_reads, self._reads

    def _read(self) -> Procedure[bytes | None]:
        """Read one snapshot; None if the transfer or the CRC fails."""
        self._reads += 1
        try:
            data = yield Transfer(self._address, bytes([REGISTER_SNAPSHOT]), self._size)
        except TransferError:
            self._failed_reads += 1
            yield Pause(RETRY_PAUSE_S)
            return None
        # The last 4 bytes are the CRC-32 of the board's address followed by all earlier bytes (protocol/SPEC.md).
        crc = zlib.crc32(data[:-4], zlib.crc32(bytes([self._address])))
        if crc != int.from_bytes(data[-4:], "little"):
            self._failed_reads += 1
            return None
        return data


def open_readout(wire: BoardWire, address: int, taxels: int) -> Readout:
    """Create the reader of a board's frames for its kind of connection, hub or adapter."""
    return HubReadout(wire, address, taxels) if isinstance(wire, HubWire) else AdapterReadout(wire, address, taxels)
