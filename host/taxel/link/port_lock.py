"""Exclusive use of a device by one program: the lock, and the process that holds it."""

import contextlib
import errno
import fcntl
import os
import termios
from pathlib import Path
from typing import Final

from taxel.link.errors import PortBusyError

BUSY: Final = frozenset({errno.EAGAIN, errno.EBUSY, errno.EACCES})
"""Error numbers (errno) of a lock or an opening that another program prevents."""


def lock_device(descriptor: int, name: str) -> None:
    """Lock an open device for this program until the descriptor is closed, also by the end of the process.

    name: path of the device. Raises `PortBusyError`, with the process that holds the lock, if another program has
    locked the device. On a file system without locks, the device stays unlocked.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in BUSY:
            raise make_busy_error(name) from None
        # A file system without locks: the device is used without one.


def refuse_other_openings(descriptor: int, name: str) -> None:
    """Let the kernel refuse further openings of an open serial port by programs that use no locks, such as `cat`.

    Not used for pseudo-terminals: the refusal would outlive a killed program, because the other end stays open.
    """
    if not os.path.realpath(name).startswith("/dev/pts/"):
        with contextlib.suppress(OSError):
            fcntl.ioctl(descriptor, termios.TIOCEXCL)


def make_busy_error(name: str) -> PortBusyError:
    """Create the error for a device that another program uses; name: path of the device."""
    holder = find_holder(name)
    if holder is None:
        return PortBusyError(name, "is used by another program; end that program first")
    process, command = holder
    return PortBusyError(name, f"is used by process {process} ({command}); end that program first")


def find_holder(name: str) -> tuple[int, str] | None:
    """Return the other process that has locked or opened the device `name`, as (process id, command); None if unknown.

    name: path of the device. The kernel lists locks for every user, but open files only for the same user or root.
    """
    try:
        status = os.stat(name)
    except OSError:
        return None
    process = _find_lock(status)
    if process is None:
        process = next((other for other in _list_openings(status) if other != os.getpid()), None)
    return None if process is None else (process, _read_command(process))


def _find_lock(status: os.stat_result) -> int | None:
    """Return the id of the process that has locked a file; None if the file is not in the kernel's list of locks."""
    file = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}:{status.st_ino}"
    with contextlib.suppress(OSError, ValueError):
        for line in Path("/proc/locks").read_text().splitlines():
            fields = line.split()  # number, FLOCK, ADVISORY, WRITE, process, file, start, end
            if len(fields) == 8 and fields[1] == "FLOCK" and fields[5] == file and int(fields[4]) > 0:
                return int(fields[4])
    return None


def _list_openings(status: os.stat_result) -> list[int]:
    """Return the ids of the processes that have opened a file, as far as this user may read them."""
    processes = []
    for folder in Path("/proc").glob("[0-9]*/fd"):
        with contextlib.suppress(OSError):
            for descriptor in folder.iterdir():
                with contextlib.suppress(OSError):
                    other = descriptor.stat()
                    if (other.st_dev, other.st_ino) == (status.st_dev, status.st_ino):
                        processes.append(int(folder.parent.name))
                        break
    return processes


def _read_command(process: int) -> str:
    """Return the name of a process, without characters that could control a terminal."""
    try:
        text = Path(f"/proc/{process}/comm").read_text(errors="replace").strip()
    except OSError:
        return "unknown"
    return "".join(character for character in text if character.isprintable()) or "unknown"
