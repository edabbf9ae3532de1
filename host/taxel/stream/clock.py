"""Clock mapping from the boards, whose oscillators are off by up to 2 %, to the host.

Step 1, board to hub: the hub reads each board's clock about once a second (TIME_SYNC); a line through the latest
readings maps board time to hub time. Step 2, hub to host: bytes can be delayed but never arrive early, so the lower
envelope of the (departure, arrival) points maps hub time to host time.
"""

from collections import deque
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from taxel.stream.board_line import BoardLine
from taxel.stream.frames import HubMessage
from taxel_protocol import FrameType

BIN_US = 50_000.0
BINS = 400
"""Largest number of bins in the lower envelope. A bin is an interval of `BIN_US` of hub time, in microseconds; each bin
contributes the arrival with the smallest delay.
"""

REFIT_BINS = 10
"""Number of bins after which the line is fitted again although no point lies below it."""

RATE_TOLERANCE = 0.025
"""Largest relative rate difference between hub and host: 2 % of the hub's oscillator plus the host's error."""

RESTART_US = 100_000
"""A hub clock that goes back by more than this indicates a hub restart."""

AGE_MAX_US = 2_000_000
"""Largest age of a scan when the hub reads it; a larger age indicates a board restart."""

WIRE_OVERHEAD = 12
"""Bytes of a frame without its payload: header, CRC, stuffing and delimiters."""

_WRAP = 1 << 32


def _is_plausible(step_us: int, elapsed_us: int) -> bool:
    """Whether a board clock that advanced by `step_us` agrees with the hub clock, which advanced by `elapsed_us`.

    The tolerance is 10 % plus 1 ms; no oscillator is off by 10 %.
    """
    return abs(step_us - elapsed_us) <= 0.1 * elapsed_us + 1000


class LowerEnvelope:
    """Line below a set of points (hub time x, host time y): host times of bytes that arrived with the smallest delay.

    The line contains the edge of the lower convex hull at the middle of the span of x.
    """

    def __init__(self) -> None:
        """Create an envelope without points; the line through the points is fitted on first use."""
        self._bins: deque[tuple[float, float, float]] = deque(maxlen=BINS)
        self._fit: tuple[float, float, float] | None = None
        self._fitted_bin = 0.0

    def add(self, x: float, y: float) -> None:
        """Add a point (x, y) of the lower envelope.

        x: hub time, microseconds; it may be below the hub time of the point before by at most one bin. y: host time,
        seconds. Only the point with the smallest delay of each bin of x is kept.
        """
        number = x // BIN_US
        delay = y - x * 1e-6
        if self._bins and self._bins[-1][0] == number:
            if delay >= self._bins[-1][2] - self._bins[-1][1] * 1e-6:
                return
            self._bins.pop()
        self._bins.append((number, x, y))
        if self._fit is not None:
            # A point above the line hardly changes the fit, so the line is kept for another half second.
            x0, y0, slope = self._fit
            if y < y0 + slope * (x - x0) or number - self._fitted_bin >= REFIT_BINS:
                self._fit = None

    @property
    def line(self) -> tuple[float, float, float] | None:
        """(x0, y0, slope) of y = y0 + slope * (x - x0), slope in seconds per microsecond; None without points."""
        if self._fit is None and self._bins:
            self._fit = self._fit_envelope([(x, y) for _, x, y in self._bins])
            self._fitted_bin = self._bins[-1][0]
        return self._fit

    @staticmethod
    def _fit_envelope(points: list[tuple[float, float]]) -> tuple[float, float, float]:
        """Fit the line through the edge of the lower convex hull at the middle of the span of x.

        points: (x, y) with ascending x, microseconds and seconds. Returns (x0, y0, slope) of the line y = y0 + slope *
        (x - x0).
        """
        x0, y0 = points[0]
        offsets = [(x - x0, y - y0) for x, y in points]
        hull: list[tuple[float, float]] = []
        for x, y in offsets:  # Andrew's monotone chain, lower half
            while len(hull) >= 2:
                (xa, ya), (xb, yb) = hull[-2:]
                if (xb - xa) * (y - ya) - (yb - ya) * (x - xa) > 0.0:
                    break
                hull.pop()
            hull.append((x, y))
        middle = 0.5 * offsets[-1][0]
        for (xa, ya), (xb, yb) in pairwise(hull):
            if xb >= middle and xb != xa:  # hub times may decrease by less than a bin
                slope = (yb - ya) / (xb - xa)
                # Two points 50 ms apart, one of them delayed, can give a slope outside the oscillator tolerance.
                possible = min(max(slope, (1.0 - RATE_TOLERANCE) * 1e-6), (1.0 + RATE_TOLERANCE) * 1e-6)
                if possible != slope:
                    xa, ya = min(offsets, key=lambda point: point[1] - possible * point[0])
                return x0 + xa, y0 + ya, possible
        return x0, y0, 1e-6


class ClockMap:
    """Mapping of the times of one stream, hub time and board times, to the host's clock."""

    def __init__(self, baud: float, has_arrivals: bool) -> None:
        """Create the clock mapping of one stream.

        baud: bits per second of the hub's port. has_arrivals: whether arrival times are real; if not, hub time is the
        time base of the result. The arrays with 128 elements have one element per 7-bit board address.
        """
        self._byte_us = 10e6 / baud  # a byte on the UART has 10 bits: start bit, 8 data bits, stop bit
        self._has_arrivals = has_arrivals
        self._hub_us = 0  # latest hub time, unwrapped
        self._envelope = LowerEnvelope()
        self._read_us = np.full(128, np.inf)
        self._last_read: tuple[NDArray[np.uint16], NDArray[np.int64], NDArray[np.uint8]] | None = None
        self._lines: dict[int, BoardLine] = {}
        self._implausible: dict[int, tuple[int, int]] = {}
        self._is_mapped = np.zeros(128, dtype=bool)
        self._board_0 = np.zeros(128, dtype=np.uint32)
        self._hub_0 = np.zeros(128)
        self._rate = np.ones(128)

    def is_synchronised(self, address: int) -> bool:
        """Whether the board's timestamps are used: from its second clock reading on, about two seconds after its start.

        Before that, the time of a frame is the time at which the hub read it, late by the age of the scan (at most two
        scan periods).
        """
        return bool(self._is_mapped[address])

    def take_message(self, message: HubMessage) -> None:
        """Update the mapping with a hub message; only TIME_SYNC, HUB_STATUS and HUB_HANDSHAKE have an effect."""
        if message.type is FrameType.HUB_STATUS or message.type is FrameType.HUB_HANDSHAKE:
            self._take_uptime(message.fields["uptime_us"])
        elif message.type is FrameType.TIME_SYNC:
            self._take_sync(message.fields["address"], message.fields["board_time_us"], message.fields["hub_time_us"])

    def _take_uptime(self, uptime_us: int) -> None:
        """Update the latest hub time with the uptime of a hub message, microseconds.

        A decrease by more than `RESTART_US` indicates a restart of the hub, which discards the mapping of the clocks.
        """
        if uptime_us < self._hub_us - RESTART_US:  # the hub has restarted, and its clock with it
            self._envelope = LowerEnvelope()
            self._last_read = None
            self._lines.clear()
            self._implausible.clear()
            self._is_mapped[:] = False
            self._hub_us = uptime_us
        self._hub_us = max(self._hub_us, uptime_us)

    def _take_sync(self, address: int, board_us: int, hub_us: int) -> None:
        """Use a reading of a board's clock (modulo 2^32 microseconds) at an unwrapped hub time for the board's line."""
        self._hub_us = max(self._hub_us, hub_us)
        line = self._lines.setdefault(address, BoardLine())
        if line:
            last_board_us, last_hub_us = line.last
            step = (board_us - last_board_us) % _WRAP
            if not _is_plausible(step, hub_us - last_hub_us):
                self._handle_implausible_sync(address, board_us, hub_us)
                return
            board_us = last_board_us + step
        self._implausible.pop(address, None)
        line.add(board_us, hub_us)
        self._update_line(address, line)

    def _handle_implausible_sync(self, address: int, board_us: int, hub_us: int) -> None:
        """Store a clock reading that does not follow the board's line; after a second consistent one, start a new line.

        board_us: time of the board's clock. hub_us: hub time of the reading, microseconds.
        """
        # A single implausible reading was damaged on the bus (it has no CRC); two consistent ones are a board restart.
        earlier = self._implausible.get(address)
        self._implausible[address] = (board_us, hub_us)
        if earlier is not None and _is_plausible((board_us - earlier[0]) % _WRAP, hub_us - earlier[1]):
            self._lines[address] = BoardLine()
            self._lines[address].add(*earlier)
            self._is_mapped[address] = False
            del self._implausible[address]
            self._take_sync(address, board_us, hub_us)

    def _update_line(self, address: int, line: BoardLine) -> None:
        """Fit the line from board time to hub time of the board at `address`, and store it for `hub_times_us`."""
        fit = line.fit()
        if fit is None:
            return
        board_us, hub_us = line.last
        offset, rate = fit
        self._board_0[address] = board_us % _WRAP
        self._hub_0[address] = hub_us + offset
        self._rate[address] = rate
        self._is_mapped[address] = True

    def hub_times_us(self, rows: NDArray[np.void]) -> NDArray[np.float64]:
        """Return the scan starts of k taxel frames (dtype `ROW`), f64[k], microseconds of hub time.

        A frame whose board clock is not mapped, or whose mapped time is implausible, gets the time at which the hub
        read it.
        """
        if not len(rows):
            return np.zeros(0)
        address = rows["address"].astype(np.intp)  # indexing with intp is ten times faster in numpy
        # Signed difference of clocks modulo 2^32: correct across a wrap, up to 35 minutes in both directions.
        since = (rows["board_time_us"] - self._board_0[address]).view(np.int32)
        mapped: NDArray[np.float64] = self._hub_0[address] + self._rate[address] * since
        read = self._unwrap(rows["hub_time_us"])
        self._hub_us = max(self._hub_us, int(read[-1]))
        age = read - mapped
        usable = self._is_mapped[address] & (age > -RESTART_US) & (age < AGE_MAX_US)
        return np.where(usable, mapped, read.astype(float))

    def _unwrap(self, hub_time_us: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Unwrap hub times modulo 2^32 to the values nearest to the latest hub time."""
        near = np.uint32(self._hub_us % _WRAP)
        return self._hub_us + (hub_time_us - near).view(np.int32).astype(np.int64)

    def take_arrivals(
        self,
        taxels: NDArray[np.void],
        taxel_arrivals_s: NDArray[np.float64],
        syncs: NDArray[np.void],
        sync_hub_us: Sequence[int],
    ) -> None:
        """Update the lower envelope with taxel and TIME_SYNC frames (dtype `ROW`), in stream order.

        `taxel_arrivals_s`: arrival time of the last byte of each taxel frame, seconds. `sync_hub_us`: hub times of the
        TIME_SYNC frames. A point of the envelope is the departure of a taxel frame on the hub's clock and its arrival
        on the host's clock. A frame departs when the hub has finished reading the board and has sent the frame. The
        read time of a board is estimated as the shortest time from the start of its read to the start of the next
        transfer, which may be that of a TIME_SYNC frame.
        """
        if not self._has_arrivals or not len(taxels) + len(syncs):
            return
        read_start = self._unwrap(taxels["hub_time_us"])
        self._update_read_times(taxels, read_start, syncs, np.array(sync_hub_us, dtype=np.int64))
        if not len(taxels):
            return
        read_us = self._read_us[taxels["address"]]
        read_us[read_us == np.inf] = 0.0
        departed = read_start + read_us + (taxels["length"] + float(WIRE_OVERHEAD)) * self._byte_us
        delay = taxel_arrivals_s - departed * 1e-6
        # The envelope keeps one point for each bin: of each run of frames in the same bin, only the earliest is added.
        bins = departed // BIN_US
        for start, end in pairwise([0, *(np.flatnonzero(bins[1:] != bins[:-1]) + 1).tolist(), len(taxels)]):
            earliest = start + int(np.argmin(delay[start:end]))
            self._envelope.add(float(departed[earliest]), float(taxel_arrivals_s[earliest]))

    def _update_read_times(
        self,
        taxels: NDArray[np.void],
        read_start: NDArray[np.int64],
        syncs: NDArray[np.void],
        sync_us: NDArray[np.int64],
    ) -> None:
        """Update the estimated time to read each board on the bus, from the times between successive transfers.

        taxels, syncs: rows of dtype `ROW`. read_start, sync_us: their unwrapped hub times, microseconds. A TIME_SYNC
        frame has the address 0 here: it ends the read of the board before it, but is no read of a board itself.
        """
        sequence, times, address = taxels["sequence"], read_start, taxels["address"]
        if len(syncs):
            order = np.argsort(np.concatenate([taxels["stream_position"], syncs["stream_position"]]), kind="stable")
            sequence = np.concatenate([sequence, syncs["sequence"]])[order]
            times = np.concatenate([times, sync_us])[order]
            address = np.concatenate([address, np.zeros(len(syncs), np.uint8)])[order]
        previous = self._last_read
        if previous is not None:  # a pair may span two batches
            sequence = np.concatenate([previous[0], sequence])
            times = np.concatenate([previous[1], times])
            address = np.concatenate([previous[2], address])
        self._last_read = sequence[-1:], times[-1:], address[-1:]
        step = times[1:] - times[:-1]
        follows = (sequence[1:] - sequence[:-1] == 1) & (address[:-1] != 0) & (step > 0)  # u16: modulo 65536
        np.minimum.at(self._read_us, address[:-1][follows], step[follows])

    def host_times_s(self, hub_us: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map hub times, microseconds, to the host's clock, seconds."""
        line = self._envelope.line if self._has_arrivals else None
        if line is None:
            return hub_us * 1e-6
        x0, y0, slope = line
        return y0 + slope * (hub_us - x0)
