"""Opening of regular files of bounded size.

A pipe, a terminal or a device such as /dev/zero may block a reader or have no end, and a folder has no bytes. All
readers of files open them by these functions, so that a path from a user or from a file never has this effect.
"""

import errno
import io
import os
import stat
from typing import Final

Path = str | os.PathLike[str]

_KINDS: Final = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)
_CHUNK_BYTES: Final = 1 << 20
_NAME_SHOWN: Final = 200
"""Characters of a file name that is too long for the system, in an error message."""


class InputFileError(OSError):
    """A path does not name a regular file, or the file is too large. `strerror` is the problem, `filename` the path.

    The class is an OSError, so that a reader reports it in the same way as a missing file.
    """


def check_regular_file(path: Path) -> os.stat_result:
    """Return the status of a regular file. Raises InputFileError for another kind of file, OSError for a missing one.

    For libraries that open a file by its name; `open_regular_file` is preferable.
    """
    try:
        status = os.stat(path)
    except ValueError as error:  # a zero byte, or a character that a file name cannot have
        raise InputFileError(errno.EINVAL, f"is no file name ({error})", ascii(os.fspath(path))) from None
    except OSError as error:
        if error.errno != errno.ENAMETOOLONG:
            raise
        # A file name in a damaged file may have many thousand characters, which an error message must not contain.
        raise InputFileError(errno.ENAMETOOLONG, error.strerror, f"{os.fspath(path)[:_NAME_SHOWN]}...") from None
    _check_kind(status, path)
    return status


def is_regular_file(path: Path) -> bool:
    """Whether a path names a regular file; False for one that is missing or cannot be examined."""
    try:
        return stat.S_ISREG(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False


def open_regular_file(path: Path) -> io.BufferedReader:
    """Open a regular file for reading, as bytes. Raises InputFileError for another kind of file, OSError.

    The kind is checked before the file is opened, because opening a serial port resets some boards, and again
    afterwards, because another program may replace the file in between. Opening never waits for a writer of a pipe.
    """
    check_regular_file(path)
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY)
    try:
        _check_kind(os.fstat(handle), path)
        return os.fdopen(handle, "rb")
    except BaseException:
        os.close(handle)
        raise


def read_regular_file(path: Path, size_max: int) -> bytes:
    """Read a regular file of at most `size_max` bytes. Raises InputFileError for another kind or size, OSError."""
    with open_regular_file(path) as file:
        if os.fstat(file.fileno()).st_size > size_max:
            _fail_size(path, size_max)
        parts: list[bytes] = []
        size = 0
        # Files of /proc state no size, and a file may grow, so the number of bytes that are read is limited as well.
        while part := file.read(min(_CHUNK_BYTES, size_max + 1 - size)):
            parts.append(part)
            size += len(part)
            if size > size_max:
                _fail_size(path, size_max)
    return b"".join(parts)


def _check_kind(status: os.stat_result, path: Path) -> None:
    """Raise InputFileError unless the status is that of a regular file."""
    if not stat.S_ISREG(status.st_mode):
        kind = next((name for is_kind, name in _KINDS if is_kind(status.st_mode)), "a special file")
        problem = f"is {kind}, no regular file; copy the data to a file, and give the file"
        raise InputFileError(errno.EINVAL, problem, os.fspath(path))


def _fail_size(path: Path, size_max: int) -> None:
    """Raise InputFileError for a file that is too large."""
    raise InputFileError(errno.EFBIG, f"has more than {size_max} bytes; is this the right file?", os.fspath(path))
