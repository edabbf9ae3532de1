"""Linux' Landlock: from a call on, this process opens, runs and connects to nothing but what is listed.

Unlike an audit hook it holds for C code too, such as HDF5's. System calls and constants: linux/landlock.h and
Documentation/userspace-api/landlock.rst of the kernel.
"""

from __future__ import annotations

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
"""How many rights over files there are, from version 1 of the interface to 5 and above."""

NETWORK, SCOPES = 0b11, 0b11
"""Binding and connecting TCP (version 4); abstract sockets and signals that leave the process (version 6)."""

ON_FILES: Final = WRITE_FILE | READ_FILE | TRUNCATE
"""Rights that a rule about a single file may grant."""


def version() -> int:
    """Of the kernel's interface; 0 where there is none."""
    if sys.platform != "linux":
        return 0
    return max(_call(CREATE_RULESET, None, 0, VERSION_FLAG), 0)


def restrict(readable: Iterable[Path], writable: Iterable[Path]) -> bool:
    """Whether from here on only `readable` is read, only `writable` besides written, and no program started.

    Folders with all below them, or files; what does not exist is left out. False, and nothing has changed, where the
    kernel cannot do it. It cannot be undone, and holds for this thread and those that it starts.
    """
    known = version()
    if not known:
        return False
    every = (1 << FILE_RIGHTS[min(known, len(FILE_RIGHTS)) - 1]) - 1
    attributes = [every, *([NETWORK] if known >= 4 else []), *([SCOPES] if known >= 6 else [])]
    packed = struct.pack(f"={len(attributes)}Q", *attributes)
    rules = _call(CREATE_RULESET, packed, len(packed), 0)
    if rules < 0:
        return False
    try:
        granted = all(
            (
                *(_grant(rules, path, READ_FILE | READ_DIR) for path in readable),
                *(_grant(rules, path, every & ~1) for path in writable),
            )
        )
        return granted and _prctl() and _call(RESTRICT_SELF, rules, 0) == 0
    finally:
        os.close(rules)


def _grant(rules: int, path: Path, rights: int) -> bool:
    if not path.exists():
        return True
    beneath = os.open(path, os.O_PATH | os.O_CLOEXEC)
    try:
        own = rights if path.is_dir() else rights & ON_FILES
        return _call(ADD_RULE, rules, PATH_BENEATH, struct.pack("=Qi", own, beneath), 0) == 0
    finally:
        os.close(beneath)


def _prctl() -> bool:
    """An unprivileged process must give up ever gaining privileges first."""
    return int(ctypes.CDLL(None).prctl(NO_NEW_PRIVILEGES, *map(ctypes.c_ulong, (1, 0, 0, 0)))) == 0


def _call(number: int, *arguments: int | bytes | None) -> int:
    """A system call that the C library has no name for; -1 if it fails."""
    words = [ctypes.c_long(one) if isinstance(one, int) else one for one in arguments]
    return int(ctypes.CDLL(None, use_errno=True).syscall(ctypes.c_long(number), *words))
