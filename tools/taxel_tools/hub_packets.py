"""The hub's bootloader on its UART, with the interface of a bus: a write sends a packet, a read returns the response.

Because of this interface `session.py` serves the bootloaders of the boards and of the hub. The bootloader accepts one
packet at a time, so a write ends when the response has arrived.
"""

from typing import Final

from taxel.link import Link, get_clock
from taxel.stream import HubClient
from taxel_protocol.bootloader import BOOT_PACKET_MAX, BOOT_PACKET_OVERHEAD, BOOT_PACKET_START, BootCommand
from taxel_protocol.bootloader_packets import parse_packet
from taxel_tools.errors import LostError, TransferError
from taxel_tools.procedure import Transfer
from taxel_tools.wires import WAIT_MIN_S, CompletedTransfer

RESPONSE_TIMEOUT_S: Final = 0.3
"""A response that takes longer is lost: 20 ms for a row, twice the USB latency, and the 50 ms after which the
bootloader discards an incomplete packet."""
NO_RESPONSE_PAUSE_S: Final = 0.005
"""Pause after a packet without a response."""
DRAIN_QUIET_S: Final = 0.02
DRAIN_TIMEOUT_S: Final = 0.3
"""Longest wait for DRAIN_QUIET_S without received bytes."""

_WITHOUT_RESPONSE: Final = {BootCommand.SYNC, BootCommand.EXIT}


class HubPackets:
    """A bus with one device, the hub's bootloader at the address `HUB`. The caller owns the link."""

    is_queued = False

    def __init__(self, link: Link) -> None:
        """Create the access to the bootloader of the hub, whose packets are sent directly over the UART `link`."""
        self.name = link.name
        self.now_s = get_clock(link)
        self._link = link
        self._number = 0
        self._completed: list[CompletedTransfer] = []
        self._response = b""
        self.frame_client: HubClient | None = None
        """The client that reads the link while the application runs. Waiting then reads through this client, so that no
        bytes of frames are lost."""

    def submit(self, transfer: Transfer) -> int:
        """Send the bytes of a transfer as a packet to the hub's bootloader, and wait for the response.

        Returns the number under which `collect` returns the response.
        """
        self._number += 1
        self._completed.append((self._number, self._run_transfer(transfer)))
        return self._number

    def collect(self, timeout_s: float) -> list[CompletedTransfer]:
        """Return the answered packets since the last call, as numbers with responses or errors.

        If there are none, waits `timeout_s` first.
        """
        if not self._completed:
            self._wait(timeout_s)
        completed, self._completed = self._completed, []
        return completed

    def scan(self) -> list[int]:
        """Return an empty list, as the hub's bootloader has no bus."""
        return []

    def close(self) -> None:
        """Do nothing, as the caller owns the link."""

    def drain(self) -> None:
        """Discard bytes from the hub that are still in flight."""
        deadline = self.now_s() + DRAIN_TIMEOUT_S
        while self._link.read(DRAIN_QUIET_S) is not None and self.now_s() < deadline:
            pass

    def _run_transfer(self, transfer: Transfer) -> bytes | TransferError:
        """Send the bytes of a transfer as a packet. Returns the response of the hub's bootloader, or an error.

        The response is padded to `read_size` with 0xFF, the byte that a board without a response returns on I2C.
        """
        if transfer.write and not self._send(transfer.write):
            return LostError(transfer.address, f"the bootloader does not answer on {self.name}")
        return self._response[: transfer.read_size].ljust(transfer.read_size, b"\xff")

    def _send(self, packet: bytes) -> bool:
        """Send a packet to the hub's bootloader and store its response.

        Returns whether a response arrived, and True for commands without a response. Bytes that arrived before are
        discarded.
        """
        self._response = b""
        while self._link.read(0.0) is not None:
            pass
        self._link.write(packet)
        if packet[1] in _WITHOUT_RESPONSE:
            self._wait(NO_RESPONSE_PAUSE_S)
            return True
        received = b""
        deadline = self.now_s() + RESPONSE_TIMEOUT_S
        while not self._response and (remaining_s := deadline - self.now_s()) > 0.0:
            chunk = self._link.read(max(remaining_s, WAIT_MIN_S))
            received += chunk.data if chunk is not None else b""
            self._response = _find_packet(received)
        return bool(self._response)

    def _wait(self, seconds: float) -> None:
        """Wait, and read the bytes that arrive from the hub meanwhile.

        They are processed by `frame_client` if there is one; otherwise they are discarded.
        """
        if self.frame_client is not None:
            self.frame_client.wait(seconds)
            return
        deadline = self.now_s() + max(seconds, WAIT_MIN_S)
        while (remaining_s := deadline - self.now_s()) > 0.0:
            self._link.read(max(remaining_s, WAIT_MIN_S))


def _find_packet(received: bytes) -> bytes:
    """Return the first complete packet in `received`; b"" if there is none.

    Bytes before the packet, such as half a frame, are skipped.
    """
    start = received.find(BOOT_PACKET_START)
    while start >= 0:
        packet = received[start : start + BOOT_PACKET_MAX]
        if len(packet) >= BOOT_PACKET_OVERHEAD:
            try:
                data = parse_packet(packet)[1]
                return packet[: BOOT_PACKET_OVERHEAD + len(data)]
            except ValueError:
                pass  # The packet is still incomplete, or these bytes are not a packet.
        start = received.find(BOOT_PACKET_START, start + 1)
    return b""
