"""Sources of a twin: an open skin, or the contacts of a grasp dataset, as blocks of poll cycles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
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
"""Number of poll cycles in a block of a recording: large enough that the constant effort per block is negligible."""

LIVE_BLOCK: Final = 64
"""Largest number of poll cycles in a block of a live skin, 3 s at the usual rate: views show a frame at least once per
block, however far the processing is behind."""

DATASET_BLOCK: Final = 16
"""Number of poll cycles in a block of a dataset: less than a second, so that views show the course of a contact."""


class Block(NamedTuple):
    """T consecutive poll cycles of a skin with n taxels and s boards.

    time_s: f64[T], seconds. raw_counts: u16[T, n]. valid: bool[T, s], whether each board's frame arrived.
    """

    time_s: FloatArray
    raw_counts: CountArray
    valid: BoolArray


class Source(Protocol):
    """A stream of poll cycles."""

    @property
    def is_continuous(self) -> bool:
        """Whether an interval without frames is a fault of the input."""
        ...

    @property
    def is_live(self) -> bool:
        """Whether the stream runs in real time."""
        ...

    @property
    def session_starts_s(self) -> tuple[float, ...]:
        """Times at which a later session begins, seconds: the skin was mounted anew or has rested.

        No block extends over such a time.
        """
        ...

    def blocks(self) -> Iterator[Block]:
        """Yield the poll cycles in order of time."""
        ...

    def get_unique_ids(self) -> Mapping[int, bytes]:
        """Return the latest unique id of the processor of each board by its I2C address; empty if unknown."""
        ...


@dataclass(frozen=True, eq=False)
class SkinSource:
    """Poll cycles of an open skin."""

    skin: Skin
    is_continuous: bool = True
    session_starts_s: tuple[float, ...] = ()

    @property
    def is_live(self) -> bool:
        """Whether the skin delivers frames in real time; False for a recording."""
        return self.skin.link.is_real_time

    def blocks(self) -> Iterator[Block]:
        """Yield blocks of poll cycles.

        A block of a live skin contains the poll cycles that have arrived since the block before, usually one; more if
        the processing is behind, because the effort per block hardly depends on its length. A block of a recording has
        `RECORDED_BLOCK` poll cycles.
        """
        hand = self.skin.hand
        columns = np.array([hand.get_slice(board.address).start for board in hand.boards])
        for batch in self._read_live_batches() if self.is_live else self._read_recorded_batches():
            yield _to_block(batch, columns)

    def get_unique_ids(self) -> Mapping[int, bytes]:
        """Return the unique ids from the latest identities that the hub has sent; it sends one for each new board."""
        return {address: bytes(fields["identity_unique_id"]) for address, fields in self.skin.hub.boards.items()}

    def _read_live_batches(self) -> Iterator[list[SkinFrame]]:
        """Yield the poll cycles that have arrived, at most `LIVE_BLOCK` at a time, without end."""
        while True:
            batch: list[SkinFrame] = []
            timeout_s = 0.1
            while len(batch) < LIVE_BLOCK and (frames := self.skin.poll(timeout_s)):
                batch += self.skin.collect_scans(frames)
                timeout_s = 0.0
            for start in range(0, len(batch), LIVE_BLOCK):
                yield batch[start : start + LIVE_BLOCK]

    def _read_recorded_batches(self) -> Iterator[list[SkinFrame]]:
        """Yield all poll cycles of a recording, `RECORDED_BLOCK` at a time.

        A batch ends before the first poll cycle after the exchange of a board, so that the twin detects the exchange at
        the same poll cycle as with the live skin.
        """
        batch: list[SkinFrame] = []
        known_ids = self.get_unique_ids()
        for scan in self.skin.scans():
            unique_ids = self.get_unique_ids()
            if batch and (len(batch) == RECORDED_BLOCK or unique_ids != known_ids):
                yield batch
                batch = []
            known_ids = unique_ids
            batch.append(scan)
        if batch:
            yield batch

    def check(self, taxels: TaxelTable, sensors: SensorTable, name: str) -> None:
        """Raise TwinInputError unless the skin has the boards and taxels of a reference. name: path of the
        reference.
        """
        hand = self.skin.hand
        has_same_taxels = len(hand.sensor) == taxels.n and all(
            np.array_equal(of_skin, of_reference)
            for of_skin, of_reference in ((hand.sensor, taxels.sensor), (hand.tx, taxels.tx), (hand.rx, taxels.rx))
        )
        if not has_same_taxels or [board.address for board in hand.boards] != sensors.address.tolist():
            raise TwinInputError(
                f"{name}: /taxels",
                f"the {hand.n_taxels} taxels of hand '{hand.name}'",
                f"{taxels.n} taxels of other boards or lines",
                "use a reference of this skin, or select its description with --hand",
            )


@dataclass(frozen=True, eq=False)
class DatasetSource:
    """The contacts of a grasp dataset as one stream.

    A grasp keeps its recorded times, unless they overlap those of the grasp before: it is then moved behind that grasp.
    schedule: the contacts at the times of the stream. offsets: stream time minus recorded time of each grasp, seconds,
    by grasp identifier. session_starts_s: start of each session after the first on the clock of the stream, seconds.
    """

    path: Path
    schedule: ContactSchedule
    offsets: Mapping[str, float]
    session_starts_s: tuple[float, ...] = ()
    is_live: bool = False
    is_continuous: bool = False

    @classmethod
    def read(cls, path: str | PathLike[str]) -> DatasetSource:
        """Read the times of all contacts of a dataset. Raises DatasetError and TwinInputError."""
        schedule = ContactSchedule(name=str(path))
        offsets: dict[str, float] = {}
        end = -np.inf
        starts: list[float] = []
        session: int | None = None
        with GraspDataset(path) as data:
            for grasp in data:
                first = float(grasp.timestamp[0])
                # A grasp that begins before the end of the previous grasp is moved behind it, so that times increase.
                offset = offsets[grasp.id] = max(0.0, end - first)
                if session not in (None, grasp.session):
                    starts.append(first + offset)
                session = grasp.session
                contact = find_contact(grasp)
                one, two, three, four, last = (time + offset for time in contact.times_s)
                schedule.announce(Contact((one, two, three, four, last), contact.condition))
                end = last
        return cls(Path(path), schedule, offsets, tuple(starts))

    def get_unique_ids(self) -> Mapping[int, bytes]:
        """Return nothing: a dataset contains no unique ids."""
        return {}

    def blocks(self) -> Iterator[Block]:
        """Yield the frames of each grasp in blocks of at most `DATASET_BLOCK` poll cycles."""
        with GraspDataset(self.path) as data:
            for grasp in data:
                times = grasp.timestamp + self.offsets[grasp.id]
                for start in range(0, len(times), DATASET_BLOCK):
                    part = slice(start, start + DATASET_BLOCK)
                    yield Block(times[part], grasp.raw_counts[part], grasp.valid[part])


def _to_block(scans: Sequence[SkinFrame], columns: np.ndarray) -> Block:
    """Combine frames of the whole skin to a block. columns: i64[s], index of the first taxel of each board."""
    return Block(
        np.array([scan.time_s for scan in scans]),
        np.stack([scan.raw_counts for scan in scans]),
        np.stack([scan.valid[columns] for scan in scans]),
    )
