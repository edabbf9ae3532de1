"""Storage of a test: a folder with reports, and a row of the history."""

import os
from pathlib import Path
from typing import Final

from taxel.errors import TaxelError
from taxel_tools.testing.errors import HistoryError
from taxel_tools.testing.history import Change, History, Summary
from taxel_tools.testing.junit import write_junit
from taxel_tools.testing.record import TestRecord
from taxel_tools.testing.result_file import write_json

TESTS_PER_SECOND_MAX: Final = 1000


def check_output(out: Path, history_file: Path) -> None:
    """Check before a test that its reports and its row of the history can be written. Raises `TaxelError`."""
    for folder in (out, history_file.parent):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise TaxelError(f"{folder}: {error.strerror}; choose another folder with --out or --history") from None
        if not os.access(folder, os.W_OK | os.X_OK):
            raise TaxelError(f"{folder}: the folder is not writable; choose another one with --out or --history")
    History(history_file).close()


def save_record(record: TestRecord, out: Path, history_file: Path) -> Path:
    """Write report.html, result.json and junit.xml to a new folder in `out`, and add the test to the history.

    Returns the folder. Raises `TaxelError`; after an error of the history alone, the folder is complete.
    """
    stamp = record.started_utc.replace(":", "").replace("-", "").split(".")[0]
    name = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in record.serial_number) or "board"
    folder = _create_folder(out, f"{name}-{stamp}")
    write_json(record, folder / "result.json")
    write_junit(record, folder / "junit.xml")
    changes: list[Change] = []
    earlier: list[Summary] = []
    history_error = None
    try:
        with History(history_file) as history:
            changes, earlier = history.compare(record), history.list_earlier(record.serial_number)
            history.add(record)
    except HistoryError as error:
        history_error = error
    from taxel_tools.testing.page import write_page  # needs the extra `bench`, which the other functions do not

    write_page(record, folder / "report.html", changes, earlier)
    if history_error:
        raise TaxelError(f"{history_error}; the reports are saved in {folder}")
    return folder


def _create_folder(out: Path, name: str) -> Path:
    """Create the folder for the reports of a test in `out`; tests within one second are numbered."""
    for number in range(TESTS_PER_SECOND_MAX):
        folder = out / (name if not number else f"{name}-{number}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise TaxelError(f"{folder}: {error.strerror}; choose another folder with --out") from None
        return folder
    raise TaxelError(f"{out / name}: {TESTS_PER_SECOND_MAX} tests in one second; choose another folder with --out")
