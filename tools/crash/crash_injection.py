"""One run of a writer in a child process with a fault at a chosen call; needs the shim in LD_PRELOAD."""

import ctypes
import os
import select
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path

from taxel.errors import TaxelError

TIMEOUT_S = 60.0
"""A writer without fault takes less than a second; a run of this length counts as a hang."""


class Mode(IntEnum):
    """Faults of fault_shim.c."""

    COUNT = 0
    KILL = 1
    KILL_TORN = 2
    FULL = 3
    FULL_ONCE = 4
    BROKEN = 5
    BROKEN_ONCE = 6

    @property
    def is_kill(self) -> bool:
        """Whether the process is killed."""
        return self in (Mode.KILL, Mode.KILL_TORN)


FAULTS = tuple(mode for mode in Mode if mode is not Mode.COUNT)


@dataclass
class RunResult:
    """End of a child process.

    Attributes:
        status: exit status; negative: number of the signal that ended the process.
        acknowledged: values that the writer passed on after each complete record.
        calls: names of the counted calls, in the mode COUNT.
        errors: standard error.
        is_hung: the process was ended after `TIMEOUT_S`.
    """

    status: int
    acknowledged: list[str] = field(default_factory=list)
    calls: list[str] = field(default_factory=list)
    errors: str = ""
    is_hung: bool = False


class ChildExitError(SystemExit):
    """Ends a child process through the normal end of the interpreter, so that libraries run their last calls."""


class Injector:
    """Starts writers in child processes of this process."""

    def __init__(self, shim: Path) -> None:
        """Load the functions of the shim, which LD_PRELOAD has already loaded into this process."""
        library = ctypes.CDLL(str(shim))
        self._arm, self._disarm = library.taxel_fault_arm, library.taxel_fault_disarm
        self._arm.argtypes = (ctypes.c_char_p, ctypes.c_long, ctypes.c_int)
        self._disarm.restype = ctypes.c_long
        self._name = library.taxel_fault_name
        self._name.argtypes, self._name.restype = (ctypes.c_long,), ctypes.c_char_p

    def run(
        self, write: Callable[[Callable[[], None]], None], folder: Path, call: int, mode: Mode,
        state: Callable[[], object],
    ) -> RunResult:  # fmt: skip
        """Run `write` in a child process, with a fault at one of the calls that change a file below `folder`.

        write: writer; it receives a function that it must call after each complete record (acknowledgement). call:
        number of the call with the fault, from 1; 0: no fault. state: returns the value that is passed on with each
        acknowledgement; called only in the mode COUNT. The parent returns the result. In the child the method ends with
        ChildExitError, which the caller must not catch.
        """
        progress, errors = os.pipe(), os.pipe()
        child = os.fork()
        if child:
            os.close(progress[1])
            os.close(errors[1])
            return _collect(child, progress[0], errors[0])
        os.close(progress[0])
        os.close(errors[0])
        os.dup2(errors[1], 2)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)

        def acknowledge() -> None:
            os.write(progress[1], f"ack {state() if mode is Mode.COUNT else ''}\n".encode())

        self._arm(os.fsencode(folder), call, int(mode))
        status = 0
        try:
            write(acknowledge)
        except (TaxelError, OSError) as error:  # as the program `taxel` does
            text = (
                f"{error.filename}: {error.strerror}" if isinstance(error, OSError) and error.filename else str(error)
            )
            print(f"taxel: {text}", file=sys.stderr)
            status = 1
        if mode is Mode.COUNT:
            names = [self._name(number + 1).decode() for number in range(self._disarm())]
            os.write(progress[1], f"calls {' '.join(names)}\n".encode())
        raise ChildExitError(status)


def _collect(child: int, progress: int, errors: int) -> RunResult:
    """Read the pipes of a child process until it ends, and return its result; a child that hangs is killed.

    progress, errors: descriptors of the pipes for acknowledgements and for standard error.
    """
    texts = {progress: b"", errors: b""}
    opened = set(texts)
    end_s = time.monotonic() + TIMEOUT_S
    is_hung = False
    while opened:
        ready, _, _ = select.select(list(opened), [], [], max(0.0, end_s - time.monotonic()))
        if not ready:
            is_hung = True
            os.kill(child, signal.SIGKILL)
            end_s = time.monotonic() + TIMEOUT_S
        for descriptor in ready:
            data = os.read(descriptor, 65_536)
            texts[descriptor] += data
            if not data:
                os.close(descriptor)
                opened.discard(descriptor)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    lines = texts[progress].decode().splitlines()
    acknowledged = [line.removeprefix("ack ") for line in lines if line.startswith("ack ")]
    calls = next((line.split()[1:] for line in lines if line.startswith("calls")), [])
    return RunResult(status, acknowledged, calls, texts[errors].decode(errors="replace"), is_hung)
