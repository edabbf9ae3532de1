"""Several ports as one skin: board frames of all ports, merged scans, and losses of each port."""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from types import TracebackType
from typing import Final, Self

import numpy as np

from taxel.errors import TaxelError
from taxel.signal import BASELINE_SAMPLES, BaselineResult
from taxel.skin.baseline import measure_baseline
from taxel.skin.frame import SkinFrame
from taxel.skin.skin import Skin
from taxel.stream import LossAccount, TaxelFrame

SLICE_S: Final = 0.005
"""Longest wait for one port before the next port, seconds. A longer time delays the frames of the other ports, a
shorter one costs processor time; the time between two frames of a port is 1 to 20 ms."""

SILENT_S: Final = 0.5
"""Time after which a port without scans no longer delays merged scans, seconds. The slowest bus, 17 boards at 100 kHz,
needs 0.2 s for a scan. A longer time delays the scans of the other ports after a port has failed."""


class DuplicateBoardError(TaxelError):
    """The board of one address answers on two ports."""


class MultiSkin:
    """The boards of several ports as one skin: an iterator over the frames of all boards (`TaxelFrame`).

    The times of all frames are those of the host's clock, to which each port maps the clocks of its boards. Frames of
    one port are in the order of their arrival. Use the skin as a context manager. `skins`: the skin of each port, by
    the name of the port, its URL.
    """

    def __init__(self, skins: Mapping[str, Skin]) -> None:
        """Combine open skins of the same hand, which this object then closes; skins: by the names of their ports.

        Raises `DuplicateBoardError` if a board answers on two ports, `TaxelError` for a recording. All skins are closed
        after an error.
        """
        self.skins = dict(skins)
        self.hand = next(iter(skins.values())).hand
        self._ports: dict[int, str] = {}
        self._scans: dict[str, SkinFrame] = {}
        self._latest_s: dict[str, float] = {}
        self._cycle = 0
        try:
            for name, skin in skins.items():
                self._add_port(name, skin)
        except BaseException:
            self.close()
            raise

    def _add_port(self, name: str, skin: Skin) -> None:
        """Assign the boards that a port has found to this port.

        Raises `TaxelError` for a recording, and `DuplicateBoardError` for a board that another port has found.
        """
        if skin.link.is_recorded:
            raise TaxelError(f"{name}: is a recording; several ports of one skin must be live")
        for address in skin.hub.boards:
            self._check_owner(address, name)
        skin.expect_boards(len(skin.hub.boards))

    def _check_owner(self, address: int, name: str) -> None:
        """Assign a board to port `name`; raise `DuplicateBoardError` if it belongs to another port."""
        owner = self._ports.setdefault(address, name)
        if owner != name:
            board = self.hand.get_board(address).name
            raise DuplicateBoardError(
                f"board 0x{address:02X} ({board}) answers on {owner} and on {name}; disconnect it from one of them"
            )

    @property
    def missing_boards(self) -> list[str]:
        """Names of the hand's boards that no port has found."""
        return [board.name for board in self.hand.boards if board.address not in self._ports]

    @property
    def losses(self) -> dict[str, LossAccount]:
        """Counts of frames received, missing and lost of each port, by the port's name."""
        return {name: skin.losses for name, skin in self.skins.items()}

    @property
    def bytes_received(self) -> int:
        """Number of bytes that have arrived on all ports since the skin was opened."""
        return sum(skin.bytes_received for skin in self.skins.values())

    @property
    def bytes_discarded(self) -> int:
        """Number of bytes of all ports that belonged to no valid frame."""
        return sum(skin.bytes_discarded for skin in self.skins.values())

    @property
    def bytes_waiting(self) -> int:
        """Number of bytes that have arrived and are not decoded yet. The number grows if the reader is too slow."""
        return sum(skin.bytes_waiting for skin in self.skins.values())

    def get_port(self, address: int) -> str | None:
        """Return the name of the port of a board; None if no port has found the board."""
        return self._ports.get(address)

    def is_synchronised(self, address: int) -> bool:
        """True if the times of a board's frames come from the board's own clock (see `taxel.stream.ClockMap`)."""
        port = self.get_port(address)
        return port is not None and self.skins[port].is_synchronised(address)

    def poll(self, timeout_s: float = 0.1) -> list[TaxelFrame]:
        """Return all board frames that have arrived; an empty list if there are none within about `timeout_s` seconds.

        Raises the errors of the iteration.
        """
        return [frame for frames in self._poll_ports(timeout_s).values() for frame in frames]

    def _poll_ports(self, timeout_s: float) -> dict[str, list[TaxelFrame]]:
        """Return the frames that have arrived, by port name; ports without frames are omitted.

        Waits up to about `timeout_s` seconds for the first frame.
        """
        arrived = self._take(0.0)
        waited_s = 0.0
        while not arrived and waited_s < timeout_s:
            arrived = self._take(SLICE_S)
            waited_s += SLICE_S * len(self.skins)
        return arrived

    def _take(self, timeout_s: float) -> dict[str, list[TaxelFrame]]:
        """Take the frames of each port that has any, by port name, after a wait of at most `timeout_s` for each port.

        Raises `DuplicateBoardError` for a frame of a board that belongs to another port.
        """
        arrived = {}
        for name, skin in self.skins.items():
            if frames := skin.poll(timeout_s):
                for frame in frames:
                    self._check_owner(frame.address, name)
                arrived[name] = frames
        return arrived

    def __iter__(self) -> Iterator[TaxelFrame]:
        """Yield the taxel frames of all boards without end."""
        while True:
            yield from self.poll()

    def scans(self) -> Iterator[SkinFrame]:
        """Iterate over frames of the whole skin, merged from the scans of all ports.

        Ports poll their boards independently. A merged scan contains the latest scan of every port, and is complete as
        soon as every port has a new one: the slowest port determines the rate, and a faster port is represented by its
        latest scan. A port without a scan for `SILENT_S` is left out; its taxels are then not valid. `cycle` counts the
        merged scans modulo 65536; `time_s` is the start of the earliest of the merged scans.
        """
        while True:
            for name, frames in self._poll_ports(0.1).items():
                for scan in self.skins[name].collect_scans(frames):
                    self._scans[name] = scan
                    self._latest_s[name] = scan.time_s
            if self._scans and self._list_required_ports() <= self._scans.keys():
                yield self._merge_scans()

    def _list_required_ports(self) -> set[str]:
        """Return the names of the ports whose scan is required for the next merged scan.

        These are the ports whose latest scan is at most `SILENT_S` older than the newest scan of any port.
        """
        newest_s = max(self._latest_s.values())
        return {name for name in self.skins if newest_s - self._latest_s.setdefault(name, newest_s) <= SILENT_S}

    def _merge_scans(self) -> SkinFrame:
        """Combine the waiting scans of the ports into one frame of the whole skin, and remove them."""
        counts = np.zeros(self.hand.n_taxels, dtype=np.uint16)
        valid = np.zeros(self.hand.n_taxels, dtype=bool)
        for scan in self._scans.values():
            counts[scan.valid] = scan.raw_counts[scan.valid]
            valid |= scan.valid
        merged = SkinFrame(self._cycle, min(scan.time_s for scan in self._scans.values()), counts, valid)
        self._scans.clear()
        self._cycle = (self._cycle + 1) % 65536
        return merged

    def take_baseline(
        self, samples: int = BASELINE_SAMPLES, progress: Callable[[float], None] | None = None
    ) -> BaselineResult:
        """Measure the baseline over the next `samples` frames of all responding boards, as `Skin.take_baseline`."""
        return measure_baseline(self.hand.n_taxels, self.scans(), samples, progress, ", ".join(self.skins))

    def close(self) -> None:
        """Stop the streams of all ports and close their links, also after an error of one of the ports."""
        with contextlib.ExitStack() as stack:
            for skin in self.skins.values():
                stack.callback(skin.close)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the skin and its links at the end of the `with` block."""
        self.close()
