"""What was lost, where, and how that is known."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from taxel_protocol import FrameType

_MODULUS = 1 << 16


@dataclass
class BoardCount:
    """One board's frames: `received`, and `missing` from poll cycles that brought frames before and after."""

    received: int = 0
    missing: int = 0
    damaged: int = 0
    last_cycle: int | None = None


@dataclass
class LossAccount:
    """Frames and bytes of one stream.

    Every frame that the hub puts onto the wire carries the next of 65,536 sequence numbers, so `lost_on_wire` is exact for
    losses shorter than that; a board's frame also carries its poll cycle, so `boards[address].missing` counts every frame
    that did not arrive, whatever the reason. sent = `received` + `lost_on_wire`.
    """

    received: int = 0
    lost_on_wire: int = 0
    restarts: int = 0
    boards: dict[int, BoardCount] = field(default_factory=dict)
    _next_sequence: int | None = None

    def update(self, rows: NDArray[np.void]) -> None:
        """Count a batch of frames (dtype `ROW`), in order."""
        if not len(rows):
            return
        self.received += len(rows)
        self._count_sequences(rows)
        taxels = rows[rows["type"] == FrameType.TAXELS]
        for address in np.unique(taxels["address"]).tolist():
            board = self.boards.setdefault(address, BoardCount())
            self._count_cycles(board, taxels[taxels["address"] == address])

    def _count_sequences(self, rows: NDArray[np.void]) -> None:
        sequences = rows["sequence"].astype(np.int64)
        # A hub that has just started begins again at 0 with a greeting: that is a restart, not a loss.
        restarted = (rows["type"] == FrameType.HUB_HELLO) & (sequences == 0)
        first = sequences[0] if self._next_sequence is None else self._next_sequence
        expected = np.concatenate([[first], (sequences[:-1] + 1) % _MODULUS])
        gaps = (sequences - expected) % _MODULUS
        gaps[restarted] = 0
        if self._next_sequence is not None or self.received > len(rows):
            self.restarts += int(restarted.sum())
        self.lost_on_wire += int(gaps.sum())
        self._next_sequence = int((sequences[-1] + 1) % _MODULUS)
        if restarted.any():
            for board in self.boards.values():
                board.last_cycle = None

    @staticmethod
    def _count_cycles(board: BoardCount, rows: NDArray[np.void]) -> None:
        cycles = rows["cycle"].astype(np.int64)
        previous = cycles[0] - 1 if board.last_cycle is None else board.last_cycle
        steps = np.diff(cycles, prepend=previous) % _MODULUS
        board.received += len(rows)
        board.missing += int(np.maximum(steps - 1, 0).sum())
        board.last_cycle = int(cycles[-1])

    @property
    def frames_sent(self) -> int:
        """Frames that the hub has put onto the wire since the first one that arrived."""
        return self.received + self.lost_on_wire
