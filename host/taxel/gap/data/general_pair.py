"""Conversion of two datasets of any sensor into two datasets in equivalent counts for the comparison.

The comparison is defined in counts that contact lowers, with lines, positions, meshes and poses. A dataset of version 2
may lack any of these. `open_pair` infers phases and the direction of the values, checks that the two files agree, and
lists the data that remain missing, so that effects that need these data are unavailable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Final

import numpy as np

from taxel.gap.data.agreement import check_agreement
from taxel.gap.data.counts_dataset import convert_contacts, make_tables
from taxel.gap.data.missing_inputs import FORCES, GEOMETRY, LINES, LOSSES, MESHES, PHASES, POSES, REASONS
from taxel.gap.data.readable import ReadableDataset
from taxel.gap.errors import GapInputError
from taxel.hand.errors import format_path
from taxel.recording.general.dataset import GeneralDataset, read_version
from taxel.recording.general.format import Contact, Direction
from taxel.recording.general.values import HoldMeans, compute_hold_means, with_phases
from taxel.recording.grasp_dataset import GraspDataset

TYPICAL_COUNTS: Final = 1000.0
"""Equivalent counts of a strong signal: the typical signal of the project's own skin in a grasp, to which the
resolutions and tolerances of the comparison refer. A larger value makes these tolerances smaller relative to the
signals."""

LONG_STEP: Final = 3.0
"""Interval between two frames, in median frame periods, above which the interval is reported as a gap in time
(chosen)."""


@dataclass(frozen=True, eq=False)
class OpenedPair:
    """Two datasets that the comparison reads.

    Attributes:
        real, sim: the datasets.
        missing_inputs: optional data that the two datasets together lack, keys of `REASONS`; empty for version 1.
        notes: sentences for the report on inferred properties and on lost results.
        unit: unit of the values, and equivalent counts per unit; None for counts.
    """

    real: ReadableDataset
    sim: ReadableDataset
    missing_inputs: frozenset[str] = frozenset()
    notes: tuple[str, ...] = ()
    unit: tuple[str, float] | None = None

    def close(self) -> None:
        """Close both files."""
        self.real.close()
        self.sim.close()

    def __enter__(self) -> OpenedPair:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@dataclass(frozen=True, eq=False)
class _Side:
    """One of the two files: its contacts with phases, their means, and the inferred properties.

    direction: direction in which contact changes the values. has_phases, has_poses: True if the file contains phases,
    and poses, of all contacts. notes: sentences for the report.
    """

    data: GeneralDataset
    contacts: tuple[Contact, ...]
    means: HoldMeans
    direction: Direction
    has_phases: bool
    has_poses: bool
    notes: tuple[str, ...]


def open_pair(real: str | PathLike[str], sim: str | PathLike[str]) -> OpenedPair:
    """Return two opened datasets that the comparison can read.

    Two datasets of version 1 are opened without a conversion. If one dataset has version 2, both are converted into
    equivalent counts. Raises DatasetError for an invalid file, and GapInputError for two files that contradict each
    other, both with a one-line message.
    """
    if read_version(real) == 1 and read_version(sim) == 1:
        first = GraspDataset(real)
        try:
            return OpenedPair(first, GraspDataset(sim))
        except BaseException:
            first.close()
            raise
    with GeneralDataset(real) as real_data, GeneralDataset(sim) as sim_data:
        sides = [_read_side(real_data), _read_side(sim_data)]
        notes = [*sides[0].notes, *sides[1].notes]
        directions = sides[0].direction, sides[1].direction
        notes += check_agreement(real_data, sim_data, sides[0].means, sides[1].means, directions)
        scale = _compute_scale(real_data, sides)
        missing_inputs = _find_missing_inputs(sides)
        notes += [f"{REASONS[name]}: {cost}" for name, cost in LOSSES.items() if name in missing_inputs]
        unit = real_data.header.properties.unit or sim_data.header.properties.unit or "unit"
        if unit != "counts":
            notes.append(f"1 {unit} of the files counts as {scale:.4g} counts in this report")
        tables = make_tables(real_data, missing_inputs)
        converted = []
        for side in sides:
            sign = 1.0 if side.direction == Direction.LOWERS else -1.0
            converted.append(convert_contacts(side.data, side.contacts, sign * scale, tables))
    counts_per_unit = None if unit == "counts" else (unit, scale)
    return OpenedPair(converted[0], converted[1], missing_inputs, tuple(notes), counts_per_unit)


def _read_side(data: GeneralDataset) -> _Side:
    """Return the contacts, means and inferred properties of a file.

    Contacts without frames before or during the contact are omitted, which a note states. Raises GapInputError for a
    file without a usable contact, and for a declared direction that the values contradict.
    """
    read = list(data)
    contacts = tuple(one for one in map(with_phases, read) if one is not None)
    means = compute_hold_means(contacts)
    path = format_path(str(data.path))
    if not len(means.rest):
        remedy = "begin each recording at least ten frames before the contact, or state the phases"
        raise GapInputError(f"{path}: /grasps", "contacts with frames before and during contact", "none", remedy)
    inferred, declared = means.direction, data.header.properties.contact
    notes = []
    if data.is_vector:
        direction = Direction.SIGNED
    elif declared is None:
        direction = inferred
        predicate = _describe_direction(inferred)
        notes.append(f"{data.path}: contact {predicate} (inferred, because the file does not declare it)")
    else:
        direction = Direction(declared)
        opposite = {Direction.RAISES: Direction.LOWERS, Direction.LOWERS: Direction.RAISES}
        if opposite.get(direction) == inferred:
            remedy = "correct the attribute, or the sign of the values"
            expected = f'values as declared (contact = "{declared}")'
            raise GapInputError(f"{path}: contact", expected, f"values that contact {inferred.value[:-1]}s", remedy)
    unusable = len(data) - len(means.rest)
    if unusable:
        notes.append(f"{data.path}: {unusable} of {len(data)} contacts have no frames before or during contact")
    notes += _describe_times(data, contacts)
    has_phases = all(one.phase is not None for one in read)
    has_poses = all(one.sensor_pose is not None and one.object_pose is not None for one in read)
    return _Side(data, contacts, means, direction, has_phases, has_poses, tuple(notes))


def _describe_times(data: GeneralDataset, contacts: Sequence[Contact]) -> list[str]:
    """Return a sentence on the frame rate, and a second one if contacts have gaps in time."""
    steps = [np.diff(contact.time) for contact in contacts]
    rate = f"{data.path}: {1.0 / float(np.median(np.concatenate(steps))):.4g} frames per second"
    gaps = sum(bool((step > LONG_STEP * np.median(step)).any()) for step in steps)
    if not gaps:
        return [rate]
    return [rate, f"{data.path}: {gaps} of {len(contacts)} contacts have gaps in time, whose frames are missing"]


def _describe_direction(direction: Direction) -> str:
    """Return the direction as the predicate of a sentence whose subject is a contact."""
    return "changes the values in both directions" if direction == Direction.SIGNED else f"{direction.value} the values"


def _compute_scale(real: GeneralDataset, sides: list[_Side]) -> float:
    """Return the equivalent counts per unit: from a declared full scale, otherwise from the strong signals of both
    datasets.

    The scale is 1 if the real dataset has version 1 and the unit counts.
    """
    declared = real.header.properties.full_scale
    if real.header.properties.unit == "counts" and real.version == 1:
        return 1.0
    if declared is not None:
        return 2.0 * TYPICAL_COUNTS / declared  # a strong signal is assumed to be half of the full scale
    strong = [float(np.nanquantile(np.abs(side.means.change).max(axis=1), 0.5)) for side in sides]
    return TYPICAL_COUNTS / max(float(np.mean(strong)), 1e-300)


def _find_missing_inputs(sides: Sequence[_Side]) -> frozenset[str]:
    """Return the keys of the optional data that the real and the simulated file together lack."""
    real, sim = sides
    places = real.data.header.places
    missing = {
        FORCES: True,  # the datasets contain no force law of a general sensor
        LINES: places.tx is None,
        GEOMETRY: places.position is None,
        MESHES: not sim.data.header.objects,
        POSES: not (real.has_poses and sim.has_poses),
        PHASES: not (real.has_phases and sim.has_phases),
    }
    return frozenset(name for name, is_missing in missing.items() if is_missing)
