"""End of a command by the signal SIGTERM: with cleanup if possible, and in any case within seconds."""

import contextlib
import ctypes
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

from taxel.errors import TaxelError
from taxel.native_library.loading import load_library

GRACE_S: Final = 5.0
"""Time between SIGTERM and the end of a process whose Python code does not run, seconds. Python handles a signal only
between two instructions; a call of a library that waits for a device or a file server may never return.
"""

LOCKED_S: Final = 10
"""Time between SIGTERM and the end of a process in which no other thread runs either, seconds: a library holds the lock
of the interpreter, as HDF5 does in an endless loop over a damaged file. The kernel ends the process (SIGALRM).
"""

STATUS: Final = 128 + signal.SIGTERM
"""Exit status of a process that was ended without its cleanup, as a shell reports it for the signal."""


@contextmanager
def interrupted_by_sigterm(grace_s: float = GRACE_S) -> Iterator[None]:
    """Handle the signal SIGTERM like Ctrl-C inside the block, so that a stopped service closes its files.

    The process ends without cleanup in three cases: the handler has not run `grace_s` seconds after the signal, no
    Python code at all runs for `LOCKED_S` seconds after the signal, or a second SIGTERM arrives. The previous handler
    is restored at the end, because a program that runs a command in its own process may have started child processes
    that must end at SIGTERM.
    """
    if threading.current_thread() is not threading.main_thread():  # only the main thread may set a signal handler
        yield
        return
    with _watch(grace_s) as is_handled:

        def interrupt(number: int, frame: FrameType | None) -> None:
            """Handle SIGTERM: stop the timers that would end the process, and raise KeyboardInterrupt.

            A second SIGTERM ends the process at once.
            """
            if is_handled.is_set():
                os._exit(STATUS)
            is_handled.set()
            signal.alarm(0)
            signal.default_int_handler(number, frame)

        previous = signal.signal(signal.SIGTERM, interrupt)
        try:
            with _start_timer_by_sigterm():
                yield
        finally:
            signal.signal(signal.SIGTERM, signal.SIG_DFL if previous is None else previous)


@contextmanager
def _watch(grace_s: float) -> Iterator[threading.Event]:
    """Start a thread that ends the process if a SIGTERM is not handled; yield the event that the handler sets.

    The interpreter writes the number of each signal to a pipe before any handler runs (`signal.set_wakeup_fd`). The
    thread therefore receives a SIGTERM even while the main thread cannot run the handler.
    """
    is_handled = threading.Event()
    reader, writer = os.pipe2(os.O_CLOEXEC)
    os.set_blocking(writer, False)
    # A forked process shares the pipe; its signals must not end this process.
    os.register_at_fork(after_in_child=_forget_pipe)
    previous = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    thread = threading.Thread(target=_end_unhandled, args=(reader, is_handled, grace_s), daemon=True)
    thread.start()
    try:
        yield is_handled
    finally:
        signal.set_wakeup_fd(previous)
        os.close(writer)  # ends the thread


@contextmanager
def _start_timer_by_sigterm() -> Iterator[None]:
    """Context manager: SIGTERM also starts a timer of the kernel, which ends the process after `LOCKED_S` seconds.

    A handler in C starts the timer. The handler runs at once, even if no Python code runs.
    """
    try:
        library = load_library("taxel_termination", "the handler of SIGTERM", TaxelError)
    except TaxelError:  # an incomplete installation still runs its commands
        yield
        return
    library.termination_watch(ctypes.c_int(signal.SIGTERM), ctypes.c_uint(LOCKED_S))
    try:
        yield
    finally:
        library.termination_unwatch()


def _forget_pipe() -> None:
    """Stop writing the signals of a forked process to the pipe of its parent process."""
    with contextlib.suppress(ValueError):
        signal.set_wakeup_fd(-1)


def _end_unhandled(reader: int, is_handled: threading.Event, grace_s: float) -> None:
    """End the process after a SIGTERM that is not handled within `grace_s` seconds, and at a second SIGTERM."""
    terminations = 0
    while signals := os.read(reader, 64):
        terminations += signals.count(signal.SIGTERM)
        if terminations > 1 or (terminations and not is_handled.wait(grace_s)):
            os._exit(STATUS)
    os.close(reader)
