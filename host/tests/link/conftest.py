"""What the tests of links share: a hub's end of a pseudo-terminal, a small world, and the emulators that still run."""

import os
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import Link

PATIENCE_S = 20.0


class Terminal:
    """A raw pseudo-terminal: `name` for the client, `master` for the test, which plays the device."""

    def __init__(self) -> None:
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.name = os.ttyname(self._slave)

    def vanish(self) -> None:
        """Unplug the device. May be called twice."""
        for descriptor in (self._slave, self.master):
            if descriptor >= 0:
                os.close(descriptor)
        self._slave = self.master = -1


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    pty = Terminal()
    yield pty
    pty.vanish()


@pytest.fixture
def read_bytes() -> Callable[[Link, int], bytes]:
    """Read so many bytes of a link, or whatever has come when patience ends."""

    def read(link: Link, size: int) -> bytes:
        data = b""
        deadline = time.monotonic() + PATIENCE_S
        while len(data) < size and time.monotonic() < deadline:
            chunk = link.read(0.1)
            data += chunk.data if chunk else b""
        return data

    return read


@pytest.fixture
def small_world() -> str:
    """One board of 64 taxels."""
    return format_world(load_hand("flat8"), WorldSettings())


@pytest.fixture
def emulators() -> Callable[[], set[int]]:
    """Process ids of the emulators that this process has started and that have not ended."""

    def running() -> set[int]:
        found = set()
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    stat = (entry / "stat").read_text()
                except OSError:
                    continue  # it has ended meanwhile
                name, _, rest = stat[stat.index("(") + 1 :].rpartition(") ")
                state, parent = rest.split()[:2]
                if name == "taxel-emulator" and state != "Z" and int(parent) == os.getpid():
                    found.add(int(entry.name))
        return found

    return running
