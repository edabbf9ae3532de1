"""Sources of a twin: an open skin, or the contacts of a grasp dataset, as blocks of poll cycles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Final, NamedTuple, Protocol

import numpy as np

from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_tables import SensorTable, TaxelTable
from taxel.skin import Skin, SkinFrame
from taxel.twin.errors import TwinInputError
from taxel.twin.reference import find_contact
from taxel.twin.schedule import Contact, ContactSchedule
from taxel.types import BoolArray, CountArray, FloatArray

RECORDED_BLOCK: Final = 256
"""Poll cycles in a block of a recording: large enough that the work per block does not matter."""

DATASET_BLOCK: Final = 16
"""Poll cycles in a block of a dataset: less than a second, so that views show the course of a contact."""


class Block(NamedTuple):
    """Poll cycles. time_s: f64[T]. raw_counts: u16[T, n]. valid: bool[T, s], whether each board's frame arrived."""

    time_s: FloatArray
    raw_counts: CountArray
    valid: BoolArray


class Source(Protocol):
    """A stream of poll cycles."""

    @property
    def is_continuous(self) -> bool:
        """Whether an interval without frames is a fault."""
        ...

    @property
    def is_live(self) -> bool:
        """Whether the stream runs in real time."""
        ...

    def blocks(self) -> Iterator[Block]:
        """Yield the poll cycles in order of time."""
        ...


@dataclass(frozen=True, eq=False)
class SkinSource:
    """Poll cycles of an open skin."""

    skin: Skin
    is_continuous: bool = True

    @property
    def is_live(self) -> bool:
        """Whether the skin is no recording."""
        return self.skin.link.is_real_time

    def blocks(self) -> Iterator[Block]:
        """Yield blocks: each poll cycle of a live skin, or many of a recording at once."""
        hand = self.skin.hand
        columns = np.array([hand.get_slice(board.address).start for board in hand.boards])
        waiting: list[SkinFrame] = []
        for scan in self.skin.scans():
            waiting.append(scan)
            if self.is_live or len(waiting) >= RECORDED_BLOCK:
                yield _to_block(waiting, columns)
                waiting = []
        if waiting:
            yield _to_block(waiting, columns)

    def check(self, taxels: TaxelTable, sensors: SensorTable, name: str) -> None:
        """Raise TwinInputError unless the skin has the taxels of a reference. name: of the reference."""
        hand = self.skin.hand
        same = len(hand.sensor) == taxels.n and all(
            np.array_equal(own, other)
            for own, other in ((hand.sensor, taxels.sensor), (hand.tx, taxels.tx), (hand.rx, taxels.rx))
        )
        if not same or [board.address for board in hand.boards] != sensors.address.tolist():
            raise TwinInputError(
                f"{name}: /taxels",
                f"the {hand.n_taxels} taxels of hand '{hand.name}'",
                f"{taxels.n} taxels of other boards or lines",
                "use a reference of this skin, or select its description with --hand",
            )


@dataclass(frozen=True, eq=False)
class DatasetSource:
    """The contacts of a grasp dataset as one stream: each grasp follows the one before, at its own times.

    Grasps whose times overlap those of the grasp before are moved behind it.
    """

    path: Path
    schedule: ContactSchedule
    offsets: Mapping[str, float]
    is_live: bool = False
    is_continuous: bool = False

    @classmethod
    def read(cls, path: str | PathLike[str]) -> DatasetSource:
        """Read the times of all contacts. Raises DatasetError and TwinInputError."""
        schedule = ContactSchedule(name=str(path))
        offsets: dict[str, float] = {}
        end = -np.inf
        with GraspDataset(path) as data:
            for grasp in data:
                first = float(grasp.timestamp[0])
                offset = offsets[grasp.id] = max(0.0, end - first)
                contact = find_contact(grasp)
                one, two, three, four, last = (time + offset for time in contact.times_s)
                schedule.announce(Contact((one, two, three, four, last), contact.condition))
                end = last
        return cls(Path(path), schedule, offsets)

    def blocks(self) -> Iterator[Block]:
        """Yield the frames of each grasp."""
        with GraspDataset(self.path) as data:
            for grasp in data:
                times = grasp.timestamp + self.offsets[grasp.id]
                for start in range(0, len(times), DATASET_BLOCK):
                    part = slice(start, start + DATASET_BLOCK)
                    yield Block(times[part], grasp.raw_counts[part], grasp.valid[part])


def _to_block(scans: list[SkinFrame], columns: np.ndarray) -> Block:
    """Combine frames of the whole skin. columns: first taxel of each board."""
    return Block(
        np.array([scan.time_s for scan in scans]),
        np.stack([scan.raw_counts for scan in scans]),
        np.stack([scan.valid[columns] for scan in scans]),
    )
