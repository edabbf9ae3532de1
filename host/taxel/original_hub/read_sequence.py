"""Read sequence of the original hub, learned from the stream, and the poll cycle of each message.

The hub reads its boards in a fixed order and sends one message per board; the messages have no number. Two messages
that are contiguous in the stream show that one board follows the other. The majority of these pairs gives the order,
and the order together with the lengths of the messages gives the distance between two messages in bytes. Damaged bytes
change this distance only by the few bytes that were dropped or inserted. The number of missing messages therefore
follows from the position in the stream, even if a board is seldom received or its timestamps are damaged.
"""

from collections import Counter, defaultdict, deque
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from taxel_protocol.original import EARLY_ADDRESSES, READ_SEQUENCE

WINDOW: Final = 176
"""Number of latest messages from which the order is learned: 8 cycles of 22 boards. A larger window learns a change of
the order later; a smaller one contains too few contiguous pairs if most messages are damaged."""

LEARNING_MESSAGES: Final = 3 * 22
"""Number of messages after which the order of the hub's public firmware is used if the pairs do not yet give an order;
three cycles of 22 boards (chosen)."""

ACTIVE_SHARE: Final = 0.25
"""Smallest number of messages of a board in the window, as a share of those of the most frequent board, at which the
board belongs to the order. A smaller share admits addresses that exist only in damaged messages."""

PAUSE_MIN_MS: Final = 10.0
"""Smallest excess of the longest time between two boards over the second longest at which the longest is treated as the
pause between two cycles, ms. The public firmware pauses for 50 ms; reading the palm takes 22 ms."""

TOLERANCE: Final = 8
"""Largest net number of dropped or inserted bytes between two messages for which no missing board is assumed. A larger
value confuses dropped bytes with a missing board: the shortest message has 20 bytes."""

SUBSET_MAX: Final = 12
"""Largest number of absent boards for which the number of lost messages is computed exactly from the lost bytes."""


class Location(NamedTuple):
    """Location of a message in the read sequence.

    cycle: number of the poll cycle, from 0. lost: number of messages between the previous message and this one that the
    hub sent but that were damaged, as far as the discarded bytes show.
    """

    cycle: int
    lost: int


class Placed(NamedTuple):
    """A message in the stream. address: address of its board. start: position of its first byte in the stream."""

    address: int
    start: int


class _Pair(NamedTuple):
    """A message in the window of latest messages, with the message directly before it.

    address: address of its board. previous: address of the board whose message ends where this one begins; None if
    there is no such message. gap_ms: time between the two messages; None if it is unknown.
    """

    address: int
    previous: int | None
    gap_ms: float | None


class ReadSequence:
    """Order in which the hub reads its boards.

    order: addresses in the order of reading; empty before it is known. size: bytes of a complete cycle. A board between
    two received messages whose message is not in the stream is called absent.
    """

    def __init__(self, lengths: Mapping[int, int]) -> None:
        """Create an empty read sequence. lengths: number of bytes of a message, by address of its board."""
        self.order: tuple[int, ...] = ()
        self.size = 0
        self._lengths = lengths
        self._offsets: dict[int, int] = {}
        self._ranks: dict[int, int] = {}
        self._window: deque[_Pair] = deque(maxlen=WINDOW)
        self._learned_messages = 0
        self._end = -1
        self._address = -1
        self._time_ms: float | None = None
        self._cycle = 0
        self._seen: set[int] = set()  # boards that were received in the present cycle
        self._skipped: set[int] = set()  # boards that the hub did not send at their place in the present cycle
        self._last: Placed | None = None  # last message of a board in the order
        self._last_end = 0

    @property
    def active(self) -> list[int]:
        """Addresses that occur at least twice, and often enough (`ACTIVE_SHARE`), in the window; ascending."""
        counts = Counter(pair.address for pair in self._window)
        enough = max(2.0, ACTIVE_SHARE * max(counts.values(), default=0))
        return sorted(address for address, count in counts.items() if count >= enough)

    def learn(self, address: int, start: int, time_ms: float | None) -> None:
        """Add a message to the window of latest messages, and learn the order if it is unknown or contradicted.

        address: address of the message's board. start: position of its first byte in the stream. time_ms: its
        timestamp; None if it is unknown.
        """
        is_contiguous = start == self._end
        has_gap = is_contiguous and time_ms is not None and self._time_ms is not None
        gap_ms = time_ms - self._time_ms if has_gap and time_ms is not None and self._time_ms is not None else None
        previous = self._address if is_contiguous else None
        self._window.append(_Pair(address, previous, gap_ms))
        self._end, self._address, self._time_ms = start + self._lengths[address], address, time_ms
        self._learned_messages += 1
        if not self.order or (previous is not None and self._get_follower(previous) != address):
            self._learn_order()

    def _get_follower(self, address: int) -> int | None:
        """Return the address that the hub reads after `address`; None if `address` is not in the order."""
        rank = self._ranks.get(address)
        return None if rank is None else self.order[(rank + 1) % len(self.order)]

    def _learn_order(self) -> None:
        """Set the order from the contiguous pairs in the window.

        The pairs give an order if the most frequent followers form a ring of all active boards. Otherwise the order of
        the public firmware is used after `LEARNING_MESSAGES` messages, unless an order is already known.
        """
        active = self.active
        followers: dict[int, Counter[int]] = defaultdict(Counter)
        for pair in self._window:
            if pair.previous in active and pair.address in active:
                followers[pair.previous][pair.address] += 1
        ring = active[:1]
        while ring and followers[ring[-1]] and (follower := followers[ring[-1]].most_common(1)[0][0]) not in ring:
            ring.append(follower)
        is_closed = bool(ring) and followers[ring[-1]].most_common(1)[:1] != [] and len(ring) == len(active)
        if is_closed and followers[ring[-1]].most_common(1)[0][0] == ring[0] and self._is_confirmed(ring, followers):
            self._set_order(ring)
        elif self._learned_messages >= LEARNING_MESSAGES:
            self.use_public_order()

    def use_public_order(self) -> None:
        """If no order is known, use the order of the hub's public firmware for all received boards."""
        addresses = {pair.address for pair in self._window}
        if not self.order and addresses:
            self._set_order(sorted(addresses, key=_get_public_rank))

    def _is_confirmed(self, ring: list[int], followers: Mapping[int, Counter[int]]) -> bool:
        """Return whether each pair of the ring was received at least twice; a single occurrence may be damaged."""
        return all(followers[a][b] >= 2 for a, b in _list_pairs(ring))

    def _set_order(self, ring: list[int]) -> None:
        """Set the order of reading from addresses in cyclic order; nothing changes if this cyclic order is known."""
        if (
            self.order
            and len(ring) == len(self.order)
            and all(a == self._get_follower(b) for b, a in _list_pairs(ring))
        ):
            return  # the same order; the start is kept
        start = self._find_start(ring)
        self.order = tuple(ring[start:] + ring[:start])
        self._ranks = {address: rank for rank, address in enumerate(self.order)}
        self._offsets, self.size = {}, 0
        for address in self.order:
            self._offsets[address] = self.size
            self.size += self._lengths[address]

    def _find_start(self, ring: list[int]) -> int:
        """Return the index in the ring of the first board of a cycle.

        The hub pauses between two cycles. If the times show a pause, the first board is the board after the pause;
        otherwise, it is the board that the public firmware reads first.
        """
        gaps: dict[int, list[float]] = defaultdict(list)
        for pair in self._window:
            if pair.gap_ms is not None and pair.previous is not None:
                gaps[pair.address].append(pair.gap_ms)
        # The shortest of several times: a damaged timestamp must not look like a pause.
        shortest = sorted(((min(gaps[a]) if len(gaps[a]) > 1 else 0.0, i) for i, a in enumerate(ring)), reverse=True)
        if len(ring) > 1 and shortest[0][0] - shortest[1][0] >= PAUSE_MIN_MS:
            return shortest[0][1]
        return min(range(len(ring)), key=lambda index: _get_public_rank(ring[index]))

    def locate(self, message: Placed, following: Sequence[Placed] = (), is_final: bool = True) -> Location | None:
        """Locate the next message in the read sequence; call this once per message, in the order of the stream.

        following: later messages that have already arrived. is_final: no more messages will arrive. Returns None if the
        location depends on messages that have not arrived; then call again later.

        A message of a board that is not in the order belongs to the present cycle. A message is doubtful if its
        position does not fit a stream with all boards, or if the hub has skipped its board in this cycle. For a
        doubtful message, the later messages decide whether its address is damaged, or whether the hub has read the
        skipped board again.
        """
        last, is_first = self._last, self._last is None or self._last.address not in self._ranks
        discarded = 0 if last is None else message.start - self._last_end
        if last is None or is_first or message.address not in self._ranks:
            return self._take_first(message)
        cycles = self._count_cycles(last, message)
        absent = self._list_absent(last, message, cycles)
        is_doubtful = not self._is_consistent(last, message) or (not discarded and message.address in self._skipped)
        if is_doubtful:
            if not following and not is_final:
                return None
            if following and self._is_consistent(last, following[0]) and not self._is_consistent(message, following[0]):
                self._last_end = self._get_end(message)
                return Location(self._cycle, 0)  # a damaged address: the sequence continues without this message
            is_retry = self._is_retry(last, message, following, is_final)
            if is_retry is None:
                return None
            if is_retry:
                cycles, absent = 0, []
        if cycles:
            self.skip_cycles(cycles)
        if not discarded:
            self._skipped.update(absent)
        self._seen.add(message.address)
        self._last, self._last_end = message, self._get_end(message)
        return Location(self._cycle, self._count_lost(absent, discarded))

    def assume_hub_start(self) -> None:
        """Note that the hub has just started: boards that are not ready yet may be read again later in the cycle."""
        self._skipped = set(self.order)

    def _take_first(self, message: Placed) -> Location:
        """Locate the first message in a new order, or a message of a board that is not in the order.

        A message of the order begins a new cycle if its board was read already. No message counts as lost, because the
        position in the order is not known.
        """
        if message.address in self._ranks:
            if message.address in self._seen:
                self.skip_cycles(1)
            self._seen.add(message.address)
            self._last = message
        self._last_end = self._get_end(message)
        return Location(self._cycle, 0)

    def _get_end(self, message: Placed) -> int:
        """Compute the position behind the last byte of a message."""
        return message.start + self._lengths[message.address]

    def _compute_step(self, first: Placed, second: Placed) -> int:
        """Compute the bytes from the start of one message's cycle to the start of a later message's cycle.

        A multiple of `size` if no byte was dropped or inserted and the hub sent all boards.
        """
        return second.start - first.start - (self._offsets[second.address] - self._offsets[first.address])

    def _is_consistent(self, first: Placed, second: Placed) -> bool:
        """Return whether the positions of two messages fit a stream with all boards, to within `TOLERANCE` bytes."""
        if second.address not in self._ranks:
            return False
        step = self._compute_step(first, second) + TOLERANCE  # shifted, so that deviations of both signs are small
        return step >= 0 and step % self.size <= 2 * TOLERANCE

    def _count_cycles(self, last: Placed, message: Placed) -> int:
        """Count the cycles that begin after the message `last`, up to the cycle of `message`.

        At least one begins if `message` is not behind `last` in the order, or if its board was already received.
        """
        cycles = max(0, round(self._compute_step(last, message) / self.size))
        is_forward = self._ranks[message.address] > self._ranks[last.address]
        is_new = message.address not in self._seen
        return cycles if is_forward and is_new else max(1, cycles)

    def _is_retry(self, last: Placed, message: Placed, following: Sequence[Placed], is_final: bool) -> bool | None:
        """Return whether the hub read a board again at the end of a cycle because the board had not responded before.

        False means that `message` belongs to the next cycle. A retry is possible only if the board of `message` is
        before the board of `last` in the order, was skipped, and has sent no message in this cycle. The first later
        message of a board that was already received in this cycle, or of the board of `message`, decides. If its board
        is behind the board of `message` in the order, and its position is in the same cycle as `message`, the result is
        False, otherwise True.

        Without such a later message, the result is None: call again when more messages have arrived. The result is
        False if no more messages will arrive (`is_final`), or if `following` has more messages than a cycle.
        """
        is_backward = self._ranks[message.address] < self._ranks[last.address]
        if not is_backward or message.address not in self._skipped or message.address in self._seen:
            return False
        for later in following:
            if later.address in self._ranks and later.address in {*self._seen, message.address}:
                is_behind = self._ranks[later.address] > self._ranks[message.address]
                return not (is_behind and round(self._compute_step(message, later) / self.size) == 0)
        return False if is_final or len(following) > len(self.order) else None

    def skip_cycles(self, cycles: int) -> int:
        """Advance by a number of cycles; return the number of messages that these cycles contain."""
        self._cycle += cycles
        self._seen.clear()
        self._skipped.clear()
        return cycles * len(self.order)

    def _list_absent(self, last: Placed, message: Placed, cycles: int) -> list[int]:
        """List the addresses between the message `last` and the message `message`, which is `cycles` cycles later."""
        rank = self._ranks[last.address]
        count = self._ranks[message.address] - rank + cycles * len(self.order) - 1
        return [self.order[(rank + 1 + index) % len(self.order)] for index in range(max(count, 0))]

    def _count_lost(self, absent: list[int], discarded: int) -> int:
        """Estimate how many of the absent boards' messages the hub sent, from the number of discarded bytes.

        The estimate is the number of messages whose total length is closest to `discarded`. A board that the hub did
        not send leaves no bytes.
        """
        if not discarded or not absent:
            return 0
        lengths = [self._lengths[address] for address in absent]
        if len(absent) > SUBSET_MAX:
            return min(len(absent), round(discarded * len(absent) / sum(lengths)))
        counts = {0: 0}  # number of messages by their total length, for every subset of the absent boards
        for length in lengths:
            counts |= {total + length: count + 1 for total, count in counts.items()} | counts
        return counts[min(counts, key=lambda total: abs(total - discarded))]


def _list_pairs(ring: list[int]) -> list[tuple[int, int]]:
    """List the pairs of successive addresses in a ring; the last pair leads back to the first address."""
    return list(zip(ring, [*ring[1:], ring[0]], strict=True))


def _get_public_rank(address: int) -> int:
    """Return the place of a board in the read sequence of the hub's public firmware; unknown addresses come last."""
    later = EARLY_ADDRESSES.get(address, address)
    return READ_SEQUENCE.index(later) if later in READ_SEQUENCE else len(READ_SEQUENCE) + address
