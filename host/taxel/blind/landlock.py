"""Landlock of the Linux kernel: restricts this process to listed files, without programs and network connections.

Unlike an audit hook, Landlock also restricts C code, such as HDF5. Source of the system calls and constants:
linux/landlock.h and Documentation/userspace-api/landlock.rst of the kernel.
"""

import ctypes
import os
import struct
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Final

CREATE_RULESET, ADD_RULE, RESTRICT_SELF = 444, 445, 446
VERSION_FLAG, PATH_BENEATH, NO_NEW_PRIVILEGES = 1, 1, 38

WRITE_FILE, READ_FILE, READ_DIR, TRUNCATE = 1 << 1, 1 << 2, 1 << 3, 1 << 14

FILE_RIGHTS: Final = (13, 14, 15, 15, 16)
"""Number of file access rights in versions 1 to 5 of the interface; version 5 and above have the last value."""

NETWORK, SCOPES = 0b11, 0b11
"""Rights to bind and connect TCP sockets (version 4); scopes of abstract sockets and signals (version 6)."""

ON_FILES: Final = WRITE_FILE | READ_FILE | TRUNCATE
"""Rights that a rule for a single file can grant."""


def version() -> int:
    """Return the version of the kernel's Landlock interface (file restrictions of a process); 0 if there is none."""
    if sys.platform != "linux":
        return 0
    return max(_call(CREATE_RULESET, None, 0, VERSION_FLAG), 0)


def restrict(readable: Iterable[Path], writable: Iterable[Path]) -> bool:
    """Restrict the files of this thread and its future threads irrevocably with Landlock, a function of Linux.

    readable: files, and folders with their content, that can be read. writable: files and folders that can also be
    written. Nonexistent paths are ignored. No program can be started, because bit 0 of the rights, the execution of
    files, is granted nowhere. Returns whether the restriction is in force: False if the kernel has no Landlock or
    rejects a part of the restriction. TCP connections (interface version 4) and signals to other processes (version 6)
    are also denied.
    """
    interface = version()
    if not interface:
        return False
    all_rights = (1 << FILE_RIGHTS[min(interface, len(FILE_RIGHTS)) - 1]) - 1
    attributes = [all_rights, *([NETWORK] if interface >= 4 else []), *([SCOPES] if interface >= 6 else [])]
    packed = struct.pack(f"={len(attributes)}Q", *attributes)
    rules = _call(CREATE_RULESET, packed, len(packed), 0)
    if rules < 0:
        return False
    try:
        is_granted = all(
            (
                *(_grant(rules, path, READ_FILE | READ_DIR) for path in readable),
                *(_grant(rules, path, all_rights & ~1) for path in writable),
            )
        )
        return is_granted and _set_no_new_privileges() and _call(RESTRICT_SELF, rules, 0) == 0
    finally:
        os.close(rules)


def _grant(rules: int, path: Path, rights: int) -> bool:
    """Add a Landlock rule that permits `rights` on a path and everything below it; False if the kernel refuses.

    rules: file descriptor of the rule set. rights: bit mask. An absent path is ignored.
    """
    if not path.exists():
        return True
    beneath = os.open(path, os.O_PATH | os.O_CLOEXEC)
    try:
        applicable = rights if path.is_dir() else rights & ON_FILES
        return _call(ADD_RULE, rules, PATH_BENEATH, struct.pack("=Qi", applicable, beneath), 0) == 0
    finally:
        os.close(beneath)


def _set_no_new_privileges() -> bool:
    """Give up the possibility to gain privileges, which Landlock requires of an unprivileged process."""
    return int(ctypes.CDLL(None).prctl(NO_NEW_PRIVILEGES, *map(ctypes.c_ulong, (1, 0, 0, 0)))) == 0


def _call(number: int, *arguments: int | bytes | None) -> int:
    """Make a Linux system call that has no function in the C library; returns its result, or -1 on failure.

    number: of the system call.
    """
    converted = [ctypes.c_long(argument) if isinstance(argument, int) else argument for argument in arguments]
    return int(ctypes.CDLL(None, use_errno=True).syscall(ctypes.c_long(number), *converted))
