"""The compiled libraries that the package brings along."""

from __future__ import annotations

import ctypes
import importlib.resources
import os
import re
import sys
from pathlib import Path

from taxel.errors import TaxelError


def load_library(name: str, what: str, error: type[TaxelError]) -> ctypes.CDLL:
    """Load `libNAME.so`. what: what it is called for users. Raises `error`, of one line, if it was not built."""
    path = importlib.resources.files("taxel") / "native" / f"lib{name}.so"
    try:
        return ctypes.CDLL(str(path))
    except OSError as reason:
        raise error(f"{what} is missing from the package; install taxel again (pip install .)") from reason


class stderr_into:  # noqa: N801 - a context manager used like a function
    """Let a C library's complaints go to a file: it writes to the process's standard error."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        sys.stderr.flush()
        self._saved = os.dup(2)
        target = os.open(self._path, os.O_WRONLY | os.O_CREAT, 0o600)
        os.dup2(target, 2)
        os.close(target)

    def __exit__(self, *_: object) -> None:
        os.dup2(self._saved, 2)
        os.close(self._saved)


def last_words(stderr: str, path: str, world: str) -> str:
    """The emulator's last line, with the text of the world file's line that it names: the file is gone."""
    lines = stderr.strip().splitlines()
    if not lines:
        return "the library has no memory"
    text = lines[-1].replace(path, "file")
    named, written = re.search(r", line (\d+)", text), world.splitlines()
    if named is None or not 1 <= int(named[1]) <= len(written):
        return text
    return f"{text} (found '{written[int(named[1]) - 1]}')"
