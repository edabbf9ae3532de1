"""Fixtures of the link tests: a pseudo-terminal, a reader, a small world, and the list of running emulators."""

import os
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import Link

TIMEOUT_S = 20.0


class Terminal:
    """A raw pseudo-terminal: the client opens the path `name`; the test acts as device on the descriptor `master`."""

    def __init__(self) -> None:
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.name = os.ttyname(self._slave)

    def unplug(self) -> None:
        """Unplug the device: close both ends. A second call has no effect."""
        for descriptor in (self._slave, self.master):
            if descriptor >= 0:
                os.close(descriptor)
        self._slave = self.master = -1


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    """A pseudo-terminal, unplugged after the test."""
    pty = Terminal()
    yield pty
    pty.unplug()


@pytest.fixture
def read_bytes() -> Callable[[Link, int], bytes]:
    """Function that reads the given number of bytes from a link; after TIMEOUT_S, it returns the bytes so far."""

    def read(link: Link, size: int) -> bytes:
        data = b""
        deadline = time.monotonic() + TIMEOUT_S
        while len(data) < size and time.monotonic() < deadline:
            chunk = link.read(0.1)
            data += chunk.data if chunk else b""
        return data

    return read


@pytest.fixture
def small_world() -> str:
    """World file of one board of 64 taxels."""
    return format_world(load_hand("flat8"), WorldSettings())


@pytest.fixture
def emulator_processes() -> Callable[[], set[int]]:
    """Function that lists the process ids of the running emulators that this process has started."""

    def list_running() -> set[int]:
        process_ids = set()
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    stat = (entry / "stat").read_text()
                except OSError:
                    continue  # the process has ended since the folder was listed
                name, _, fields = stat[stat.index("(") + 1 :].rpartition(") ")
                state, parent = fields.split()[:2]
                if name == "taxel-emulator" and state != "Z" and int(parent) == os.getpid():
                    process_ids.add(int(entry.name))
        return process_ids

    return list_running
