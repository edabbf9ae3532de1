"""Values for worker processes, as files: only the path of a file passes through the pipe to a process."""

import pickle
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self


class Handover:
    """A pickled value in a temporary file, which worker processes read with `read_handover`; a context manager.

    In some versions of Python, among them 3.11.2, a pool of processes waits forever if a worker is killed while a task
    is being sent whose size exceeds the buffer of the pipe, 64 KiB (CPython issue 94777). A path is always shorter.

    Attributes:
        path: file with the pickled value, which exists until `close`.
    """

    def __init__(self, value: object) -> None:
        """Write the value to the temporary file. Raises OSError if the disk is full."""
        self._folder = TemporaryDirectory(prefix="taxel-")
        self.path = Path(self._folder.name) / "value.pickle"
        self.path.write_bytes(pickle.dumps(value))

    def __enter__(self) -> Self:
        """Return the handover itself; its file is removed at the end of the `with` block."""
        return self

    def __exit__(self, *unused: object) -> None:
        """Remove the temporary file."""
        self.close()

    def close(self) -> None:
        """Remove the temporary file; without effect after the first call."""
        self._folder.cleanup()


@lru_cache(maxsize=2)
def read_handover(path: Path) -> Any:
    """Return the value of a `Handover` in a worker process; the last two values are read only once per process.

    path: `Handover.path`. The file is written by this program itself, so that it may be unpickled.
    """
    return pickle.loads(path.read_bytes())
