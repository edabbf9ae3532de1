"""Numbers of a stream's frames, losses and bytes, as a table or as JSON."""

from collections import Counter
from typing import Any

from rich.console import Console
from rich.table import Table

from taxel.cli.gap_notices import format_gaps
from taxel.cli.signal_map import LargestSignals
from taxel.skin import Skin
from taxel.stream import TaxelFrame


class StreamSummary:
    """Counts the frames of an open skin."""

    def __init__(self, skin: Skin, has_map: bool = False) -> None:
        """Create a counter of the frames of a skin, by address of the board.

        skin: source of the loss counters. has_map: `print` shows the largest signals as a map.
        """
        self._skin = skin
        self._signals = LargestSignals(skin.hand) if has_map else None
        self._first: float | None = None
        self._last = 0.0
        self.frames: Counter[int] = Counter()

    def add(self, frame: TaxelFrame) -> None:
        """Count one frame of a board."""
        self.frames[frame.address] += 1
        if self._signals is not None:
            self._signals.add(frame)
        time_s = frame.time_s
        self._first = time_s if self._first is None else min(self._first, time_s)
        self._last = max(self._last, time_s)

    @property
    def seconds(self) -> float:
        """Time from the first frame to the last frame, seconds."""
        return 0.0 if self._first is None else self._last - self._first

    def as_dict(self) -> dict[str, Any]:
        """Return the counts of frames, losses and bytes as JSON values."""
        losses = self._skin.losses
        boards = []
        for board in self._skin.hand.boards:
            count = losses.boards.get(board.address)
            boards.append(
                {
                    "address": board.address,
                    "name": board.name,
                    "frames": self.frames[board.address],
                    "missing": count.missing if count else 0,
                    "damaged": count.damaged if count else 0,
                    "rate_hz": self.frames[board.address] / self.seconds if self.seconds > 0.0 else 0.0,
                }
            )
        return {
            "hand": self._skin.hand.name,
            "seconds": self.seconds,
            "frames_received": losses.frames_received,
            "frames_lost_on_wire": losses.lost_on_wire,
            "frames_unknown": losses.unknown_frames,
            "bytes_received": self._skin.bytes_received,
            "bytes_discarded": self._skin.bytes_discarded,
            "boards": boards,
        }

    def print(self, console: Console) -> None:
        """Print the counts of frames, losses and bytes as a table."""
        data = self.as_dict()
        table = Table(title=f"hand {data['hand']}, {data['seconds']:.2f} s")
        for heading in ("board", "address", "frames", "Hz", "missing", "damaged"):
            table.add_column(heading, justify="left" if heading == "board" else "right")
        for board in data["boards"]:
            table.add_row(
                board["name"], f"0x{board['address']:02X}", str(board["frames"]), f"{board['rate_hz']:.2f}",
                str(board["missing"]), str(board["damaged"]),
            )  # fmt: skip
        console.print(table)
        unknown = f", {data['frames_unknown']} unknown" if data["frames_unknown"] else ""
        console.print(
            f"frames: {data['frames_received']} received, {data['frames_lost_on_wire']} lost on the wire{unknown}; "
            f"bytes: {data['bytes_received']} received, {data['bytes_discarded']} discarded"
        )
        restarts = self._skin.losses.restarts
        if restarts:
            console.print(f"the hub restarted {restarts} time{'s' if restarts != 1 else ''}")
        reconnection = self._skin.reconnection
        if reconnection is not None and reconnection.gaps:
            console.print(format_gaps(reconnection.gaps), soft_wrap=True)
        if self._signals is not None:
            self._signals.print(console)
