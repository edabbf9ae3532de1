"""A cause in one of the emulator's forms, and how its parameters are drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from taxel.blind.hidden import Cause
from taxel.hand import Hand
from taxel.hand.description import Board

Rng = np.random.Generator
Draw = Callable[[Rng, Hand, float], Cause]


@dataclass(frozen=True)
class Form:
    """A cause in one of the emulator's forms. draw: with a strength from 0 to 1."""

    name: str
    form: str
    draw: Draw


def between(low: float, high: float, strength: float) -> float:
    """On a logarithmic scale."""
    return float(f"{low * (high / low) ** strength:.4g}")


def around(rng: Rng, low: float, high: float) -> float:
    """Drawn on a logarithmic scale."""
    return between(low, high, float(rng.random()))


def address_word(board: Board) -> str:
    """As lines of effects name a board."""
    return f"board=0x{board.address:02X}"


def _front(hand: Hand) -> list[Board]:
    """Boards that presses reach."""
    return [board for board in hand.boards if "back" not in board.kind.name]


def some_boards(rng: Rng, hand: Hand, most: int = 1) -> list[Board]:
    """From one to `most` of them."""
    boards = _front(hand)
    count = int(rng.integers(1, min(most, len(boards)) + 1))
    return [boards[index] for index in sorted(rng.choice(len(boards), count, replace=False).tolist())]


def taxels_of(hand: Hand, board: Board) -> list[int]:
    """Indices of a board's taxels in the hand."""
    return np.flatnonzero(hand.board_index == hand.boards.index(board)).tolist()


def simple(
    name: str, form: str, low: float, high: float, words: Callable[[float, Rng], tuple[str, dict[str, float]]]
) -> Form:
    """A cause of the whole hand with one main parameter. words: the rest of the line, and the truth."""

    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        line, truth = words(between(low, high, strength), rng)
        return Cause(name, form, (f"{form} {line}",), (), truth)

    return Form(name, form, draw)
