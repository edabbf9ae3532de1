"""Plan of the power cuts: each flash write of an update is cut at ten points; many sequences contain a second cut."""

import itertools
import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

WRITE_S: Final = 0.02
WORDS: Final = (0, 7, 19, 31)
"""Word indices at which a row write is cut: the first, the last and two between, of the 32 words of a row."""
ROWS: Final = (2, 3, 4, 6)
"""Image sizes in flash rows."""
SEQUENCES_PER_WORLD: Final = 40
"""Number of sequences in one world; each sequence starts with the flash content of the previous sequence."""

_HALF_WRITE_S = WRITE_S / 2
_WORD_S = _HALF_WRITE_S / 32
POINTS_S: Final = (
    0.0,
    *((word + 0.5) * _WORD_S for word in WORDS),
    *(_HALF_WRITE_S + (word + 0.5) * _WORD_S for word in WORDS),
    WRITE_S + 0.0004,
)
"""Cut times after the start of a write, in seconds: before the write, within words, and after the write."""

ROUTES: Final = {
    "board, through an adapter": 0.5,
    "board, through the hub": 0.12,
    "hub, over its UART": 0.18,
    "configuration, through an adapter": 0.1,
    "configuration, through the hub": 0.04,
    "configuration of a blank board": 0.06,
}
"""Written item and access path, with the share of all cuts."""


MOMENTS: Final = ("before", "erasing", "programming", "after")


def name_moment(after_s: float) -> str:
    """Return the phase of a flash write at `after_s` seconds after its start: before, erasing, programming or after."""
    if after_s == 0.0:
        return MOMENTS[0]
    if after_s >= WRITE_S:
        return MOMENTS[3]
    return MOMENTS[1] if after_s < _HALF_WRITE_S else MOMENTS[2]


@dataclass(frozen=True)
class Cut:
    """A power cut `after_s` seconds into a flash operation.

    `operation` counts the flash operations from 1, from the start of the update or from the previous cut.
    """

    operation: int
    after_s: float

    @property
    def moment(self) -> str:
        """Phase of the flash write in which the power is cut: before, erasing, programming or after."""
        return name_moment(self.after_s)

    @property
    def can_be_complete(self) -> bool:
        """Whether the interrupted record can be valid: it is complete, except possibly for the last word.

        No CRC covers that word.
        """
        return self.after_s > WRITE_S - _WORD_S


@dataclass(frozen=True)
class CutSequence:
    """An update and its power cuts. `rows`: rows of the image; 0: a configuration write."""

    rows: int
    cuts: tuple[Cut, ...]


@dataclass(frozen=True)
class WorldPlan:
    """The sequences of one world. `bootloader_listens`: bootloaders wait 100 ms for a host after power-up."""

    number: int
    seed: int
    route: str
    bootloader_listens: bool
    sequences: tuple[CutSequence, ...]


def plan_worlds(cuts: int, seed: int) -> list[WorldPlan]:
    """Plan emulated worlds whose sequences contain at least `cuts` power cuts in total.

    The same seed gives the same plan. In every third world the bootloaders wait for a host after power-up. A world of
    blank boards has four boards, so it has four sequences.
    """
    worlds: list[WorldPlan] = []
    for route, share in ROUTES.items():
        generator = random.Random(f"{seed} {route}")
        per_world = 4 if "blank" in route else SEQUENCES_PER_WORLD
        sequence_source = (
            _list_configuration_writes(generator) if route.startswith("configuration") else _update_sequences(generator)
        )
        remaining_cuts = round(cuts * share)
        while remaining_cuts > 0:
            sequences: list[CutSequence] = []
            while remaining_cuts > 0 and len(sequences) < per_world:
                sequences.append(next(sequence_source))
                remaining_cuts -= len(sequences[-1].cuts)
            number = len(worlds)
            worlds.append(WorldPlan(number, seed, route, number % 3 == 2, tuple(sequences)))
    return worlds


def _update_sequences(generator: random.Random) -> Iterator[CutSequence]:
    """Yield firmware updates without end in which the power is cut in every write at every point, in random order.

    When all combinations of image size, write and point have been planned, they repeat with other second cuts.
    """
    while True:
        # The writes of an update: the rows, then three records (pending image, boot attempt, confirmation).
        first_cuts = [(rows, Cut(n, after)) for rows in ROWS for n in range(1, rows + 4) for after in POINTS_S]
        generator.shuffle(first_cuts)
        for rows, first in first_cuts:
            yield CutSequence(rows, (first, *_sample_second_cut(generator, rows, first)))


def _sample_second_cut(generator: random.Random, rows: int, first: Cut) -> list[Cut]:
    """Return a random second power cut of an update, in one of the writes that must follow the first cut.

    These are the missing rows, the record of the pending image, the boot attempt and the confirmation. Returns [] if no
    write follows.
    """
    if first.operation <= rows:
        # The smallest number of later writes: the interrupted row may be complete.
        following = rows - first.operation + 3
    elif first.operation < rows + 3 or not first.can_be_complete:
        following = 2  # The boot attempt at the next start, and the confirmation.
    else:
        return []
    return [Cut(generator.randint(1, following), _sample_instant(generator))]


def _sample_instant(generator: random.Random) -> float:
    """Return a random time in seconds after the start of a flash write.

    It is before the write with a probability of 0.1, and after the write with the same probability.
    """
    fraction = generator.random()
    if fraction < 0.2:
        return POINTS_S[0] if fraction < 0.1 else POINTS_S[-1]
    return generator.uniform(1e-6, WRITE_S - 1e-6)


def _list_configuration_writes(generator: random.Random) -> Iterator[CutSequence]:
    """Yield configuration writes without end; the power is cut in each write at the next one of `POINTS_S`.

    A second cut follows if the write cannot be complete.
    """
    for after in itertools.cycle(POINTS_S):
        first = Cut(1, after)
        yield CutSequence(0, (first,) if first.can_be_complete else (first, Cut(1, _sample_instant(generator))))
