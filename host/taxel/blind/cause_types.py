"""Types of causes: an effect of the emulator, and the random sampling of its parameters."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from taxel.blind.hidden import Cause
from taxel.hand import Hand
from taxel.hand.description import Board

Rng = np.random.Generator
SampleCause = Callable[[Rng, Hand, float], Cause]


@dataclass(frozen=True)
class CauseType:
    """Causes of one emulator effect.

    name: effect of the catalogue, or "unknown". emulator_effect: such as "spread film". sample: samples a cause with a
    strength from 0 to 1.
    """

    name: str
    emulator_effect: str
    sample: SampleCause


def log_interpolate(low: float, high: float, strength: float) -> float:
    """Value between `low` (strength 0) and `high` (strength 1) on a logarithmic scale, with 4 digits."""
    return float(f"{low * (high / low) ** strength:.4g}")


def log_uniform(rng: Rng, low: float, high: float) -> float:
    """Random value between `low` and `high`, uniform on a logarithmic scale."""
    return log_interpolate(low, high, float(rng.random()))


def format_board_argument(board: Board) -> str:
    """The argument of an effect line that selects a board."""
    return f"board=0x{board.address:02X}"


def _reachable_boards(hand: Hand) -> list[Board]:
    """Boards that indentations reach."""
    return [board for board in hand.boards if "back" not in board.kind.name]


def sample_boards(rng: Rng, hand: Hand, max_count: int = 1) -> list[Board]:
    """One to `max_count` random boards that indentations reach."""
    boards = _reachable_boards(hand)
    count = int(rng.integers(1, min(max_count, len(boards)) + 1))
    return [boards[index] for index in sorted(rng.choice(len(boards), count, replace=False).tolist())]


def taxels_of(hand: Hand, board: Board) -> list[int]:
    """Indices of a board's taxels in the hand."""
    return np.flatnonzero(hand.board_index == hand.boards.index(board)).tolist()


def make_whole_hand_cause(
    name: str,
    emulator_effect: str,
    low: float,
    high: float,
    arguments: Callable[[float, Rng], tuple[str, dict[str, float]]],
) -> CauseType:
    """A cause on the whole hand with one main parameter between `low` and `high`.

    arguments: gives the arguments of the effect line and the true parameters for a value of the main parameter.
    """

    def sample(rng: Rng, hand: Hand, strength: float) -> Cause:
        text, parameters = arguments(log_interpolate(low, high, strength), rng)
        return Cause(name, emulator_effect, (f"{emulator_effect} {text}",), (), parameters)

    return CauseType(name, emulator_effect, sample)
