"""The hub as what is given new firmware: its application speaks frames, its bootloader packets, on one link."""

from __future__ import annotations

from contextlib import suppress
from typing import Final

from taxel.link import Link
from taxel.stream import HubClient, HubError
from taxel_protocol import Command
from taxel_protocol.frames import EnterBootloaderArguments
from taxel_protocol.layout import pack
from taxel_protocol.limits import BOOTLOADER_KEY
from taxel_tools.errors import HUB, BoardError, StatusError, TransferError
from taxel_tools.hub_packets import HubPackets
from taxel_tools.session import RESTART_S, BootInfo, BootSession
from taxel_tools.procedure import Procedure, Version

POLL_S: Final = 0.02
POLLED_S: Final = 3.0
"""Until the hub polls every board that it polled before: it sweeps the bus when it has started."""
CYCLES_S: Final = 0.1
"""In which a hub without boards makes some poll cycles."""


class HubTarget:
    """A `Target`: frames and packets take turns on `link`, which stays the caller's. Run its steps over `wire`.

    `boards`: addresses that the hub polled before; they must be polled afterwards too.
    """

    address = HUB
    noun = "hub"

    def __init__(self, link: Link) -> None:
        self.wire = HubPackets(link)
        self.now_s = self.wire.now_s
        self.session = BootSession(HUB, self.now_s)
        self.session.row_write_s = 0.0  # the response to a row comes by itself when it is written
        self.boards: list[int] = []
        self._link = link
        self._client: HubClient | None = None

    def version(self) -> Procedure[Version | None]:
        """Of the application; None if the hub is in its bootloader. Raises `HubError` if nobody answers."""
        if (yield from self.bootloader()) is not None:
            return None
        client = self._client_after_handshake()
        client.stop()
        client.read_boards()
        self.boards = sorted(client.boards)
        return _version_of(client)

    def bootloader(self) -> Procedure[BootInfo | None]:
        """What the bootloader says, if it runs: an update that was cut off leaves it waiting."""
        self._packets()
        for _ in range(2):
            with suppress(BoardError):
                return (yield from self.session.info())
        return None

    def enter(self) -> Procedure[None]:
        """Lead the application into its bootloader, and begin a session. Raises `HubError`, `BoardError`."""
        refusal: HubError | None = None
        if self._client is not None:
            key = pack(EnterBootloaderArguments, {"key": BOOTLOADER_KEY})
            try:
                self._client.command(Command.ENTER_BOOTLOADER, key)
            except HubError as error:  # or only its answer was lost: the bootloader tells
                refusal = error
        self._packets()
        deadline = self.now_s() + RESTART_S
        while True:
            try:
                yield from self.session.enter_here()
                return
            except (TransferError, BoardError) as error:
                if isinstance(error, StatusError) or self.now_s() > deadline:
                    raise refusal or error from None

    def wait_for_application(self, patience_s: float) -> Procedure[Version | None]:
        """Repeat the handshake until a hub answers; None after a timeout."""
        yield from ()
        deadline = self.now_s() + patience_s
        while self.now_s() < deadline:
            with suppress(HubError):
                return _version_of(self._client_after_handshake())
        return None

    def confirm(self, patience_s: float) -> Procedure[None]:
        """Do what a new image waits for: let it poll its boards, and read its UART. Raises `BoardError`, `HubError`."""
        yield from ()
        client = self._client_after_handshake()
        missing = set(self.boards)
        deadline = self.now_s() + min(patience_s, POLLED_S)
        client.start()
        client.wait(CYCLES_S)
        while True:
            missing -= {frame.address for frame in client.stream.frames}
            client.stream.frames.clear()
            if not missing or self.now_s() > deadline:
                break
            client.stream.poll(POLL_S)
        client.stop()
        if missing:
            names = ", ".join(f"0x{address:02X}" for address in sorted(missing))
            raise BoardError(HUB, f"does not poll {names} any more; look at taxel scan, and at the boards' power")

    def settle(self) -> Procedure[None]:
        """See the boards polled again."""
        return self.confirm(POLLED_S)

    def _client_after_handshake(self) -> HubClient:
        if self._client is None:
            self._client = self.wire.frames = HubClient(self._link)
        if not self._client.has_handshake:
            self._client.handshake()
        return self._client

    def _packets(self) -> None:
        if self._client is not None:
            self._client.stream.release()
            self._client = self.wire.frames = None
        self.wire.drain()


def _version_of(client: HubClient) -> Version:
    handshake = client.last_handshake
    assert handshake is not None
    return handshake["firmware_major"], handshake["firmware_minor"], handshake["firmware_patch"]
