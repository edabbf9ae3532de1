"""A synthetic skin of two boards, whose contacts and faults are known exactly."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from taxel.recording.grasp_tables import SensorTable, TaxelTable
from taxel.twin import Contact, ContactSchedule, Reference, Twin
from taxel.twin.reference import learn_reference
from taxel.twin.steps import StepBuilder

RATE_HZ = 25.0
SIDE = 4
"""Number of TX lines and of RX lines of a board."""
TAXELS = 2 * SIDE * SIDE
ADDRESSES = (0x20, 0x21)


def make_tables() -> tuple[TaxelTable, SensorTable]:
    """Make the tables of two boards with 4 x 4 taxels each."""
    grid = np.arange(SIDE, dtype=np.uint8)
    tx, rx = np.tile(np.repeat(grid, SIDE), 2), np.tile(np.tile(grid, SIDE), 2)
    position = np.column_stack([5e-3 * rx, 5e-3 * tx, np.zeros(TAXELS)]).astype(np.float64)
    normal = np.tile([0.0, 0.0, 1.0], (TAXELS, 1))
    sensor = np.repeat(np.array(ADDRESSES, np.uint8), SIDE * SIDE)
    taxels = TaxelTable(sensor, tx, rx, position, normal, np.full(TAXELS, 3e-3))
    kinds = ("square", "square")
    return taxels, SensorTable(np.array(ADDRESSES, np.uint8), ("left", "right"), kinds, np.full(2, RATE_HZ))


@dataclass
class SyntheticSkin:
    """Generates poll cycles of a skin with n taxels on two boards.

    seed: seed of all random numbers. gain: f64[n], response relative to a healthy taxel. offset: f64[n], counts
    subtracted from the raw count. lost: f64[2], share of lost frames of each board. drift_counts: standard deviation of
    the drift after one second, counts. force_deviation: relative standard deviation of the force, by condition; 0.05
    for the others.
    """

    seed: int
    gain: np.ndarray = field(default_factory=lambda: np.ones(TAXELS))
    offset: np.ndarray = field(default_factory=lambda: np.zeros(TAXELS))
    lost: np.ndarray = field(default_factory=lambda: np.zeros(2))
    noise_counts: float = 4.0
    drift_counts: float = 0.3
    force_deviation: dict[tuple[str, str], float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Sample the contact patterns of three conditions: press_0 and press_2 on the left board, press_1 on the
        right.
        """
        self.rng = np.random.default_rng(self.seed)
        self.time_s = 0.0
        self._temperature = np.zeros(2)
        taxels, _ = make_tables()
        self._board = (taxels.sensor == ADDRESSES[1]).astype(int)
        self._loading = 1.0 + 0.2 * self.rng.normal(size=TAXELS)
        self.patterns = {}
        for number, board in enumerate((0, 1, 0)):
            centre = self.rng.uniform(5e-3, 1e-2, 2)
            distance = np.linalg.norm(taxels.position[:, :2] - centre, axis=1)
            self.patterns["peg", f"press_{number}"] = 900.0 * np.exp(-((distance / 6e-3) ** 2)) * (self._board == board)

    def make_contact(self, condition: tuple[str, str], pause_s: float) -> Contact:
        """Plan a contact of 4 s that begins `pause_s` after the poll cycles generated so far."""
        start = self.time_s + pause_s
        return Contact((start, start + 1.2, start + 2.4, start + 3.2, start + 4.0), condition)

    def run(self, contact: Contact | None, seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Generate the poll cycles of the next seconds: times f64[T], raw counts u16[T, n], valid frames bool[T, 2].

        contact: the only contact in this time, or None.
        """
        count = round(seconds * RATE_HZ)
        times = self.time_s + (np.arange(count) + 0.5) / RATE_HZ
        self.time_s += count / RATE_HZ
        walk = np.cumsum(self.drift_counts * self.rng.normal(size=(count, 2)) / np.sqrt(RATE_HZ), axis=0)
        drift = self._temperature + walk
        self._temperature = drift[-1]
        signal = np.zeros((count, TAXELS))
        if contact is not None:
            force = 1.0 + self.force_deviation.get(contact.condition, 0.05) * self.rng.normal()
            taxel_factor = 1.0 + 0.03 * self.rng.normal(size=TAXELS)
            share = np.interp(times, contact.times_s, (0.0, 1.0, 1.0, 0.0, 0.0), left=0.0, right=0.0)
            signal = force * share[:, None] * self.patterns[contact.condition] * taxel_factor * self.gain
        raw = 20_000.0 + drift[:, self._board] * self._loading - signal - self.offset
        raw = raw + self.noise_counts * self.rng.normal(size=raw.shape)
        valid = self.rng.random((count, 2)) >= self.lost
        return times, np.clip(np.round(raw), 0, 65_535).astype(np.uint16), valid

    def run_routine(self, number: int) -> tuple[list[Contact], tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Generate `number` contacts of all conditions in turn, with random pauses of 4.5 to 12 seconds before them.

        Returns the contacts, and the poll cycles as `run` does.
        """
        contacts, parts = [], []
        names = sorted(self.patterns)
        for index in range(number):
            pause = float(self.rng.uniform(4.5, 12.0))
            contact = self.make_contact(names[index % len(names)], pause)
            contacts.append(contact)
            parts.append(self.run(contact, pause + 4.0))
        times, raw, valid = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        return contacts, (times, raw, valid)


def learn(skin: SyntheticSkin, contacts: int = 36) -> Reference:
    """Generate contacts of a healthy skin and learn a reference from them; the random state of the skin advances."""
    taxels, sensors = make_tables()
    planned, cycles = skin.run_routine(contacts)
    builder = StepBuilder(ContactSchedule(planned), sensors.index_of(taxels), 2, 4.5)
    steps = [(0, step) for step in builder.take(*cycles)] + [(0, step) for step in builder.take(*skin.run(None, 1.0))]
    return learn_reference(taxels, sensors, steps, "synthetic")


def watch(twin: Twin, cycles: tuple[np.ndarray, np.ndarray, np.ndarray], block: int = 256) -> list[object]:
    """Run a twin on poll cycles in blocks of `block` cycles, and end the stream; return all events."""
    events: list[object] = []
    for start in range(0, len(cycles[0]), block):
        for result in twin.take(*(column[start : start + block] for column in cycles)):
            events += result.events
    return events + [event for result in twin.finish() for event in result.events]
