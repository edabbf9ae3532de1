"""Types of causes: an effect of the emulator, and the random sampling of its parameters."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from taxel.blind.hidden import Cause
from taxel.hand import Hand
from taxel.hand.boards import Board

Rng = np.random.Generator
SampleCause = Callable[[Rng, Hand, float], Cause]


@dataclass(frozen=True)
class CauseType:
    """Type of hidden causes that use one effect of the emulator.

    name: effect of the catalogue, or "unknown". emulator_effect: effect and variant in the emulator, such as "spread
    film". sample: function that samples a cause from random numbers, the hand and a strength from 0 to 1.
    """

    name: str
    emulator_effect: str
    sample: SampleCause


def log_interpolate(low: float, high: float, strength: float) -> float:
    """Interpolate on a logarithmic scale between `low` (strength 0) and `high` (strength 1); rounded to 4 digits."""
    return float(f"{low * (high / low) ** strength:.4g}")


def log_uniform(rng: Rng, low: float, high: float) -> float:
    """Sample a random value between `low` and `high`, uniform on a logarithmic scale."""
    return log_interpolate(low, high, float(rng.random()))


def format_board_argument(board: Board) -> str:
    """Format the argument of an effect line that selects a board by its I2C address, such as "board=0x41"."""
    return f"board=0x{board.address:02X}"


def _list_reachable_boards(hand: Hand) -> list[Board]:
    """List the boards of a hand that indentations reach: all boards except those on the back of the hand."""
    return [board for board in hand.boards if "back" not in board.kind.name]


def count_half_of_boards(hand: Hand) -> int:
    """Return half of the number of boards that indentations reach, at least 1."""
    return max(len(_list_reachable_boards(hand)) // 2, 1)


def sample_boards(rng: Rng, hand: Hand, max_count: int = 1) -> list[Board]:
    """Sample one to `max_count` different boards of the hand, among the boards that indentations reach."""
    boards = _list_reachable_boards(hand)
    count = int(rng.integers(1, min(max_count, len(boards)) + 1))
    return [boards[index] for index in sorted(rng.choice(len(boards), count, replace=False).tolist())]


def taxels_of(hand: Hand, board: Board) -> list[int]:
    """List the indices of a board's taxels in the arrays of the whole hand."""
    return np.flatnonzero(hand.board_index == hand.boards.index(board)).tolist()


def make_whole_hand_cause(
    name: str,
    emulator_effect: str,
    low: float,
    high: float,
    arguments: Callable[[float, Rng], tuple[str, dict[str, float]]],
) -> CauseType:
    """Make a cause type that acts on the whole hand and has one main parameter.

    low, high: values of the main parameter at strength 0 and at strength 1. arguments: function that returns the
    arguments of the effect line and the true parameters for a value of the main parameter.
    """

    def sample(rng: Rng, hand: Hand, strength: float) -> Cause:
        """Sample a cause on the whole hand. strength: 0 to 1, converted to the main parameter."""
        text, parameters = arguments(log_interpolate(low, high, strength), rng)
        return Cause(name, emulator_effect, (f"{emulator_effect} {text}",), (), parameters)

    return CauseType(name, emulator_effect, sample)
