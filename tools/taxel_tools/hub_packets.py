"""The hub's bootloader on its UART, with the manners of a bus: a write sends a packet, a read gives what it answered.

So a talk with a board's bootloader (`session.py`) is a talk with the hub's too. The bootloader takes one packet at a
time: a write ends when its response has come.
"""

from __future__ import annotations

from typing import Final

from taxel.link import Link, clock_of
from taxel.stream import HubClient
from taxel_protocol.bootloader import (
    BOOT_PACKET_MAX,
    BOOT_PACKET_OVERHEAD,
    BOOT_PACKET_START,
    BootCommand,
    parse_packet,
)
from taxel_tools.errors import LostError, TransferError
from taxel_tools.steps import Transfer
from taxel_tools.wires import GRAIN_S, Ended

RESPONSE_S: Final = 0.3
"""A response that has not come by then is lost: 20 ms for a row, two USB latencies, and the 50 ms after which the
bootloader has dropped half a packet."""
SILENT_S: Final = 0.005
"""What is left to a packet that has no response, before the next one."""
QUIET_S: Final = 0.02
DRAIN_S: Final = 0.3
"""At most so long is waited for QUIET_S of silence."""

_SILENT: Final = {BootCommand.SYNC, BootCommand.EXIT}


class HubPackets:
    """A wire with one device on it, the hub's bootloader at the address `HUB`. The link stays the caller's."""

    is_queued = False

    def __init__(self, link: Link) -> None:
        self.name = link.name
        self.now_s = clock_of(link)
        self._link = link
        self._number = 0
        self._ended: list[Ended] = []
        self._response = b""
        self.frames: HubClient | None = None
        """Who reads the link while the application runs: then time goes by with that, or bytes of frames were lost."""

    def submit(self, transfer: Transfer) -> int:
        """Send the packet and wait for its response now."""
        self._number += 1
        self._ended.append((self._number, self._make(transfer)))
        return self._number

    def collect(self, timeout_s: float) -> list[Ended]:
        """What has been done; waits if nothing has."""
        if not self._ended:
            self._pass(timeout_s)
        ended, self._ended = self._ended, []
        return ended

    def scan(self) -> list[int]:
        """There is no bus."""
        return []

    def close(self) -> None:
        """The link is the caller's."""

    def drain(self) -> None:
        """Throw away what was still on its way."""
        deadline = self.now_s() + DRAIN_S
        while self._link.read(QUIET_S) is not None and self.now_s() < deadline:
            pass

    def _make(self, transfer: Transfer) -> bytes | TransferError:
        if transfer.write and not self._send(transfer.write):
            return LostError(transfer.address, f"its bootloader does not answer on {self.name}")
        return self._response[: transfer.read_size].ljust(transfer.read_size, b"\xff")

    def _send(self, packet: bytes) -> bool:
        """Whether a response came, if there is one."""
        self._response = b""
        while self._link.read(0.0) is not None:
            pass
        self._link.write(packet)
        if packet[1] in _SILENT:
            self._pass(SILENT_S)
            return True
        received = b""
        deadline = self.now_s() + RESPONSE_S
        while not self._response and (left := deadline - self.now_s()) > 0.0:
            chunk = self._link.read(max(left, GRAIN_S))
            received += chunk.data if chunk is not None else b""
            self._response = _packet_in(received)
        return bool(self._response)

    def _pass(self, seconds: float) -> None:
        """Let time go by; what comes meanwhile answers nothing."""
        if self.frames is not None:
            self.frames.wait(seconds)
            return
        deadline = self.now_s() + max(seconds, GRAIN_S)
        while (left := deadline - self.now_s()) > 0.0:
            self._link.read(max(left, GRAIN_S))


def _packet_in(received: bytes) -> bytes:
    """The first whole packet; nothing if there is none yet. Rubbish before it, such as half a frame, is passed over."""
    place = received.find(BOOT_PACKET_START)
    while place >= 0:
        packet = received[place : place + BOOT_PACKET_MAX]
        if len(packet) >= BOOT_PACKET_OVERHEAD:
            try:
                data = parse_packet(packet)[1]
                return packet[: BOOT_PACKET_OVERHEAD + len(data)]
            except ValueError:
                pass  # not whole yet, or not a packet
        place = received.find(BOOT_PACKET_START, place + 1)
    return b""
