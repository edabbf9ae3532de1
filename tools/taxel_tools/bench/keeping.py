"""What is left of a test: a folder with its reports, and a row of the history."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from taxel.errors import TaxelError
from taxel_tools.testing.errors import HistoryError
from taxel_tools.testing.history import Change, History, Summary
from taxel_tools.testing.junit import write_junit
from taxel_tools.testing.page import write_page
from taxel_tools.testing.record import TestRecord
from taxel_tools.testing.result_file import write_json

MOST_OF_A_SECOND: Final = 1000


def check_place(out: Path, history_file: Path) -> None:
    """Make sure, before ten minutes of testing, that a report can be kept. Raises `TaxelError`."""
    for folder in (out, history_file.parent):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise TaxelError(f"{folder}: {error.strerror}; choose another folder with --out or --history") from None
        if not os.access(folder, os.W_OK | os.X_OK):
            raise TaxelError(f"{folder}: cannot be written to; choose another folder with --out or --history")
    History(history_file).close()


def keep(record: TestRecord, out: Path, history_file: Path) -> Path:
    """Write report.html, result.json, junit.xml into a new folder under `out`, and add the test to the history.

    Returns the folder. Raises `TaxelError`; if only the history could not take the test, the folder is there and whole.
    """
    stamp = record.started_utc.replace(":", "").replace("-", "").split(".")[0]
    name = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in record.serial_number) or "board"
    folder = _new_folder(out, f"{name}-{stamp}")
    write_json(record, folder / "result.json")
    write_junit(record, folder / "junit.xml")
    changes: list[Change] = []
    earlier: list[Summary] = []
    refused = None
    try:
        with History(history_file) as history:
            changes, earlier = history.compare(record), history.earlier(record.serial_number)
            history.add(record)
    except HistoryError as error:
        refused = error
    write_page(record, folder / "report.html", changes, earlier)
    if refused:
        raise TaxelError(f"{refused}; the report itself is kept in {folder}")
    return folder


def _new_folder(out: Path, name: str) -> Path:
    """A folder that nobody else has: tests of one second get numbers."""
    for number in range(MOST_OF_A_SECOND):
        folder = out / (name if not number else f"{name}-{number}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise TaxelError(f"{folder}: {error.strerror}; choose another folder with --out") from None
        return folder
    raise TaxelError(f"{out / name}: {MOST_OF_A_SECOND} tests of one second; choose another folder with --out")
