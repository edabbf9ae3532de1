"""Storage of a test: a folder with reports, and a row of the history."""

import os
from pathlib import Path
from typing import Final

from taxel.errors import TaxelError
from taxel.output import OutputError, PendingOutput
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

    The folder appears when all three files are complete. Returns the folder. Raises `TaxelError`; after an error of the
    history alone, the folder is complete.
    """
    stamp = record.started_utc.replace(":", "").replace("-", "").split(".")[0]
    name = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in record.serial_number) or "board"
    changes: list[Change] = []
    earlier: list[Summary] = []
    history_error = None
    try:
        with History(history_file) as history:
            changes, earlier = history.compare(record), history.list_earlier(record.serial_number)
    except HistoryError as error:
        history_error = error
    with _create_folder(out, f"{name}-{stamp}") as pending:
        from taxel_tools.testing.page import write_page  # needs the extra `bench`, which the other functions do not

        write_json(record, pending.part / "result.json")
        write_junit(record, pending.part / "junit.xml")
        write_page(record, pending.part / "report.html", changes, earlier)
        folder = pending.path
    if history_error is None:
        try:
            with History(history_file) as history:
                history.add(record)
        except HistoryError as error:
            history_error = error
    if history_error is not None:
        raise TaxelError(f"{history_error}; the reports are saved in {folder}")
    return folder


def _create_folder(out: Path, name: str) -> PendingOutput:
    """Create the folder for the reports of a test in `out`, with a number behind the name if the name is in use.

    Tests that begin within one second have the same name. The folder appears under its name when it is complete.
    """
    for number in range(TESTS_PER_SECOND_MAX):
        folder = out / (name if not number else f"{name}-{number}")
        try:
            return PendingOutput(folder, overwrite=False, is_folder=True)
        except OutputError:  # a test within the same second has this name, or is being written
            continue
        except OSError as error:
            raise TaxelError(f"{folder}: {error.strerror}; choose another folder with --out") from None
    raise TaxelError(f"{out / name}: {TESTS_PER_SECOND_MAX} tests in one second; choose another folder with --out")
