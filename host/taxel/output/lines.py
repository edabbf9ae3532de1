"""A text file to which complete lines are appended, such as the results of a run that can be continued."""

import os
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from taxel.output.disk import flush_descriptor
from taxel.output.live import LiveOutput

_BLOCK: Final = 1 << 16


def read_complete_lines(path: str | os.PathLike[str]) -> list[str]:
    """Return the lines of a file of `AppendedLines` without their ends; [] for a missing file.

    An incomplete last line, which a killed program has left, is omitted. Raises OSError.
    """
    try:
        content = Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        return []
    return content[: content.rfind("\n") + 1].splitlines()


class AppendedLines:
    """A locked file of lines. A context manager.

    A line is on the disk when `append` returns, also after a power failure. An incomplete last line, which a killed
    program has left, is removed when the file is opened.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Open a file of lines, or create it. An incomplete last line is removed.

        Raises OutputError if another program writes the file, OSError if the system refuses.
        """
        if not os.path.exists(path):
            LiveOutput(path, overwrite=False).close()
        self._output = LiveOutput.extend(path)
        self._file = self._output.file
        self._end = self._find_end()
        os.ftruncate(self._file.fileno(), self._end)

    def _find_end(self) -> int:
        """Return the position after the last complete line, bytes."""
        end = os.fstat(self._file.fileno()).st_size
        while end:
            start = max(0, end - _BLOCK)
            found = os.pread(self._file.fileno(), end - start, start).rfind(b"\n")
            if found >= 0:
                return start + found + 1
            end = start
        return 0

    def append(self, line: str) -> None:
        """Append a line without a line end. Raises OSError; the file then ends with the line before."""
        data = memoryview(line.encode() + b"\n")
        try:
            count = 0
            while count < len(data):
                count += os.pwrite(self._file.fileno(), data[count:], self._end + count)
            flush_descriptor(self._file.fileno())
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._file.fileno(), self._end)
            raise
        self._end += len(data)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file at the end of the `with` block."""
        self._file.close()
