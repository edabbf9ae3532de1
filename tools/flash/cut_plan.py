"""Which writes are cut, and where: every flash operation of an update at ten points, then one of its mending too."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

WRITE_S: Final = 0.02
WORDS: Final = (0, 7, 19, 31)
"""Of the 32 words of a row: the first, the last and two between."""
ROWS: Final = (2, 3, 4, 6)
"""Sizes of the images, in flash rows."""
PER_WORLD: Final = 40
"""Sequences in one world; the next begins where the one before has left its board."""

_HALF = WRITE_S / 2
_WORD = _HALF / 32
POINTS_S: Final = (
    0.0,
    *((word + 0.5) * _WORD for word in WORDS),
    *(_HALF + (word + 0.5) * _WORD for word in WORDS),
    WRITE_S + 0.0004,
)
"""Seconds after the beginning of a write: before it, in words that are erased or programmed, after it."""

WAYS: Final = {
    "board, through an adapter": 0.5,
    "board, through the hub": 0.12,
    "hub, over its UART": 0.18,
    "configuration, through an adapter": 0.1,
    "configuration, through the hub": 0.04,
    "configuration of a blank board": 0.06,
}
"""What is written and how, with its share of all cuts."""


MOMENTS: Final = ("before", "erasing", "programming", "after")


def moment_of(after_s: float) -> str:
    """What a write does so long after its beginning."""
    if after_s == 0.0:
        return MOMENTS[0]
    if after_s >= WRITE_S:
        return MOMENTS[3]
    return MOMENTS[1] if after_s < _HALF else MOMENTS[2]


@dataclass(frozen=True)
class Cut:
    """The power fails `after_s` into a write: of the update the first is number 1, then counted from the cut before."""

    operation: int
    after_s: float

    @property
    def moment(self) -> str:
        """Before the write, while it erases or programs, or after it."""
        return moment_of(self.after_s)

    @property
    def may_be_whole(self) -> bool:
        """A record is written, or all but its last word, which no CRC covers."""
        return self.after_s > WRITE_S - _WORD


@dataclass(frozen=True)
class CutSequence:
    """An update with its cuts. `rows` of the image; 0: a configuration."""

    rows: int
    cuts: tuple[Cut, ...]


@dataclass(frozen=True)
class WorldPlan:
    """The sequences of one world. `listens`: bootloaders wait 100 ms for a host after power-up."""

    number: int
    seed: int
    way: str
    listens: bool
    sequences: tuple[CutSequence, ...]


def plan_worlds(cuts: int, seed: int) -> list[WorldPlan]:
    """Worlds whose sequences have at least `cuts` cuts together; the same for the same numbers."""
    worlds: list[WorldPlan] = []
    for way, share in WAYS.items():
        generator = random.Random(f"{seed} {way}")
        per_world = 4 if "blank" in way else PER_WORLD
        endless = _configurations(generator) if way.startswith("configuration") else _updates(generator)
        left = round(cuts * share)
        while left > 0:
            sequences: list[CutSequence] = []
            while left > 0 and len(sequences) < per_world:
                sequences.append(next(endless))
                left -= len(sequences[-1].cuts)
            number = len(worlds)
            worlds.append(WorldPlan(number, seed, way, number % 3 == 2, tuple(sequences)))
    return worlds


def _updates(generator: random.Random) -> Iterator[CutSequence]:
    """Every write of images of all sizes at every point, in a drawn order, again and again with other second cuts."""
    while True:
        firsts = [(rows, Cut(n, after)) for rows in ROWS for n in range(1, rows + 4) for after in POINTS_S]
        generator.shuffle(firsts)
        for rows, first in firsts:
            yield CutSequence(rows, (first, *_second(generator, rows, first)))


def _second(generator: random.Random, rows: int, first: Cut) -> list[Cut]:
    """A cut in one of the writes that surely follow: rows that are missing, pending, a try, the confirmation."""
    if first.operation <= rows:
        following = rows - first.operation + 3
    elif first.operation < rows + 3 or not first.may_be_whole:
        following = 2  # a try at the next start, and the confirmation
    else:
        return []
    return [Cut(generator.randint(1, following), _instant(generator))]


def _instant(generator: random.Random) -> float:
    """Any instant of a write; before or after it one time in ten each."""
    drawn = generator.random()
    if drawn < 0.2:
        return POINTS_S[0] if drawn < 0.1 else POINTS_S[-1]
    return generator.uniform(1e-6, WRITE_S - 1e-6)


def _configurations(generator: random.Random) -> Iterator[CutSequence]:
    """One write: before, at each point and after; then again, if it has not been made."""
    for after in itertools.cycle(POINTS_S):
        first = Cut(1, after)
        yield CutSequence(0, (first,) if first.may_be_whole else (first, Cut(1, _instant(generator))))
