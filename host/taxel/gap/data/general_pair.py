"""Two datasets of any sensor as two datasets of signals in equivalent counts, which the comparison reads.

The comparison is defined in counts that contact lowers, with lines, positions, meshes and poses. A dataset of version 2
may lack any of these. `open_pair` infers what is missing, checks that the two files agree, and states what is lacking,
so that effects that need it are unavailable.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Final

import numpy as np

from taxel.gap.data.agreement import check_agreement
from taxel.gap.data.readable import ReadableDataset
from taxel.gap.errors import GapInputError
from taxel.hand.errors import format_path
from taxel.recording.general.dataset import GeneralDataset, read_version
from taxel.recording.general.format import AXES, Contact, Direction, TaxelPlaces
from taxel.recording.general.values import HoldMeans, compute_hold_means, get_phases
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.types import BoolArray, ByteArray, FloatArray, IntArray

TYPICAL_COUNTS: Final = 1000.0
"""Equivalent counts of a strong signal: those of the project's own skin in a grasp, for which the resolutions and
tolerances of the comparison are stated."""

STRONG_QUANTILE: Final = 0.98
"""Quantile of the absolute signals of a dataset that counts as a strong signal; 1 would be a single value."""

BASELINE_COUNTS: Final = 30_000.0
"""Equivalent count without contact. Only differences from it are used."""

APART_M: Final = 1.0
"""Distance of taxels without known positions, beyond the reach of every effect."""

AXIS_NAMES: Final = ("x", "y", "z")

LINES, GEOMETRY, MESHES, POSES, FORCES, PHASES = "lines", "geometry", "meshes", "poses", "forces", "phases"

REASONS: Final[Mapping[str, str]] = {
    LINES: "the datasets have no electrode lines (tx, rx)",
    GEOMETRY: "the datasets have no positions of the taxels",
    MESHES: "the datasets have no meshes of the objects",
    POSES: "the datasets have no poses",
    FORCES: "the simulation has no contact force",
    PHASES: "the datasets do not state the phases",
}
"""What a dataset may lack, as the reason for which an effect is unavailable."""

LOSSES: Final[Mapping[str, str]] = {
    LINES: "effects of electrode lines are unavailable, and a gap is not located on lines",
    GEOMETRY: "a spread to neighbouring taxels is unavailable",
    MESHES: "displaced objects are unavailable",
    POSES: "displaced objects and the gap in millimetres are unavailable",
    PHASES: "the phases are detected from the values, so that a delay of the whole sensor is not observable",
}
"""Cost of what is lacking; the reader of the pair states that of forces."""


@dataclass(eq=False)
class CountsGrasp:
    """One contact in equivalent counts (`taxel.gap.data.readable.ReadableGrasp`)."""

    id: str
    object: str
    approach: str
    iteration: int
    session: int
    timestamp: FloatArray
    phase: ByteArray
    raw_counts: FloatArray
    valid: BoolArray
    sensor_pose: FloatArray
    object_pose: FloatArray
    contact_force: FloatArray | None = None
    separation: FloatArray | None = None


@dataclass(eq=False)
class CountsDataset:
    """A dataset in equivalent counts (`taxel.gap.data.readable.ReadableDataset`)."""

    path: Path
    source: str
    taxels: TaxelTable
    sensors: SensorTable
    objects: Mapping[str, ObjectMesh]
    grasps: tuple[CountsGrasp, ...]
    sensor_model: SensorModel | None = None

    def __iter__(self) -> Iterator[CountsGrasp]:
        return iter(self.grasps)

    def __len__(self) -> int:
        return len(self.grasps)

    def close(self) -> None:
        """Do nothing: no file is open."""


@dataclass(frozen=True, eq=False)
class OpenedPair:
    """Two datasets that the comparison reads.

    Attributes:
        real, sim: the datasets. lacking: what both together lack, by the keys of `REASONS`; empty for version 1.
        notes: sentences for the report on what was inferred and what is lost.
        unit: unit of the values, and equivalent counts per unit; None for counts.
    """

    real: ReadableDataset
    sim: ReadableDataset
    lacking: frozenset[str] = frozenset()
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
    """One file: its dataset, and means of its contacts."""

    data: GeneralDataset
    means: HoldMeans
    direction: Direction
    notes: list[str] = field(default_factory=list)


def open_pair(real: str | PathLike[str], sim: str | PathLike[str]) -> OpenedPair:
    """Open two datasets. Raises DatasetError and GapInputError with one line.

    Two datasets of version 1 are opened as they are. If one has version 2, both are converted.
    """
    if read_version(real) == 1 and read_version(sim) == 1:
        first = GraspDataset(real)
        try:
            return OpenedPair(first, GraspDataset(sim))
        except BaseException:
            first.close()
            raise
    with GeneralDataset(real) as own, GeneralDataset(sim) as other:
        sides = [_read_side(own), _read_side(other)]
        notes = [*sides[0].notes, *sides[1].notes]
        notes += check_agreement(own, other, sides[0].means, sides[1].means, (sides[0].direction, sides[1].direction))
        scale = _find_scale(own, sides)
        lacking = _find_lacking(own, other)
        notes += [f"{REASONS[name]}: {cost}" for name, cost in LOSSES.items() if name in lacking]
        unit = own.header.properties.unit or other.header.properties.unit or "unit"
        if unit != "counts":
            notes.append(f"1 {unit} of the files counts as {scale:.4g} counts in this report")
        tables = _make_tables(own, lacking)
        made = [_convert(side, scale, tables, notes) for side in sides]
    return OpenedPair(made[0], made[1], lacking, tuple(notes), None if unit == "counts" else (unit, scale))


def _read_side(data: GeneralDataset) -> _Side:
    """Means and direction of a file. Raises GapInputError for a declared direction that the values contradict."""
    means = compute_hold_means(data)
    path = format_path(str(data.path))
    if not len(means.rest):
        remedy = "begin each recording at least ten frames before the contact, or state the phases"
        raise GapInputError(f"{path}: /grasps", "contacts with frames before and during contact", "none", remedy)
    found, declared = means.direction, data.header.properties.contact
    notes = []
    if data.is_vector:
        direction = Direction.SIGNED
    elif declared is None:
        direction = found
        notes.append(f"{data.path}: contact {_describe(found)} (inferred, because the file does not declare it)")
    else:
        direction = Direction(declared)
        opposite = {Direction.RAISES: Direction.LOWERS, Direction.LOWERS: Direction.RAISES}
        if opposite.get(direction) == found:
            remedy = "correct the attribute, or the sign of the values"
            expected = f'values as declared (contact = "{declared}")'
            raise GapInputError(f"{path}: contact", expected, f"values that contact {found.value[:-1]}s", remedy)
    left_out = len(data) - len(means.rest)
    if left_out:
        notes.append(f"{data.path}: {left_out} of {len(data)} contacts have no frames before or during contact")
    return _Side(data, means, direction, notes)


def _describe(direction: Direction) -> str:
    """The direction as the end of a sentence on a contact."""
    return "changes the values in both directions" if direction == Direction.SIGNED else f"{direction.value} the values"


def _find_scale(own: GeneralDataset, sides: list[_Side]) -> float:
    """Equivalent counts per unit: from a declared full scale, or from the strong signals of both datasets."""
    declared = own.header.properties.full_scale
    if own.header.properties.unit == "counts" and own.version == 1:
        return 1.0
    if declared is not None:
        return 2.0 * TYPICAL_COUNTS / declared
    strong = [float(np.nanquantile(np.abs(side.means.change).max(axis=1), 0.5)) for side in sides]
    return TYPICAL_COUNTS / max(float(np.mean(strong)), 1e-300)


def _find_lacking(own: GeneralDataset, other: GeneralDataset) -> frozenset[str]:
    """What the two files together lack."""
    places = own.header.places
    lacking = {FORCES}  # a force law of a general sensor is not known
    if places.tx is None:
        lacking.add(LINES)
    if places.position is None:
        lacking.add(GEOMETRY)
    if not other.header.objects:
        lacking.add(MESHES)
    first = [next(iter(data)) for data in (own, other)]
    if any(one.sensor_pose is None or one.object_pose is None for one in first):
        lacking.add(POSES)
    if any(one.phase is None for one in first):
        lacking.add(PHASES)
    return frozenset(lacking)


def _make_tables(own: GeneralDataset, lacking: frozenset[str]) -> tuple[TaxelTable, SensorTable, IntArray]:
    """Tables of the real file, and the component of each taxel i64[n]; a component of a vector taxel is a taxel of a
    sensor of its own, so that only equal components are neighbours.
    """
    places, n = own.header.places, own.n
    axes = AXES if own.is_vector else 1
    sensor = np.zeros(n, np.int64) if places.sensor is None else np.unique(places.sensor, return_inverse=True)[1]
    numbers = np.repeat(sensor * axes, axes) + np.tile(np.arange(axes), n)
    tx, rx = _make_lines(places, sensor)
    position = np.zeros((n, 3)) if places.position is None else places.position
    if GEOMETRY in lacking:
        position = np.column_stack([np.arange(n) * APART_M, np.zeros((n, 2))])
    normal = np.tile([0.0, 0.0, 1.0], (n, 1)) if places.normal is None else places.normal
    size = np.full(n, _find_pitch(position)) if places.size is None else places.size
    table = TaxelTable(
        numbers.astype(np.uint8),
        np.repeat(tx, axes).astype(np.uint8),
        np.repeat(rx, axes).astype(np.uint8),
        np.repeat(position, axes, axis=0),
        np.repeat(normal, axes, axis=0),
        np.repeat(size, axes),
    )
    address = np.arange(int(numbers.max()) + 1)
    if len(address) > 256:
        path = format_path(str(own.path))
        remedy = "give fewer sensors, or combine them in /taxels/sensor"
        raise GapInputError(f"{path}: /taxels/sensor", f"at most {256 // axes} sensors", str(len(address)), remedy)
    kinds = own.header.sensor_names or tuple(f"sensor {k}" for k in range(int(sensor.max()) + 1))
    names = [f"{kinds[k // axes]}{'' if axes == 1 else ' ' + AXIS_NAMES[k % axes]}" for k in address]
    rate = np.full(len(address), 1.0)
    return table, SensorTable(address.astype(np.uint8), tuple(names), tuple(names), rate), numbers


def _make_lines(places: TaxelPlaces, sensor: IntArray) -> tuple[IntArray, IntArray]:
    """Electrode lines; without known lines a square arrangement in the order of the taxels, for pictures only."""
    if places.tx is not None and places.rx is not None:
        return places.tx, places.rx
    tx, rx = np.zeros_like(sensor), np.zeros_like(sensor)
    for number in np.unique(sensor):
        own = np.flatnonzero(sensor == number)
        width = max(int(np.ceil(np.sqrt(len(own)))), 1)
        tx[own], rx[own] = np.divmod(np.arange(len(own)), width)
    return tx, rx


def _find_pitch(position: FloatArray) -> float:
    """Median distance of a taxel to the nearest other one, metres."""
    if len(position) < 2:
        return APART_M
    apart = np.linalg.norm(position[:, None] - position, axis=2)
    np.fill_diagonal(apart, np.inf)
    nearest = apart.min(axis=1)
    return float(np.median(nearest[np.isfinite(nearest)])) or APART_M


def _convert(
    side: _Side, scale: float, tables: tuple[TaxelTable, SensorTable, IntArray], notes: list[str]
) -> CountsDataset:
    """A file in equivalent counts."""
    taxels, sensors, numbers = tables
    sign = 1.0 if side.direction == Direction.LOWERS else -1.0
    index = numbers.astype(np.intp)
    grasps, steps, gaps = [], [], 0
    for contact in side.data:
        phase = get_phases(contact)
        if phase is None:
            continue
        own = np.diff(contact.time)
        steps.append(float(np.median(own)))
        gaps += int((own > LONG_STEP * np.median(own)).any())
        grasps.append(_convert_contact(contact, phase, sign * scale, (index, sensors.s)))
    if gaps:
        notes.append(f"{side.data.path}: {gaps} of {len(grasps)} contacts have gaps in time, whose frames are missing")
    notes.append(f"{side.data.path}: {1.0 / float(np.median(steps)):.4g} frames per second")
    names = {one.object for one in grasps}
    objects = {name: side.data.header.objects.get(name, _PLACEHOLDER) for name in names}
    return CountsDataset(side.data.path, side.data.header.source, taxels, sensors, objects, tuple(grasps))


LONG_STEP: Final = 3.0
"""Median frame periods from which an interval between two frames is a gap in time."""

_PLACEHOLDER: Final = ObjectMesh(
    np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0], [0.0, 0.0, 1e-3]]),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32),
)
"""Mesh of an object without a mesh; effects that need a mesh are then unavailable."""


def _convert_contact(contact: Contact, phase: ByteArray, factor: float, index: tuple[IntArray, int]) -> CountsGrasp:
    """One contact in equivalent counts that contact lowers."""
    column, sensors = index
    values = contact.values.reshape(len(contact.values), -1)
    missing = np.isnan(values) | contact.is_missing()[:, None]
    rest = np.nanmedian(np.where(missing, np.nan, values)[phase == 0], axis=0)
    counts = BASELINE_COUNTS + factor * (values - np.nan_to_num(rest))
    valid = np.ones((len(values), sensors), bool)
    for number in range(sensors):
        own = column == number
        valid[:, number] = ~missing[:, own].all(axis=1)
    poses = np.tile(np.eye(4), (sensors, 1, 1))
    if contact.sensor_pose is not None:
        axes = sensors // len(contact.sensor_pose)
        poses = np.repeat(contact.sensor_pose, max(axes, 1), axis=0)
    return CountsGrasp(
        id=contact.id,
        object=contact.object,
        approach=contact.approach,
        iteration=contact.iteration,
        session=contact.session,
        timestamp=contact.time,
        phase=phase,
        raw_counts=np.where(missing, BASELINE_COUNTS, counts),
        valid=valid,
        sensor_pose=poses,
        object_pose=np.eye(4) if contact.object_pose is None else contact.object_pose,
    )
