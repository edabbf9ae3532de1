"""All tests of a bench in one SQLite file: what the same device showed before, and what has moved since."""

from __future__ import annotations

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
from taxel_tools.testing.drift import Change, change_of
from taxel_tools.testing.errors import HistoryError
from taxel_tools.testing.record import Outcome, TestRecord
from taxel_tools.testing.result_file import json_bytes

__all__ = ["Change", "History", "Summary"]

SCHEMA_VERSION: Final = 1
APPLICATION_ID: Final = 0x54585452
"""Of the database's header: the characters TXTR. So another program's database is not taken for a history."""
PATIENCE_S: Final = 30.0
"""How long a station waits for another that writes, which takes milliseconds."""

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
    """One earlier test. faults: "fault, place" of each finding, the most severe first."""

    started_utc: str
    outcome: Outcome
    operator: str
    station: str
    plan_name: str
    plan_version: str
    faults: list[str]


class History:
    """A history file, made if it is not there. Several stations may use one at a time; use it as a context manager.

    Every method raises `HistoryError` of one line: no such database, of a newer release, damaged, or not to be written.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        with self._told():
            # Transactions are begun by hand: sqlite3 would begin them too late to keep another station out.
            self._connection = sqlite3.connect(self.path, timeout=PATIENCE_S, isolation_level=None)
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
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def add(self, record: TestRecord) -> bool:
        """Keep a test. False if this very record is kept already."""
        with self._told(), self._writing():
            cursor = self._connection.execute(
                "INSERT INTO run (digest, serial_number, started_utc, outcome, operator, station, plan_name,"
                " plan_version, software_version, seconds) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"
                " ON CONFLICT (digest) DO NOTHING",
                (
                    _digest(record),
                    _text(record.serial_number),
                    _text(record.started_utc),
                    record.outcome.value,
                    _text(record.operator),
                    _text(record.station),
                    _text(record.plan_name),
                    _text(record.plan_version),
                    _text(record.software_version),
                    record.seconds,
                ),
            )
            if cursor.rowcount == 0:
                return False
            self._add_parts(cursor.lastrowid, record)
            return True

    def earlier(self, serial_number: str) -> list[Summary]:
        """The tests of a serial number, the newest first; none for an empty one, which may be anything."""
        if not serial_number:
            return []
        with self._told():
            rows = self._connection.execute(
                "SELECT id, started_utc, outcome, operator, station, plan_name, plan_version FROM run"
                " WHERE serial_number = ? ORDER BY id DESC",
                (_text(serial_number),),
            ).fetchall()
            return [
                Summary(str(begun), Outcome(outcome), str(who), str(where), str(plan), str(version), self._faults(run))
                for run, begun, outcome, who, where, plan, version in rows
            ]

    def compare(self, record: TestRecord) -> list[Change]:
        """Each number of a record beside those of the earlier tests of its serial number, as `drift` judges them.

        Earlier are those that were added before the record, or all if it was not added: clocks of stations differ.
        Text is left out, and what was not measured before in that unit.
        """
        if not record.serial_number:
            return []
        with self._told():
            rows = self._connection.execute(
                "SELECT phase, name, place, unit, value FROM measurement JOIN run ON measurement.run = run.id"
                " WHERE serial_number = ? AND typeof(value) = 'real'"
                " AND run.id < ifnull((SELECT id FROM run WHERE digest = ?), 9223372036854775807) ORDER BY run.id",
                (_text(record.serial_number), _digest(record)),
            ).fetchall()
        before: dict[tuple[str, ...], list[float]] = {}
        for *key, value in rows:
            if math.isfinite(value):
                before.setdefault(tuple(key), []).append(value)
        return [
            change_of(phase.name, one, before[same])
            for phase in record.phases
            for one in phase.measurements
            if not isinstance(one.value, str)
            and (same := tuple(map(_text, (phase.name, one.name, one.place, one.unit)))) in before
        ]

    def _faults(self, run: int) -> list[str]:
        rows = self._connection.execute(
            "SELECT fault, place FROM finding WHERE run = ? ORDER BY severity DESC, rowid", (run,)
        )
        return [f"{fault}, {place}" if place else fault for fault, place in rows]

    def _add_parts(self, run: int | None, record: TestRecord) -> None:
        self._connection.executemany(
            "INSERT INTO measurement VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
            [
                (
                    run,
                    _text(phase.name),
                    _text(one.name),
                    _text(one.place),
                    _text(one.unit),
                    None if isinstance(one.value, str) else one.value,
                    _text(one.value) if isinstance(one.value, str) else None,
                    one.outcome.value,
                )
                for phase in record.phases
                for one in phase.measurements
            ],
        )
        self._connection.executemany(
            "INSERT INTO finding VALUES (?, ?, ?, ?, ?)",
            [
                (run, _text(phase.name), _text(one.fault), _text(one.place), one.severity)
                for phase in record.phases
                for one in phase.findings
            ],
        )

    def _open(self) -> None:
        with self._told():
            if self._is_new():
                with self._writing():
                    if self._is_new():  # another station may have made it meanwhile
                        for statement in _SCHEMA:
                            self._connection.execute(statement)
            application, version = self._pragma("application_id"), self._pragma("user_version")
        if application != APPLICATION_ID:
            self._fail("expected a history of tests, found another program's database; name another file")
        if version != SCHEMA_VERSION:
            self._fail(
                f"expected a history of version {SCHEMA_VERSION}, found version {version}; use a release that knows it"
            )

    def _is_new(self) -> bool:
        tables = self._connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        return not (tables or self._pragma("application_id") or self._pragma("user_version"))

    def _pragma(self, name: str) -> int:
        return int(self._connection.execute(f"PRAGMA {name}").fetchone()[0])

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """A transaction that holds the file from its begin; undone where it is left by an exception."""
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._connection.execute("COMMIT")
        except BaseException:
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
            raise

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.OperationalError as error:
            reason = " ".join(str(error).split())
            self._fail(f"cannot be used: {reason}; check its folder, its permissions, and who else holds it")
        except (sqlite3.Error, ValueError) as error:
            reason = " ".join(str(error).split())
            self._fail(f"expected a history of tests, found: {reason}; check the file, or name another")

    def _fail(self, problem: str) -> None:
        raise HistoryError(format_path(self.path), problem) from None


def _digest(record: TestRecord) -> str:
    return hashlib.sha256(json_bytes(record)).hexdigest()


def _text(text: str) -> str:
    """Text that a database can hold: a lone surrogate has no UTF-8."""
    return text.encode("utf-8", "replace").decode("utf-8")
