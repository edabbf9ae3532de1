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

from taxel.stream.frames import HubMessage
from taxel_protocol import FrameType

SYNC_WINDOW = 32
"""Clock readings of one board that a fit uses: about half a minute."""

SYNC_TOLERANCE_US = 300.0
"""Clock readings of one board lie this close to a line, or one of them was damaged."""

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
            self._fit = self._touch(np.array([(x, y) for _, x, y in self._bins]))
            self._fitted_bin = self._bins[-1][0]
        return self._fit

    @staticmethod
    def _touch(points: NDArray[np.float64]) -> tuple[float, float, float]:
        x0, y0 = points[0]
        x, y = points[:, 0] - x0, points[:, 1] - y0
        hull: list[int] = []
        for i in range(len(points)):  # Andrew's monotone chain, lower half
            while len(hull) >= 2:
                a, b = hull[-2], hull[-1]
                if (x[b] - x[a]) * (y[i] - y[a]) - (y[b] - y[a]) * (x[i] - x[a]) > 0.0:
                    break
                hull.pop()
            hull.append(i)
        middle = 0.5 * (x[0] + x[-1])
        for a, b in pairwise(hull):
            if x[b] >= middle:
                slope = (y[b] - y[a]) / (x[b] - x[a])
                # Two points 50 ms apart, one of them late, would make a clock that no oscillator keeps.
                possible = float(np.clip(slope, (1.0 - RATE_TOLERANCE) * 1e-6, (1.0 + RATE_TOLERANCE) * 1e-6))
                if possible != slope:
                    a = int(np.argmin(y - possible * x))
                return float(x0 + x[a]), float(y0 + y[a]), possible
        return float(x0), float(y0), 1e-6


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
        self._last_begun: tuple[int, int, int] | None = None
        self._syncs: dict[int, deque[tuple[int, int]]] = {}
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
        if message.type is FrameType.HUB_STATUS or message.type is FrameType.HUB_HELLO:
            self._take_uptime(message.fields["uptime_us"])
        elif message.type is FrameType.TIME_SYNC:
            self._take_sync(message.fields["address"], message.fields["board_time_us"], message.fields["hub_time_us"])

    def _take_uptime(self, uptime_us: int) -> None:
        if uptime_us < self._hub_us - RESTART_US:  # the hub has started anew: so has its clock
            self._envelope = LowerEnvelope()
            self._last_begun = None
            self._syncs.clear()
            self._suspects.clear()
            self._known[:] = False
            self._hub_us = uptime_us
        self._hub_us = max(self._hub_us, uptime_us)

    def _take_sync(self, address: int, board_us: int, hub_us: int) -> None:
        self._hub_us = max(self._hub_us, hub_us)
        syncs = self._syncs.setdefault(address, deque(maxlen=SYNC_WINDOW))
        if syncs:
            step = (board_us - syncs[-1][0]) % _WRAP
            elapsed = hub_us - syncs[-1][1]
            if not _is_plausible(step, elapsed):
                self._suspect(address, board_us, hub_us)
                return
            board_us = syncs[-1][0] + step
        self._suspects.pop(address, None)
        syncs.append((board_us, hub_us))
        if len(syncs) >= 2:
            self._fit_board(address, np.array(syncs, dtype=np.int64))

    def _suspect(self, address: int, board_us: int, hub_us: int) -> None:
        # One reading that does not fit was damaged on the bus (it has no CRC); two that fit each other are a restart.
        earlier = self._suspects.get(address)
        self._suspects[address] = (board_us, hub_us)
        if earlier is not None and _is_plausible((board_us - earlier[0]) % _WRAP, hub_us - earlier[1]):
            self._syncs[address].clear()
            self._syncs[address].append(earlier)
            self._known[address] = False
            del self._suspects[address]
            self._take_sync(address, board_us, hub_us)

    def _fit_board(self, address: int, syncs: NDArray[np.int64]) -> None:
        board = (syncs[:, 0] - syncs[-1, 0]).astype(float)
        hub = (syncs[:, 1] - syncs[-1, 1]).astype(float)
        centred = board - board.mean()  # least squares in closed form: a hub with one board sends 60 readings a second
        spread = float(centred @ centred)
        if not spread:  # all readings of one microsecond: nothing to fit
            return
        slope = float(centred @ hub) / spread
        intercept = float(hub.mean()) - slope * float(board.mean())
        if np.abs(hub - intercept - slope * board).max() > SYNC_TOLERANCE_US:  # a low bit was damaged: outvote it
            from scipy.stats import theilslopes  # takes half a second to import, and is hardly ever needed

            slope, intercept, _, _ = theilslopes(hub, board)
        self._board_0[address] = syncs[-1, 0] % _WRAP
        self._hub_0[address] = syncs[-1, 1] + intercept
        self._rate[address] = slope
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
        read_us[np.isinf(read_us)] = 0.0
        departed = begun + read_us + (taxels["length"] + float(WIRE_OVERHEAD)) * self._byte_us
        late = taxel_arrivals_s - departed * 1e-6
        starts = np.flatnonzero(np.diff(departed // BIN_US, prepend=-1.0))
        for start, end in zip(starts.tolist(), [*starts[1:].tolist(), len(taxels)], strict=True):
            earliest = start + int(np.argmin(late[start:end]))
            self._envelope.add(float(departed[earliest]), float(taxel_arrivals_s[earliest]))

    def _learn_read_times(
        self, taxels: NDArray[np.void], begun: NDArray[np.int64], syncs: NDArray[np.void], sync_us: NDArray[np.int64]
    ) -> None:
        positions = np.concatenate([taxels["stream_position"], syncs["stream_position"]])
        order = np.argsort(positions, kind="stable")
        sequence = np.concatenate([taxels["sequence"], syncs["sequence"]]).astype(np.int64)[order]
        times = np.concatenate([begun, sync_us])[order]
        address = np.concatenate([taxels["address"], np.zeros(len(syncs), np.uint8)]).astype(np.intp)[order]
        if self._last_begun is not None:  # the pair may lie across two batches
            sequence, times, address = (
                np.r_[a, b] for a, b in zip(self._last_begun, (sequence, times, address), strict=True)
            )
        self._last_begun = (int(sequence[-1]), int(times[-1]), int(address[-1]))
        step = np.diff(times)
        follows = (np.diff(sequence) % 65536 == 1) & (address[:-1] != 0) & (step > 0)
        np.minimum.at(self._read_us, address[:-1][follows], step[follows].astype(float))

    def host_times_s(self, hub_us: NDArray[np.float64]) -> NDArray[np.float64]:
        """The hub's microseconds on the host's clock, seconds."""
        line = self._envelope.line if self._has_arrivals else None
        if line is None:
            return hub_us * 1e-6
        x0, y0, slope = line
        return y0 + slope * (hub_us - x0)
