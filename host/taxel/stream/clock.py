"""From a board's clock, up to 2 % off, to the host's.

Two steps. Board to hub: the hub reads each board's clock about once a second (TIME_SYNC); a line through the last
readings maps the board's microseconds to the hub's. Hub to host: bytes can only be late, never early, so a line under
all (departure, arrival) points, touching the earliest ones, maps the hub's clock to the host's.
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
"""The hub-to-host line is drawn under the earliest arrival of each of the last 400 bins of 50 ms."""

REFIT_BINS = 10

RATE_TOLERANCE = 0.025
"""The hub's and the host's clocks run alike within this share: 2 % of the hub's oscillator, and the host's own."""

RESTART_US = 100_000
"""A hub whose clock has gone back by more than this has been restarted."""

AGE_MAX_US = 2_000_000
"""No snapshot is older than this when it is read; a board time that says so is that of another start of the board."""

WIRE_OVERHEAD = 12
"""Bytes of a frame beside its payload: header, CRC, stuffing and delimiters."""

_WRAP = 1 << 32


def _is_plausible(step_us: int, elapsed_us: int) -> bool:
    """Whether a board's clock went on as the hub's did: no oscillator is off by a tenth."""
    return abs(step_us - elapsed_us) <= 0.1 * elapsed_us + 1000


class LowerEnvelope:
    """The line under a cloud of points that touches it from below around the middle of its span."""

    def __init__(self) -> None:
        self._bins: deque[tuple[float, float, float]] = deque(maxlen=BINS)
        self._fit: tuple[float, float, float] | None = None
        self._fitted_bin = 0.0

    def add(self, x: float, y: float) -> None:
        """A point; x in microseconds, never going back by more than a bin, y in seconds."""
        number = x // BIN_US
        late = y - x * 1e-6
        if self._bins and self._bins[-1][0] == number:
            if late >= self._bins[-1][2] - self._bins[-1][1] * 1e-6:
                return
            self._bins.pop()
        self._bins.append((number, x, y))
        if self._fit is not None:
            # A point above the line says little new: then the old line serves for half a second more.
            x0, y0, slope = self._fit
            if y < y0 + slope * (x - x0) or number - self._fitted_bin >= REFIT_BINS:
                self._fit = None

    @property
    def line(self) -> tuple[float, float, float] | None:
        """(x0, y0, slope): y = y0 + slope * (x - x0), slope in seconds a microsecond; None without a point."""
        if self._fit is None and self._bins:
            self._fit = self._touch([(x, y) for _, x, y in self._bins])
            self._fitted_bin = self._bins[-1][0]
        return self._fit

    @staticmethod
    def _touch(points: list[tuple[float, float]]) -> tuple[float, float, float]:
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
            if xb >= middle and xb != xa:  # a hub's times may go back, by less than a bin
                slope = (yb - ya) / (xb - xa)
                # Two points 50 ms apart, one of them late, would make a clock that no oscillator keeps.
                possible = min(max(slope, (1.0 - RATE_TOLERANCE) * 1e-6), (1.0 + RATE_TOLERANCE) * 1e-6)
                if possible != slope:
                    xa, ya = min(offsets, key=lambda point: point[1] - possible * point[0])
                return x0 + xa, y0 + ya, possible
        return x0, y0, 1e-6


class ClockMap:
    """Times of one stream on the host's clock.

    `has_arrivals` False (bytes from a program that does not pace them): the hub's own clock is the time base.
    """

    def __init__(self, baud: float, has_arrivals: bool) -> None:
        self._byte_us = 10e6 / baud
        self._has_arrivals = has_arrivals
        self._hub_us = 0  # latest hub time known, not wrapped
        self._envelope = LowerEnvelope()
        self._read_us = np.full(128, np.inf)
        self._last_begun: tuple[NDArray[np.uint16], NDArray[np.int64], NDArray[np.uint8]] | None = None
        self._lines: dict[int, BoardLine] = {}
        self._suspects: dict[int, tuple[int, int]] = {}
        self._known = np.zeros(128, dtype=bool)
        self._board_0 = np.zeros(128, dtype=np.uint32)
        self._hub_0 = np.zeros(128)
        self._rate = np.ones(128)

    def is_synchronised(self, address: int) -> bool:
        """Whether the board's own timestamps are used: after its second clock reading, within two seconds of its
        first frame.

        Until then a frame's time is that of the hub's read, late by the age of the snapshot (at most two scans).
        """
        return bool(self._known[address])

    def take_message(self, message: HubMessage) -> None:
        """Learn from a TIME_SYNC or HUB_STATUS frame."""
        if message.type is FrameType.HUB_STATUS or message.type is FrameType.HUB_HANDSHAKE:
            self._take_uptime(message.fields["uptime_us"])
        elif message.type is FrameType.TIME_SYNC:
            self._take_sync(message.fields["address"], message.fields["board_time_us"], message.fields["hub_time_us"])

    def _take_uptime(self, uptime_us: int) -> None:
        if uptime_us < self._hub_us - RESTART_US:  # the hub has started anew: so has its clock
            self._envelope = LowerEnvelope()
            self._last_begun = None
            self._lines.clear()
            self._suspects.clear()
            self._known[:] = False
            self._hub_us = uptime_us
        self._hub_us = max(self._hub_us, uptime_us)

    def _take_sync(self, address: int, board_us: int, hub_us: int) -> None:
        self._hub_us = max(self._hub_us, hub_us)
        line = self._lines.setdefault(address, BoardLine())
        if line:
            last_board_us, last_hub_us = line.last
            step = (board_us - last_board_us) % _WRAP
            if not _is_plausible(step, hub_us - last_hub_us):
                self._suspect(address, board_us, hub_us)
                return
            board_us = last_board_us + step
        self._suspects.pop(address, None)
        line.add(board_us, hub_us)
        self._use(address, line)

    def _suspect(self, address: int, board_us: int, hub_us: int) -> None:
        # One reading that does not fit was damaged on the bus (it has no CRC); two that fit each other are a restart.
        earlier = self._suspects.get(address)
        self._suspects[address] = (board_us, hub_us)
        if earlier is not None and _is_plausible((board_us - earlier[0]) % _WRAP, hub_us - earlier[1]):
            self._lines[address] = BoardLine()
            self._lines[address].add(*earlier)
            self._known[address] = False
            del self._suspects[address]
            self._take_sync(address, board_us, hub_us)

    def _use(self, address: int, line: BoardLine) -> None:
        fit = line.fit()
        if fit is None:
            return
        board_us, hub_us = line.last
        offset, rate = fit
        self._board_0[address] = board_us % _WRAP
        self._hub_0[address] = hub_us + offset
        self._rate[address] = rate
        self._known[address] = True

    def hub_times_us(self, rows: NDArray[np.void]) -> NDArray[np.float64]:
        """When the scans of taxel frames (dtype `ROW`) began: microseconds since the hub's start, by its clock."""
        if not len(rows):
            return np.zeros(0)
        address = rows["address"].astype(np.intp)  # numpy indexes ten times faster with its own index type
        since = (rows["board_time_us"] - self._board_0[address]).view(np.int32)
        mapped: NDArray[np.float64] = self._hub_0[address] + self._rate[address] * since
        read = self._unwrap(rows["hub_time_us"])
        self._hub_us = max(self._hub_us, int(read[-1]))
        age = read - mapped
        usable = self._known[address] & (age > -RESTART_US) & (age < AGE_MAX_US)
        return np.where(usable, mapped, read.astype(float))

    def _unwrap(self, hub_time_us: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Whole hub times near the latest one known, from times modulo 2^32."""
        near = np.uint32(self._hub_us % _WRAP)
        return self._hub_us + (hub_time_us - near).view(np.int32).astype(np.int64)

    def take_arrivals(
        self,
        taxels: NDArray[np.void],
        taxel_arrivals_s: NDArray[np.float64],
        syncs: NDArray[np.void],
        sync_hub_us: Sequence[int],
    ) -> None:
        """Learn from taxel and TIME_SYNC frames (dtype `ROW`), in order.

        `taxel_arrivals_s`: when the last byte of each taxel frame arrived, seconds. `sync_hub_us`: hub times of the
        TIME_SYNC frames. A frame goes onto the wire when the hub has read it. How long a board's read takes is the
        shortest time from its beginning to that of the next one: then the next transfer followed at once.
        """
        if not self._has_arrivals or not len(taxels) + len(syncs):
            return
        begun = self._unwrap(taxels["hub_time_us"])
        self._learn_read_times(taxels, begun, syncs, np.array(sync_hub_us, dtype=np.int64))
        if not len(taxels):
            return
        read_us = self._read_us[taxels["address"]]
        read_us[read_us == np.inf] = 0.0
        departed = begun + read_us + (taxels["length"] + float(WIRE_OVERHEAD)) * self._byte_us
        late = taxel_arrivals_s - departed * 1e-6
        bins = departed // BIN_US
        for start, end in pairwise([0, *(np.flatnonzero(bins[1:] != bins[:-1]) + 1).tolist(), len(taxels)]):
            earliest = start + int(np.argmin(late[start:end]))
            self._envelope.add(float(departed[earliest]), float(taxel_arrivals_s[earliest]))

    def _learn_read_times(
        self, taxels: NDArray[np.void], begun: NDArray[np.int64], syncs: NDArray[np.void], sync_us: NDArray[np.int64]
    ) -> None:
        sequence, times, address = taxels["sequence"], begun, taxels["address"]
        if len(syncs):
            order = np.argsort(np.concatenate([taxels["stream_position"], syncs["stream_position"]]), kind="stable")
            sequence = np.concatenate([sequence, syncs["sequence"]])[order]
            times = np.concatenate([times, sync_us])[order]
            address = np.concatenate([address, np.zeros(len(syncs), np.uint8)])[order]
        earlier = self._last_begun
        if earlier is not None:  # the pair may lie across two batches
            sequence = np.concatenate([earlier[0], sequence])
            times = np.concatenate([earlier[1], times])
            address = np.concatenate([earlier[2], address])
        self._last_begun = sequence[-1:], times[-1:], address[-1:]
        step = times[1:] - times[:-1]
        follows = (sequence[1:] - sequence[:-1] == 1) & (address[:-1] != 0) & (step > 0)  # u16: modulo 65536
        np.minimum.at(self._read_us, address[:-1][follows], step[follows])

    def host_times_s(self, hub_us: NDArray[np.float64]) -> NDArray[np.float64]:
        """The hub's microseconds on the host's clock, seconds."""
        line = self._envelope.line if self._has_arrivals else None
        if line is None:
            return hub_us * 1e-6
        x0, y0, slope = line
        return y0 + slope * (hub_us - x0)
