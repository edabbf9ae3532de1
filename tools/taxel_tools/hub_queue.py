"""Transfers through the hub with several commands in flight.

The hub executes one command at a time; bytes that arrive meanwhile wait in a ring buffer of 255 bytes
(protocol/SPEC.md). A host that waits for each reply loses the latency of the USB adapter with every transfer. This
queue loses the latency once per full ring buffer or, with hardware flow control, once per few KiB.

The adapter also delays replies of the hub until 62 bytes have accumulated or its latency timer (16 ms) has expired.
When replies are too short to fill a USB packet, the queue sends GET_TIME commands whose replies flush the earlier ones.
"""

from collections import deque
from dataclasses import dataclass
from typing import Final

from taxel.link import Link, get_clock
from taxel.stream import HubClient, HubMessage
from taxel_protocol import Command, FrameType, ReplyStatus, encode_frame
from taxel_protocol.frames import CommandPayload, GetTimeReply, TransferArguments
from taxel_protocol.layout import get_packer, pack
from taxel_protocol.names import LogCode
from taxel_tools.errors import LostError, NackError, TransferError, WireError
from taxel_tools.procedure import Transfer

RING_WINDOW: Final = 255
"""Limit of command bytes without a reply: size of the hub's receive ring buffer."""
FLOW_CONTROL_WINDOW: Final = 3072
"""Limit of command bytes without a reply under flow control.

A serial driver's buffer takes 4096 bytes, so that a write of this size never blocks while replies have to be read.
"""
SAME_BOARD_GAP: Final = 16
"""Bytes of transfers with other boards between two transfers of one board while the first has no reply.

The gap takes 0.36 ms at 400 kHz, in which a bootloader processes a packet. Earlier, the bootloader would not
acknowledge the second packet.
"""
FLUSH_THRESHOLD: Final = 62 + 14
"""Bytes of replies that certainly flush an earlier reply: one USB packet, and one reply of which one byte is still
missing."""
REPLY_TIMEOUT_S: Final = 1.0
"""A command without a reply for this time is lost."""
POLL_STEP_S: Final = 0.0005
"""Duration of one read of the link while replies are due."""


FLUSH: Final = 0
"""Transfer number of a GET_TIME command."""


def _compute_frame_size(payload: bytes) -> int:
    """Compute the number of bytes on the wire of a reply frame with this payload."""
    return len(encode_frame(FrameType.REPLY, 0, payload))


REPLY_SIZE: Final = _compute_frame_size(bytes(3))
FLUSH_REPLY_SIZE: Final = _compute_frame_size(bytes(3 + get_packer(GetTimeReply).size))
TRANSFER_SIZE: Final = len(encode_frame(FrameType.COMMAND, 0, bytes(4)))
FLUSH_SIZE: Final = len(encode_frame(FrameType.COMMAND, 0, bytes(2)))


def _count_flush_commands(expected: int) -> int:
    """Return the number of GET_TIME commands whose replies flush all earlier replies out of the USB adapter.

    expected: bytes of the replies that are due. The adapter delays a packet that is not full, so that the last replies
    would arrive late.
    """
    return max(-((expected - FLUSH_THRESHOLD) // FLUSH_REPLY_SIZE), 0)  # missing bytes / size of a reply, rounded up


@dataclass(slots=True)
class _SentCommand:
    """A command without a reply.

    `number`: number of its transfer, or `FLUSH`. `tag`: tag of its frame. `size`, `reply_size`: bytes of command and
    reply frame. `deadline_s`: time at which it is lost. `handshakes`: handshakes of the queue when it was sent.
    """

    number: int
    transfer: Transfer
    tag: int
    size: int
    reply_size: int
    deadline_s: float
    handshakes: int


class HubQueue(HubClient):
    """Hub client that sends transfers before earlier ones have ended.

    `window`: limit of command bytes without a reply. The limit falls to the size of the hub's ring buffer when the hub
    reports lost bytes: then its RTS line is not connected, although the link was opened with flow control.
    """

    def __init__(self, link: Link) -> None:
        """Create a client of the hub that keeps several I2C transfers in flight over the UART `link`.

        `window`: largest number of unanswered bytes, limited by the receive buffer of the hub.
        """
        super().__init__(link)
        self.now_s = get_clock(link)
        self.window = FLOW_CONTROL_WINDOW if link.has_flow_control else RING_WINDOW
        self._number = 0
        self._waiting: deque[tuple[int, Transfer]] = deque()
        self._sent: deque[_SentCommand] = deque()
        self._bytes_in_flight = self._expected_reply_bytes = 0
        self._bus_bytes = 0
        self._last_unanswered: dict[int, tuple[int, int]] = {}
        self._handshakes = 0

    def _take_message(self, message: HubMessage) -> None:
        """Process a message of the hub.

        A logged receive overrun reduces the permitted number of bytes in flight to the size of the hub's ring buffer.
        """
        super()._take_message(message)
        if message.type is FrameType.LOG and message.fields["code"] == LogCode.RECEIVE_OVERRUN:
            self.window = min(self.window, RING_WINDOW)

    def submit(self, transfer: Transfer) -> int:
        """Queue an I2C transfer through the hub. Returns the number under which `collect` returns its result."""
        self._number += 1
        self._waiting.append((self._number, transfer))
        self._send_waiting()
        return self._number

    def collect(self, timeout_s: float) -> list[tuple[int, bytes | TransferError]]:
        """Return the I2C transfers that have ended, as numbers with read bytes or errors.

        Waits at most `timeout_s` for the first. Raises `WireError` if the link ends.
        """
        deadline = self.now_s() + timeout_s
        while True:
            self._send_waiting()
            completed = self._collect_completed()
            remaining_s = deadline - self.now_s()
            if completed or remaining_s <= 0.0:
                return completed
            try:
                self.stream.poll(min(remaining_s, POLL_STEP_S) if self._sent else remaining_s)
            except EOFError:
                raise WireError(self._link.name, "the link ended during transfers; check the connection") from None

    def _send_waiting(self) -> None:
        """Send queued commands to the hub while few enough bytes are in flight, then GET_TIME commands that flush
        their replies.
        """
        while (index := self._find_sendable()) is not None:
            number, transfer = self._waiting[index]
            del self._waiting[index]
            fields = {"address": transfer.address, "read_length": transfer.read_size}
            frame = self._build_frame(Command.I2C_TRANSFER, pack(TransferArguments, fields, transfer.write))
            self._send_frame(number, transfer, frame, REPLY_SIZE + transfer.read_size)
            self._bus_bytes += len(transfer.write) + transfer.read_size
            self._last_unanswered[transfer.address] = (number, self._bus_bytes)
        while (
            self._last_unanswered
            and self._expected_reply_bytes < FLUSH_THRESHOLD
            and self._bytes_in_flight + FLUSH_SIZE <= self.window
        ):
            self._send_frame(FLUSH, Transfer(0), self._build_frame(Command.GET_TIME), FLUSH_REPLY_SIZE)

    def _find_sendable(self) -> int | None:
        """Return the index of the first queued transfer that may be sent now; None if all must wait.

        Transfers of one board keep their order.
        """
        skipped_addresses: set[int] = set()
        for index, (_, transfer) in enumerate(self._waiting):
            if (
                transfer.address not in skipped_addresses
                and not self._is_too_soon(transfer)
                and self._fits_window(transfer)
            ):
                return index
            skipped_addresses.add(transfer.address)
        return None

    def _is_too_soon(self, transfer: Transfer) -> bool:
        """Return whether a transfer must wait, because its board still processes the previous transfer.

        This is the case if fewer than `SAME_BOARD_GAP` bytes of transfers with other boards have been sent since.
        """
        last = self._last_unanswered.get(transfer.address)
        return last is not None and self._bus_bytes - last[1] < SAME_BOARD_GAP

    def _fits_window(self, transfer: Transfer) -> bool:
        """Return whether the command for a transfer can be sent without exceeding the permitted number of bytes in
        flight.

        The commands that flush its reply are included. A single command is always permitted.
        """
        if not self._bytes_in_flight:
            return True
        reply_size = REPLY_SIZE + transfer.read_size
        flush_bytes = FLUSH_SIZE * _count_flush_commands(self._expected_reply_bytes + reply_size)
        return self._bytes_in_flight + TRANSFER_SIZE + len(transfer.write) + flush_bytes <= self.window

    def _pop_oldest(self) -> _SentCommand:
        """Remove and return the oldest command without a reply; its bytes are no longer in flight."""
        sent = self._sent.popleft()
        self._bytes_in_flight -= sent.size
        self._expected_reply_bytes -= sent.reply_size
        last = self._last_unanswered.get(sent.transfer.address)
        if last is not None and last[0] == sent.number:
            del self._last_unanswered[sent.transfer.address]
        return sent

    def _build_frame(self, command: Command, arguments: bytes = b"") -> bytes:
        """Build a command frame to the hub, with the tag by which its reply is recognised."""
        payload = pack(CommandPayload, {"tag": self._tag % 255 + 1, "command": int(command)}, arguments)
        return encode_frame(FrameType.COMMAND, self._sequence, payload)

    def _send_frame(self, number: int, transfer: Transfer, frame: bytes, reply_size: int) -> None:
        """Write a command frame to the link and record it until its reply arrives.

        number: number of the transfer, or `FLUSH`. reply_size: bytes of the expected reply frame.
        """
        tag = self._next_tag()
        self._sequence = (self._sequence + 1) % 65536
        self._replies.pop(tag, None)
        self._link.write(frame)
        self._sent.append(
            _SentCommand(
                number, transfer, tag, len(frame), reply_size, self.now_s() + REPLY_TIMEOUT_S, self._handshakes
            )
        )
        self._bytes_in_flight += len(frame)
        self._expected_reply_bytes += reply_size

    def _collect_completed(self) -> list[tuple[int, bytes | TransferError]]:
        """Return the transfers that have ended, as numbers with read bytes or errors.

        The hub replies in order, so a command without a reply before a command with a reply is lost. A command after
        its deadline is lost, too.
        """
        completed: list[tuple[int, bytes | TransferError]] = []
        answered_indices = [index for index, sent in enumerate(self._sent) if sent.tag in self._replies]
        for _ in range(answered_indices[-1] + 1 if answered_indices else 0):
            sent = self._pop_oldest()
            outcome = self._read_outcome(sent)
            if sent.number != FLUSH:
                completed.append((sent.number, outcome))
        while self._sent and self._sent[0].deadline_s <= self.now_s():
            sent = self._pop_oldest()
            if sent.number != FLUSH:
                completed.append((sent.number, self._make_lost_error(sent, "the hub does not answer")))
        return completed

    def _read_outcome(self, sent: _SentCommand) -> bytes | TransferError:
        """Return the bytes that a transfer has read, or its error.

        After the reply NO_HANDSHAKE, which shows a restart of the hub, the handshake is repeated once. Raises
        `WireError` if the hub refuses transfers.
        """
        if sent.tag not in self._replies:
            return self._make_lost_error(sent, "a command was lost")
        reply = self._replies.pop(sent.tag)
        status = reply.fields["status"]
        if status == ReplyStatus.OK:
            return reply.trailing_bytes
        if status == ReplyStatus.NACK:
            return NackError(sent.transfer.address, f"does not acknowledge on the bus of {self._link.name}")
        if status == ReplyStatus.NO_HANDSHAKE:
            if sent.handshakes == self._handshakes:  # commands sent before the last handshake need no further handshake
                self._handshakes += 1
                self.handshake()
            return self._make_lost_error(sent, "the hub has restarted")
        if status in (ReplyStatus.BUSY, ReplyStatus.TIMEOUT, ReplyStatus.BUS_ERROR):
            return self._make_lost_error(
                sent, f"a transfer failed ({ReplyStatus(status).name.lower().replace('_', ' ')})"
            )
        raise WireError(self._link.name, f"the hub refuses transfers (status {status}); update the hub's firmware")

    def _make_lost_error(self, sent: _SentCommand, problem: str) -> LostError:
        """Create the error of a transfer whose result is unknown."""
        return LostError(sent.transfer.address, f"{problem} on {self._link.name}")
