"""History of all tests of a station in one SQLite file: earlier results of the same device, and changes since."""

import hashlib
import math
import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from taxel.hand.errors import format_path
from taxel.input_files import is_regular_file
from taxel_tools.testing.drift import Change, compare_value
from taxel_tools.testing.errors import HistoryError
from taxel_tools.testing.record import Measurement, Outcome, TestRecord
from taxel_tools.testing.result_file import format_json_bytes

__all__ = ["Change", "History", "Summary"]

SCHEMA_VERSION: Final = 1
APPLICATION_ID: Final = 0x54585452
"""Application id in the database header, the characters TXTR; distinguishes a history from other databases."""
LOCK_TIMEOUT_S: Final = 30.0
"""Longest wait for another station that writes; a write takes milliseconds."""

_SCHEMA = (
    """CREATE TABLE run (id INTEGER PRIMARY KEY, digest TEXT NOT NULL UNIQUE, serial_number TEXT NOT NULL,
    started_utc TEXT NOT NULL, outcome TEXT NOT NULL, operator TEXT NOT NULL, station TEXT NOT NULL,
    plan_name TEXT NOT NULL, plan_version TEXT NOT NULL, software_version TEXT NOT NULL, seconds REAL)""",
    """CREATE TABLE measurement (run INTEGER NOT NULL REFERENCES run(id), phase TEXT NOT NULL, name TEXT NOT NULL,
    place TEXT NOT NULL, unit TEXT NOT NULL, value REAL, text TEXT, outcome TEXT NOT NULL)""",
    """CREATE TABLE finding (run INTEGER NOT NULL REFERENCES run(id), phase TEXT NOT NULL, fault TEXT NOT NULL,
    place TEXT NOT NULL, severity REAL)""",
    "CREATE INDEX run_of_serial ON run(serial_number)",
    "CREATE INDEX measurement_of_run ON measurement(run)",
    "CREATE INDEX finding_of_run ON finding(run)",
    f"PRAGMA application_id = {APPLICATION_ID}",
    f"PRAGMA user_version = {SCHEMA_VERSION}",
)


@dataclass(frozen=True, slots=True)
class Summary:
    """An earlier test. `faults`: "fault, place" of each finding, in order of decreasing severity."""

    started_utc: str
    outcome: Outcome
    operator: str
    station: str
    plan_name: str
    plan_version: str
    faults: list[str]


class History:
    """A history file, created if it does not exist. Several stations may share it; use it as a context manager.

    Every method raises `HistoryError` as one line for a file that is no history, of a newer release, damaged, or not
    writable.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Open or create a file of test results. Raises `HistoryError` if the file is locked or is no history."""
        self.path = Path(path)
        if self.path.exists() and not is_regular_file(self.path):
            self._fail("expected a history of tests, found no regular file; choose another file")
        with self._translate_errors():
            # Explicit transactions: sqlite3 would start them too late to exclude another station.
            self._connection = sqlite3.connect(self.path, timeout=LOCK_TIMEOUT_S, isolation_level=None)
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file of test results."""
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def add(self, record: TestRecord) -> bool:
        """Store the record of a test in the history. Returns False if the same record is stored already."""
        with self._translate_errors(), self._transaction():
            cursor = self._connection.execute(
                "INSERT INTO run (digest, serial_number, started_utc, outcome, operator, station, plan_name,"
                " plan_version, software_version, seconds) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"
                " ON CONFLICT (digest) DO NOTHING",
                (
                    _compute_digest(record),
                    _to_utf8(record.serial_number),
                    _to_utf8(record.started_utc),
                    record.outcome.value,
                    _to_utf8(record.operator),
                    _to_utf8(record.station),
                    _to_utf8(record.plan_name),
                    _to_utf8(record.plan_version),
                    _to_utf8(record.software_version),
                    record.seconds,
                ),
            )
            if cursor.rowcount == 0:
                return False
            self._add_details(cursor.lastrowid, record)
            return True

    def list_earlier(self, serial_number: str) -> list[Summary]:
        """List the earlier tests of the device with a serial number, newest first.

        Returns [] for an empty serial number, which identifies no device.
        """
        if not serial_number:
            return []
        with self._translate_errors():
            rows = self._connection.execute(
                "SELECT id, started_utc, outcome, operator, station, plan_name, plan_version FROM run"
                " WHERE serial_number = ? ORDER BY id DESC",
                (_to_utf8(serial_number),),
            ).fetchall()
            return [
                Summary(
                    str(started),
                    Outcome(outcome),
                    str(operator),
                    str(station),
                    str(plan),
                    str(version),
                    self._list_faults(run),
                )
                for run, started, outcome, operator, station, plan, version in rows
            ]

    def compare(self, record: TestRecord) -> list[Change]:
        """Compare each number of a test record with the earlier tests of the same serial number; see `drift`.

        Earlier tests are those added before the record, or all if the record was not added: the clocks of stations
        may differ. In the query, the largest integer of SQLite replaces the row of a record that was not added. Text
        and quantities without an earlier value in the same unit are omitted.
        """
        if not record.serial_number:
            return []
        with self._translate_errors():
            rows = self._connection.execute(
                "SELECT phase, name, place, unit, value FROM measurement JOIN run ON measurement.run = run.id"
                " WHERE serial_number = ? AND typeof(value) = 'real'"
                " AND run.id < ifnull((SELECT id FROM run WHERE digest = ?), 9223372036854775807) ORDER BY run.id",
                (_to_utf8(record.serial_number), _compute_digest(record)),
            ).fetchall()
        earlier: dict[tuple[str, ...], list[float]] = {}
        for *key, value in rows:
            if math.isfinite(value):
                earlier.setdefault(tuple(key), []).append(value)
        return [
            compare_value(phase.name, measurement, earlier[quantity])
            for phase in record.phases
            for measurement in phase.measurements
            if not isinstance(measurement.value, str)
            and (quantity := _make_quantity_key(phase.name, measurement)) in earlier
        ]

    def _list_faults(self, run: int) -> list[str]:
        """List the faults found in a test run, with their places, the most severe fault first.

        run: row of the run in the database.
        """
        rows = self._connection.execute(
            "SELECT fault, place FROM finding WHERE run = ? ORDER BY severity DESC, rowid", (run,)
        )
        return [f"{fault}, {place}" if place else fault for fault, place in rows]

    def _add_details(self, run: int | None, record: TestRecord) -> None:
        """Insert the measurements and findings of a test into the database. run: row of the test in the table `run`."""
        self._connection.executemany(
            "INSERT INTO measurement VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
            [
                (
                    run,
                    _to_utf8(phase.name),
                    _to_utf8(measurement.name),
                    _to_utf8(measurement.place),
                    _to_utf8(measurement.unit),
                    None if isinstance(measurement.value, str) else measurement.value,
                    _to_utf8(measurement.value) if isinstance(measurement.value, str) else None,
                    measurement.outcome.value,
                )
                for phase in record.phases
                for measurement in phase.measurements
            ],
        )
        self._connection.executemany(
            "INSERT INTO finding VALUES (?, ?, ?, ?, ?)",
            [
                (run, _to_utf8(phase.name), _to_utf8(finding.fault), _to_utf8(finding.place), finding.severity)
                for phase in record.phases
                for finding in phase.findings
            ],
        )

    def _open(self) -> None:
        """Create the tables in a new history file; check the identity and version of an existing one."""
        with self._translate_errors():
            if self._is_new():
                with self._transaction():
                    if self._is_new():  # Another station may have created the tables meanwhile.
                        for statement in _SCHEMA:
                            self._connection.execute(statement)
            application, version = self._read_pragma("application_id"), self._read_pragma("user_version")
        if application != APPLICATION_ID:
            self._fail("expected a history of tests, found the database of another program; choose another file")
        if version != SCHEMA_VERSION:
            self._fail(f"expected a history of version {SCHEMA_VERSION}, found version {version}; use a newer release")
        self._check_integrity()

    def _check_integrity(self) -> None:
        """Raise `HistoryError` for a damaged file. A query by a damaged index would silently omit earlier tests.

        The check reads the whole file, about one second for 100 MB, which is a thousand tests.
        """
        with self._translate_errors():
            problem = self._connection.execute("PRAGMA integrity_check(1)").fetchone()[0]
        if problem != "ok":
            reason = " ".join(str(problem).split())
            self._fail(f"expected an undamaged history, found: {reason}; restore a copy, or choose another file")

    def _is_new(self) -> bool:
        """Return whether the history file is an empty database."""
        tables = self._connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        return not (tables or self._read_pragma("application_id") or self._read_pragma("user_version"))

    def _read_pragma(self, name: str) -> int:
        """Read the integer setting `name` of the SQLite database."""
        return int(self._connection.execute(f"PRAGMA {name}").fetchone()[0])

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        """Provide a database transaction that locks the history file from its start and is rolled back after an
        exception.
        """
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._connection.execute("COMMIT")
        except BaseException:
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
            raise

    @contextmanager
    def _translate_errors(self) -> Iterator[None]:
        """Provide a context that turns errors of SQLite into `HistoryError` with a remedy."""
        try:
            yield
        except sqlite3.OperationalError as error:
            reason = " ".join(str(error).split())
            remedy = "check the folder, the permissions, and whether another program locks the file"
            self._fail(f"cannot be used: {reason}; {remedy}")
        except (sqlite3.Error, ValueError) as error:
            reason = " ".join(str(error).split())
            self._fail(f"expected a history of tests, found: {reason}; check the file, or choose another")

    def _fail(self, problem: str) -> None:
        """Raise `HistoryError` for this history file."""
        raise HistoryError(format_path(self.path), problem) from None


def _make_quantity_key(phase: str, measurement: Measurement) -> tuple[str, ...]:
    """Create the key under which the history stores a measurement: phase, name, place, unit."""
    return tuple(map(_to_utf8, (phase, measurement.name, measurement.place, measurement.unit)))


def _compute_digest(record: TestRecord) -> str:
    """Compute the SHA-256 of a test record, by which the history recognises a record that is stored already."""
    return hashlib.sha256(format_json_bytes(record)).hexdigest()


def _to_utf8(text: str) -> str:
    """Return the text that the database can store: UTF-8 cannot encode a lone surrogate."""
    return text.encode("utf-8", "replace").decode("utf-8")
