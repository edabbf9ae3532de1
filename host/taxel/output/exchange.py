"""Replacement of one folder by another in one step."""

import ctypes
import errno
import os
from pathlib import Path
from typing import Final

_AT_FDCWD: Final = -100
_RENAME_EXCHANGE: Final = 2
"""Constants of linux/fcntl.h and linux/fs.h: paths relative to the current folder; swap two names in one step."""

_UNSUPPORTED: Final = frozenset({errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP})
"""Errors of a kernel or file system that cannot swap two names."""


def exchange(part: Path, target: Path) -> bool:
    """Give the folder `part` the name `target`; return whether a folder was replaced, which then has the name `part`.

    On a file system that cannot swap two names, the existing folder first gets the name of `part` with ".old" appended;
    if the program is killed between the renames, the folder keeps this name. Raises OSError.
    """
    if not target.exists():
        os.rename(part, target)
        return False
    try:
        _swap(part, target)
    except OSError as error:
        if error.errno not in _UNSUPPORTED:
            raise
        old = part.with_name(part.name + ".old")
        os.rename(target, old)
        os.rename(part, target)
        os.rename(old, part)
    return True


def _swap(first: Path, second: Path) -> None:
    """Swap two names in one step, with the system call renameat2. Raises OSError."""
    try:
        function = ctypes.CDLL(None, use_errno=True).renameat2
    except AttributeError:  # glibc before 2.28, musl
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS)) from None
    function.argtypes = (ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_uint)
    if function(_AT_FDCWD, os.fsencode(first), _AT_FDCWD, os.fsencode(second), _RENAME_EXCHANGE) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number), os.fspath(second))
