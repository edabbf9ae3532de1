"""Lock of an output file, and the process that holds it.

The lock is the one of the system call flock: it ends with the process, also after SIGKILL, so that no lock file
remains. Every program of the project respects it. The HDF5 library uses the same lock for the files that it opens.
"""

import errno
import fcntl
import os
from pathlib import Path
from typing import Final, NoReturn

from taxel.output.errors import fail

_LOCK_TABLE: Final = Path("/proc/locks")
_UNSUPPORTED: Final = frozenset({errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL})
"""Errors of a file system without locks, such as some network file systems. Writing continues without a lock there."""


def try_lock(descriptor: int, is_shared: bool = False) -> bool:
    """Lock an open file or folder without waiting; return whether it is locked now.

    False if another descriptor of the file holds a conflicting lock, in this or another process. True also on a file
    system without locks. is_shared: permit other shared locks, such as those of readers.
    """
    try:
        fcntl.flock(descriptor, (fcntl.LOCK_SH if is_shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in _UNSUPPORTED:
            raise
    return True


def fail_locked(path: str | os.PathLike[str], descriptor: int) -> NoReturn:
    """Raise OutputError because another program writes `path`; descriptor: the open file with the lock."""
    holder = find_holder(descriptor)
    found = "one that is being written" if holder is None else f"one that process {holder} is writing"
    fail(path, "a file that no other program writes", found, "choose another name, or end that program first")


def find_holder(descriptor: int) -> int | None:
    """Return the id of a process that holds a lock on an open file; None if the system does not show one."""
    status = os.fstat(descriptor)
    device = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}"
    holders: dict[bool, int] = {}  # key: whether the device agrees; the inode agrees in both cases
    try:
        lines = _LOCK_TABLE.read_text().splitlines()
    except OSError:
        return None
    for line in lines:  # 1: FLOCK  ADVISORY  WRITE 4242 fe:00:1234 0 EOF
        words = line.split()
        if len(words) < 6 or words[1] != "FLOCK" or not words[4].isdecimal():
            continue
        place, _, inode = words[5].rpartition(":")
        if inode == str(status.st_ino) and int(words[4]) > 0:
            # Stacked file systems show the device of a lower layer in the table, with the same inode.
            holders[place == device] = int(words[4])
    return holders.get(True, holders.get(False))
