"""Transfers through the hub, with several commands on their way at a time.

The hub works off one command after the other, and what comes meanwhile waits in a ring of 255 bytes
(protocol/SPEC.md). A host that waits for each reply pays the USB adapter's latency for every transfer; here it pays for
every ring-full, or, where the hub holds the host back before the ring is full, for every few KiB.

The adapter also holds back what the hub says until 62 bytes are together or its latency timer (16 ms) has run out.
Where replies are too short to fill it, GET_TIME commands go after them: their replies push those before them out.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

from taxel.link import Link, clock_of
from taxel.stream import HubClient, HubMessage
from taxel_protocol import Command, FrameType, ReplyStatus, encode_frame
from taxel_protocol.frames import CommandPayload, GetTimeReply, TransferArguments
from taxel_protocol.layout import pack, packer_of
from taxel_protocol.names import LogCode
from taxel_tools.errors import LostError, NackError, TransferError, WireError
from taxel_tools.procedure import Transfer

WINDOW: Final = 255
"""Bytes of commands without a reply yet: what the hub's receive ring holds."""
HELD_WINDOW: Final = 3072
"""The same where the hub makes the host wait: a serial driver's buffer takes 4096, so that a write never blocks while
replies want to be read."""
GAP: Final = 16
"""Bytes of other boards' transfers between two of one board while the first is unanswered: 0.36 ms at 400 kHz, in which
a bootloader works a packet off. Sooner it would not acknowledge the second."""
FILL: Final = 62 + 14
"""Bytes of replies that surely push one out: an adapter's packet, and a reply of which all but a byte is through."""
LOST_S: Final = 1.0
"""A command without a reply for so long is lost."""
GRAIN_S: Final = 0.0005
"""How long one look at the link lasts while replies are due."""


PUSH: Final = 0
"""Number of a GET_TIME, in place of a transfer's."""


def _frame_size(payload: bytes) -> int:
    return len(encode_frame(FrameType.REPLY, 0, payload))


REPLY_SIZE: Final = _frame_size(bytes(3))
PUSH_REPLY_SIZE: Final = _frame_size(bytes(3 + packer_of(GetTimeReply).size))
TRANSFER_SIZE: Final = len(encode_frame(FrameType.COMMAND, 0, bytes(4)))
PUSH_SIZE: Final = len(encode_frame(FrameType.COMMAND, 0, bytes(2)))


def _pushes(expected: int) -> int:
    """How many GET_TIME replies must follow so many bytes of replies."""
    return max(-((expected - FILL) // PUSH_REPLY_SIZE), 0)


@dataclass(slots=True)
class _Sent:
    number: int
    transfer: Transfer
    tag: int
    size: int
    reply_size: int
    deadline_s: float
    handshakes: int


class HubQueue(HubClient):
    """A hub client that also takes transfers ahead of their turn.

    `window`: bytes of commands that may be without a reply. It falls to what the hub's ring holds when the hub says
    that bytes were lost: then its RTS is not wired, whatever the link was told.
    """

    def __init__(self, link: Link) -> None:
        super().__init__(link)
        self.now_s = clock_of(link)
        self.window = HELD_WINDOW if link.holds_back else WINDOW
        self._number = 0
        self._waiting: deque[tuple[int, Transfer]] = deque()
        self._sent: deque[_Sent] = deque()
        self._under_way = self._expected = 0
        self._bus_bytes = 0
        self._unanswered: dict[int, tuple[int, int]] = {}
        self._handshakes = 0

    def _take(self, message: HubMessage) -> None:
        super()._take(message)
        if message.type is FrameType.LOG and message.fields["code"] == LogCode.RECEIVE_OVERRUN:
            self.window = min(self.window, WINDOW)

    def submit(self, transfer: Transfer) -> int:
        """Queue a transfer; returns its number."""
        self._number += 1
        self._waiting.append((self._number, transfer))
        self._send_waiting()
        return self._number

    def collect(self, timeout_s: float) -> list[tuple[int, bytes | TransferError]]:
        """Transfers that have ended; waits at most `timeout_s` for the first."""
        deadline = self.now_s() + timeout_s
        while True:
            self._send_waiting()
            ended = self._ended()
            left = deadline - self.now_s()
            if ended or left <= 0.0:
                return ended
            try:
                self.stream.poll(min(left, GRAIN_S) if self._sent else left)
            except EOFError:
                raise WireError(self._link.name, "ended while boards were being talked to") from None

    def _send_waiting(self) -> None:
        """Send what the hub has room for, and after it what pushes the replies out of the adapter."""
        while (place := self._next_place()) is not None:
            number, transfer = self._waiting[place]
            del self._waiting[place]
            fields = {"address": transfer.address, "read_length": transfer.read_size}
            frame = self._frame(Command.I2C_TRANSFER, pack(TransferArguments, fields, transfer.write))
            self._send_frame(number, transfer, frame, REPLY_SIZE + transfer.read_size)
            self._bus_bytes += len(transfer.write) + transfer.read_size
            self._unanswered[transfer.address] = (number, self._bus_bytes)
        while self._unanswered and self._expected < FILL and self._under_way + PUSH_SIZE <= self.window:
            self._send_frame(PUSH, Transfer(0), self._frame(Command.GET_TIME), PUSH_REPLY_SIZE)

    def _next_place(self) -> int | None:
        """The first waiting transfer that may be sent now; those of one board keep their order."""
        passed_over: set[int] = set()
        for place, (_, transfer) in enumerate(self._waiting):
            if transfer.address not in passed_over and not self._is_too_soon(transfer) and self._has_room(transfer):
                return place
            passed_over.add(transfer.address)
        return None

    def _is_too_soon(self, transfer: Transfer) -> bool:
        last = self._unanswered.get(transfer.address)
        return last is not None and self._bus_bytes - last[1] < GAP

    def _has_room(self, transfer: Transfer) -> bool:
        if not self._under_way:
            return True
        reply_size = REPLY_SIZE + transfer.read_size
        to_push = PUSH_SIZE * _pushes(self._expected + reply_size)
        return self._under_way + TRANSFER_SIZE + len(transfer.write) + to_push <= self.window

    def _forget(self) -> _Sent:
        """Take the oldest command off the list of those that are under way."""
        sent = self._sent.popleft()
        self._under_way -= sent.size
        self._expected -= sent.reply_size
        last = self._unanswered.get(sent.transfer.address)
        if last is not None and last[0] == sent.number:
            del self._unanswered[sent.transfer.address]
        return sent

    def _frame(self, command: Command, arguments: bytes = b"") -> bytes:
        payload = pack(CommandPayload, {"tag": self._tag % 255 + 1, "command": int(command)}, arguments)
        return encode_frame(FrameType.COMMAND, self._sequence, payload)

    def _send_frame(self, number: int, transfer: Transfer, frame: bytes, reply_size: int) -> None:
        tag = self._next_tag()
        self._sequence = (self._sequence + 1) % 65536
        self._replies.pop(tag, None)
        self._link.write(frame)
        self._sent.append(_Sent(number, transfer, tag, len(frame), reply_size, self.now_s() + LOST_S, self._handshakes))
        self._under_way += len(frame)
        self._expected += reply_size

    def _ended(self) -> list[tuple[int, bytes | TransferError]]:
        """The hub answers in order: whatever was sent before something that has been answered is lost."""
        ended: list[tuple[int, bytes | TransferError]] = []
        answered = [place for place, sent in enumerate(self._sent) if sent.tag in self._replies]
        for _ in range(answered[-1] + 1 if answered else 0):
            sent = self._forget()
            outcome = self._outcome(sent)
            if sent.number != PUSH:
                ended.append((sent.number, outcome))
        while self._sent and self._sent[0].deadline_s <= self.now_s():
            sent = self._forget()
            if sent.number != PUSH:
                ended.append((sent.number, self._lost(sent, "the hub does not answer")))
        return ended

    def _outcome(self, sent: _Sent) -> bytes | TransferError:
        if sent.tag not in self._replies:
            return self._lost(sent, "a command was lost on its way")
        reply = self._replies.pop(sent.tag)
        status = reply.fields["status"]
        if status == ReplyStatus.OK:
            return reply.tail
        if status == ReplyStatus.NACK:
            return NackError(sent.transfer.address, f"does not acknowledge on the bus of {self._link.name}")
        if status == ReplyStatus.NO_HANDSHAKE:
            if sent.handshakes == self._handshakes:  # commands sent before the last handshake need no further handshake
                self._handshakes += 1
                self.handshake()
            return self._lost(sent, "the hub has started anew")
        if status in (ReplyStatus.BUSY, ReplyStatus.TIMEOUT, ReplyStatus.BUS_ERROR):
            return self._lost(sent, f"a transfer failed ({ReplyStatus(status).name.lower().replace('_', ' ')})")
        raise WireError(self._link.name, f"the hub refuses transfers (status {status}); update its firmware")

    def _lost(self, sent: _Sent, why: str) -> LostError:
        return LostError(sent.transfer.address, f"{why} on {self._link.name}")
