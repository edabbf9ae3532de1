"""Diagnosis of the branches of the wiring: boards of one branch that stop responding together."""

from collections.abc import Collection, Mapping
from typing import Final, NamedTuple

from taxel.hand.boards import Board
from taxel.hand.description import Hand
from taxel.hand.errors import format_address

TOGETHER_S: Final = 0.5
"""Largest difference between the last frames of the boards of a faulty branch, seconds.

A poll cycle of the default hand lasts 50 ms, and the hub retries a failed board. A larger value reports boards that
were unplugged one after the other as one fault; a smaller value misses a branch fault of a slowly polled hand.
"""

MAX_NAMED: Final = 3
"""Largest number of boards or branches that one line names."""


class SilentBoards(NamedTuple):
    """Silent boards of a hand: names of faulty branches, whose boards are all silent, and the other silent boards."""

    branches: tuple[str, ...]
    boards: tuple[Board, ...]


def find_silent_branches(
    hand: Hand, silent: Collection[int], last_s: Mapping[int, float] | None = None
) -> SilentBoards:
    """Divide the silent boards of a hand into branches of which every board is silent, and other boards.

    A branch with a single board is not reported, because a fault of the branch and of the board look equal.

    silent: I2C addresses of the boards from which no frames arrive. last_s: time of the last frame by address, seconds;
    boards of a branch whose last frames differ by more than `TOGETHER_S` did not stop together and are reported as
    single boards. Boards from which no frame has arrived are not in `last_s`.
    """
    branches = []
    for name in hand.branches:
        members = [board.address for board in hand.find_branch(name)]
        times = [last_s[address] for address in members if last_s is not None and address in last_s]
        is_together = not times or max(times) - min(times) <= TOGETHER_S
        if len(members) > 1 and all(address in silent for address in members) and is_together:
            branches.append(name)
    boards = tuple(board for board in hand.boards if board.address in silent and board.branch not in branches)
    return SilentBoards(tuple(branches), boards)


def format_silent_boards(hand: Hand, silent: SilentBoards) -> str:
    """Return one line that names the faulty branches and single silent boards, and what to check.

    If every branch of a hand is silent, the line names the shorts that stop the whole bus.
    """
    count = len(silent.boards) + sum(len(hand.find_branch(name)) for name in silent.branches)
    if count == len(hand.boards) and len(hand.branches) > 1:
        names = ", ".join(hand.branches)
        return (
            f"no board of any branch responds ({names}): check the cable between hub and branches; "
            "if it is intact, a short in one branch holds the bus: disconnect the branches one at a time"
        )
    parts = []
    if silent.branches:
        names = _join([_describe_branch(hand, name) for name in silent.branches])
        parts.append(f"branch fault: no response from {names}: check the cable and the connectors of the branch")
    if silent.boards:
        names = _join([f"{board.name} ({format_address(board.address)})" for board in silent.boards])
        parts.append(f"no response from {names}: check power and cable")
    return "; ".join(parts)


def _describe_branch(hand: Hand, name: str) -> str:
    """Return the name of a branch with its boards: "branch index (all 2 boards: 0x08, 0x1D)"."""
    boards = hand.find_branch(name)
    addresses = [format_address(board.address) for board in boards]
    return f"branch {name} (all {len(boards)} boards: {', '.join(addresses)})"


def _join(names: list[str]) -> str:
    """Join the first `MAX_NAMED` names with commas, and append the number of further names, such as " and 2 more"."""
    more = f" and {len(names) - MAX_NAMED} more" if len(names) > MAX_NAMED else ""
    return ", ".join(names[:MAX_NAMED]) + more
