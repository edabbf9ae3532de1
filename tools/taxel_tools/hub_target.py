"""The hub as a device that receives firmware: on one link, its application uses frames and its bootloader packets."""

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
from taxel_tools.procedure import Procedure, Version
from taxel_tools.session import RESTART_TIMEOUT_S, BootInfo, BootSession

FRAME_WAIT_S: Final = 0.02
POLL_TIMEOUT_S: Final = 3.0
"""Time until the hub polls every board again: after a start, the hub first runs a bus scan."""
POLL_CYCLES_S: Final = 0.1
"""Time in which a hub without boards completes several poll cycles."""


class HubTarget:
    """A `Target` for the hub. Run its procedures on `wire`.

    Frames and packets alternate on `link`, which the caller owns. `polled_addresses`: boards that the hub polled before
    the update; the hub must poll them afterwards too.
    """

    address = HUB
    device_name = "hub"

    def __init__(self, link: Link) -> None:
        """Create the access for a firmware update of the hub over its UART `link`."""
        self.wire = HubPackets(link)
        self.now_s = self.wire.now_s
        self.session = BootSession(HUB, self.now_s)
        self.session.row_write_s = 0.0  # The hub's bootloader responds after the row has been written.
        self.polled_addresses: list[int] = []
        self._link = link
        self._client: HubClient | None = None

    def read_version(self) -> Procedure[Version | None]:
        """Read the firmware version of the hub; None if the hub is in its bootloader.

        Stops the frames of a running hub, and stores the addresses of the boards that it polls. Raises `HubError`
        without an answer.
        """
        if (yield from self.read_bootloader_info()) is not None:
            return None
        client = self._open_client()
        client.stop()
        client.read_boards()
        self.polled_addresses = sorted(client.boards)
        return _read_firmware_version(client)

    def read_bootloader_info(self) -> Procedure[BootInfo | None]:
        """Read the information of the hub's bootloader; None if the bootloader does not run.

        An interrupted update leaves the bootloader active.
        """
        self._switch_to_packets()
        for _ in range(2):
            with suppress(BoardError):
                return (yield from self.session.read_info())
        return None

    def enter(self) -> Procedure[None]:
        """Restart the hub into its bootloader and start a session. Raises `HubError`, `BoardError`."""
        refusal: HubError | None = None
        if self._client is not None:
            key = pack(EnterBootloaderArguments, {"key": BOOTLOADER_KEY})
            try:
                self._client.command(Command.ENTER_BOOTLOADER, key)
            except HubError as error:  # The command may have worked although its reply was lost.
                refusal = error
        self._switch_to_packets()
        deadline = self.now_s() + RESTART_TIMEOUT_S
        while True:
            try:
                yield from self.session.start_session()
                return
            except (TransferError, BoardError) as error:
                if isinstance(error, StatusError) or self.now_s() > deadline:
                    raise refusal or error from None

    def wait_for_application(self, timeout_s: float) -> Procedure[Version | None]:
        """Repeat the handshake until the hub answers. Returns its firmware version, or None after `timeout_s`
        seconds.
        """
        yield from ()  # makes this method a generator, as the type `Procedure` requires
        deadline = self.now_s() + timeout_s
        while self.now_s() < deadline:
            with suppress(HubError):
                return _read_firmware_version(self._open_client())
        return None

    def trigger_confirmation(self, timeout_s: float) -> Procedure[None]:
        """Start polling and read frames of the hub, so that its new firmware image confirms itself.

        Raises `BoardError`, `HubError`.
        """
        yield from ()  # makes this method a generator, as the type `Procedure` requires
        client = self._open_client()
        missing = set(self.polled_addresses)
        deadline = self.now_s() + min(timeout_s, POLL_TIMEOUT_S)
        client.start()
        client.wait(POLL_CYCLES_S)
        while True:
            missing -= {frame.address for frame in client.stream.frames}
            client.stream.frames.clear()
            if not missing or self.now_s() > deadline:
                break
            client.stream.poll(FRAME_WAIT_S)
        client.stop()
        if missing:
            names = ", ".join(f"0x{address:02X}" for address in sorted(missing))
            raise BoardError(HUB, f"does not poll {names} any more; check the power of these boards with taxel scan")

    def check_operation(self) -> Procedure[None]:
        """Check after an update that the hub polls the same boards as before."""
        return self.trigger_confirmation(POLL_TIMEOUT_S)

    def _open_client(self) -> HubClient:
        """Return the client for the application of the hub, after a successful handshake."""
        if self._client is None:
            self._client = self.wire.frame_client = HubClient(self._link)
        if not self._client.has_handshake:
            self._client.handshake()
        return self._client

    def _switch_to_packets(self) -> None:
        """Stop the reading of frames of the application, so that packets of the bootloader can be exchanged."""
        if self._client is not None:
            self._client.stream.release()
            self._client = self.wire.frame_client = None
        self.wire.drain()


def _read_firmware_version(client: HubClient) -> Version:
    """Return the firmware version of the hub (major, minor, patch) from its last handshake."""
    handshake = client.last_handshake
    assert handshake is not None
    return handshake["firmware_major"], handshake["firmware_minor"], handshake["firmware_patch"]
