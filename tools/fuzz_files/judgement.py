"""One input: the mutant is read, and the outcome is judged."""

from __future__ import annotations

import gc
import shutil
import traceback
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from fuzz_files.document import Flat, list_differences
from fuzz_files.mutant import Mutant, MutantMaker
from fuzz_files.oracle import find_silent_error
from fuzz_files.target import Files, Target

REFUSED: Final = "refused"
UNCHANGED: Final = "accepted, same data"
CHANGED: Final = "accepted, reported difference"
UNMODELLED: Final = "accepted, not modelled"
FINDING: Final = "finding"
OUTCOMES: Final = (REFUSED, UNCHANGED, CHANGED, UNMODELLED, FINDING)

_LONGEST_MESSAGE: Final = 4000
"""A longer error line is a finding: a terminal shows it as a page."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of one input. kind: one of `OUTCOMES`. text: description of a finding."""

    kind: str
    text: str = ""


class MutantReader:
    """Reader of one target's mutants in a folder, and judge of the outcomes."""

    def __init__(self, target: Target, folder: Path) -> None:
        """Write the target's valid files to the emptied folder and read them twice.

        Raises any error of the reader for the valid files, and RuntimeError if the two readings differ.
        """
        self.target = target
        self._folder = folder
        _clear(folder)
        self._name = target.make(folder)
        self._files = read_files(folder)
        self.maker = MutantMaker(target, self._files)
        self._baseline = self._read(self._files)
        again = self._read(self._files)
        if list_differences(again, self._baseline):
            raise RuntimeError(f"{target.name}: two readings of the valid files differ")

    def judge(self, mutant: Mutant) -> Outcome:
        """Read a mutant and judge the outcome.

        A traceback, a warning of NumPy, excessive memory, an unsuitable message and wrong data are findings.
        """
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                data = self._read(mutant.files)
            noisy = [str(warning.message) for warning in caught if issubclass(warning.category, RuntimeWarning)]
        except self.target.errors as error:
            return _judge_message(error)
        except MemoryError:
            return Outcome(FINDING, "memory: the reader needs more memory than permitted")
        except Exception:
            return Outcome(FINDING, f"traceback:\n{traceback.format_exc()}")
        if noisy:
            return Outcome(FINDING, f"warning of a computation with unchecked values: {noisy[0]}")
        return self._judge_data(mutant, data)

    def _judge_data(self, mutant: Mutant, data: Flat) -> Outcome:
        """Judge the data of a mutant that the reader has accepted.

        Some readers return the data that precede a damaged place, and the error under the key "reported". These data
        must be correct, too.
        """
        change = self.maker.describe_change(mutant)
        if "reported" in data:
            data = {**data}
            del data["reported"]
            silent = find_silent_error(self.target.rules, self._baseline, data, change)
            return Outcome(FINDING, f"silent: {silent}") if silent else Outcome(REFUSED)
        is_same = not list_differences(self._baseline, data)
        if change.must_be_refused and not is_same:
            return Outcome(FINDING, "silent: the file is not valid, but the reader returns other data")
        silent = find_silent_error(self.target.rules, self._baseline, data, change)
        if silent:
            return Outcome(FINDING, f"silent: {silent}")
        if is_same:
            return Outcome(UNCHANGED)
        is_modelled = change.fields is not None or self.target.rules.is_protected or bool(self.target.rules.subset)
        return Outcome(CHANGED if is_modelled else UNMODELLED)

    def _read(self, files: Files) -> Flat:
        """Write the files to the folder and read them; files of an earlier mutant are replaced."""
        write_files(self._folder, files)
        return self.target.read(self._folder / self._name)


def _judge_message(error: BaseException) -> Outcome:
    """Judge the error with which a reader refuses a file: its message must be one printable line of limited length."""
    text = str(error)
    if not text or not text.isprintable():
        return Outcome(FINDING, f"error text is not one printable line: {text[:300]!r}")
    if len(text) > _LONGEST_MESSAGE:
        return Outcome(FINDING, f"error text of {len(text)} characters: {text[:300]!r}")
    return Outcome(REFUSED)


def read_files(folder: Path) -> Files:
    """Return the bytes of all files below a folder, by relative name."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def write_files(folder: Path, files: Files) -> None:
    """Write files below a folder, and create their folders. files: bytes by relative name."""
    for name, data in files.items():
        path = folder / name
        try:
            path.write_bytes(data)
        except FileNotFoundError:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)


def _clear(folder: Path) -> None:
    """Remove the content of a folder."""
    for path in folder.iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    gc.collect()
