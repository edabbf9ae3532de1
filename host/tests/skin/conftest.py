"""Fixtures of the skin tests: hands, known counts of their taxels, and fake hubs with prepared answers."""

import os
import select
import threading
import tty
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.hand import Hand, load_hand
from taxel_protocol import Command, FrameType, ReferenceDecoder, encode_frame
from taxel_protocol.frames import FRAMES, HubHandshake, Reply
from taxel_protocol.layout import pack, unpack


@pytest.fixture(scope="session")
def allegro() -> Hand:
    return load_hand("allegro")


@pytest.fixture(scope="session")
def flat8() -> Hand:
    return load_hand("flat8")


@pytest.fixture(scope="session")
def known_counts() -> Callable[[Hand], NDArray[np.uint16]]:
    """Function of a hand: raw counts u16[n] that differ between all its taxels."""

    def make_counts(hand: Hand) -> NDArray[np.uint16]:
        return (1000 + 37 * np.arange(hand.n_taxels)).astype(np.uint16)

    return make_counts


class FakeHub:
    """A hub on a pseudo-terminal.

    The hub answers a handshake with the given protocol versions and every command with status OK, and sends the
    bytes `on_start` after the command START. `commands`: codes of all received commands.
    """

    def __init__(
        self, version_chosen: int = 1, version_min: int = 1, version_max: int = 1, on_start: bytes = b""
    ) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.url = f"serial://{os.ttyname(self._slave)}"
        self._versions = {"version_min": version_min, "version_max": version_max, "version_chosen": version_chosen}
        self._on_start = on_start
        self._sequence = 0
        self.commands: list[int] = []
        self._is_closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _encode_next_frame(self, kind: FrameType, payload: bytes) -> bytes:
        """Encode a frame with the hub's next sequence number."""
        self._sequence += 1
        return encode_frame(kind, self._sequence - 1, payload)

    def _serve(self) -> None:
        """Answer all frames of the host until the hub is unplugged (function of the thread)."""
        decoder = ReferenceDecoder()
        while not self._is_closing.is_set():
            if not select.select([self._master], [], [], 0.02)[0]:
                continue
            for kind, _, payload in decoder.push(os.read(self._master, 4096)):
                self._answer(FrameType(kind), payload)

    def _answer(self, kind: FrameType, payload: bytes) -> None:
        """Answer a handshake or a command of the host; ignore other frames."""
        if kind is FrameType.HOST_HANDSHAKE:
            fields = dict.fromkeys(("reset_cause", "firmware_major", "firmware_minor", "firmware_patch"), 0)
            fields |= {"uptime_us": 0}
            fields |= {"tag": payload[0], "unique_id": bytes(8)} | self._versions
            os.write(self._master, self._encode_next_frame(FrameType.HUB_HANDSHAKE, pack(HubHandshake, fields)))
        elif kind is FrameType.COMMAND:
            fields, _ = unpack(FRAMES[kind].payload, payload)
            self.commands.append(fields["command"])
            reply = pack(Reply, {"tag": fields["tag"], "command": fields["command"], "status": 0})
            os.write(self._master, self._encode_next_frame(FrameType.REPLY, reply))
            if fields["command"] == Command.START:
                os.write(self._master, self._on_start)

    def unplug(self) -> None:
        """Unplug the hub. A second call has no effect."""
        self._is_closing.set()
        self._thread.join()
        for descriptor in (self._slave, self._master):
            if descriptor >= 0:
                os.close(descriptor)
        self._slave = self._master = -1


@pytest.fixture
def fake_hub() -> Iterator[Callable[..., FakeHub]]:
    """Function that starts a `FakeHub` with the given options; all hubs are unplugged after the test."""
    hubs: list[FakeHub] = []

    def make(**options: object) -> FakeHub:
        hubs.append(FakeHub(**options))  # type: ignore[arg-type]
        return hubs[-1]

    yield make
    for hub in hubs:
        hub.unplug()


@pytest.fixture
def silent_port() -> Iterator[str]:
    """URL of a port without a hub."""
    master, slave = os.openpty()
    tty.setraw(slave)
    yield f"serial://{os.ttyname(slave)}"
    os.close(master)
    os.close(slave)
