"""Losses of an original hub's stream: every missing message is counted once, for its board."""

from collections import Counter

import numpy as np
import pytest

from host.tests.original_hub.original_streams import (
    BYTE_MS,
    ORDER,
    BytesLink,
    SentMessage,
    damage_bytes,
    join_messages,
    synthesise_messages,
)
from taxel.hand import load_hand
from taxel.original_hub import OriginalLink
from taxel.skin import Skin
from taxel_protocol.original import FORMATS

CYCLES = 120


def read_frames(data: bytes, size: int = 700) -> tuple[list[tuple[int, int]], Skin]:
    """Read a stream in pieces of `size` bytes; return (address, cycle) of each frame, and the skin with counters."""
    skin = Skin(OriginalLink(BytesLink(data, size), load_hand("original"), FORMATS["original"]), load_hand("original"))
    return [(frame.address, frame.cycle) for frame in skin], skin


def count_missing(received: list[tuple[int, int]]) -> Counter[int]:
    """Count the missing messages of each board between its first and its last received message.

    received: address and true cycle of each received message, in order of the stream.
    """
    missing: Counter[int] = Counter()
    for address in {address for address, _ in received}:
        cycles = [cycle for board, cycle in received if board == address]
        missing[address] = cycles[-1] - cycles[0] + 1 - len(cycles)
    return missing


def assert_losses_match(sent: list[SentMessage], is_undamaged: list[bool], data: bytes, lost_on_wire: int) -> None:
    """Assert the frames, their cycles and the counters of losses and discarded bytes for a received stream `data`.

    is_undamaged: whether each sent message arrives undamaged. lost_on_wire: expected number of messages lost on the
    wire.
    """
    undamaged = [message for message, is_kept in zip(sent, is_undamaged, strict=True) if is_kept]
    expected = [(message.address, message.cycle) for message in undamaged]
    frames, skin = read_frames(data)
    first = expected[0][1]
    assert frames == [(address, cycle - first) for address, cycle in expected]
    missing = count_missing(expected)
    assert {address: count.missing for address, count in skin.losses.boards.items()} == dict(missing)
    assert skin.losses.lost_on_wire == lost_on_wire
    assert skin.bytes_discarded == len(data) - sum(len(message.data) for message in undamaged)


def test_undamaged_stream_has_no_losses() -> None:
    sent = synthesise_messages(CYCLES)
    assert_losses_match(sent, [True] * len(sent), join_messages(sent), 0)


@pytest.mark.parametrize("size", [1, 7, 4096])
def test_frames_do_not_depend_on_the_size_of_the_pieces_that_are_read(size: int) -> None:
    data = join_messages(synthesise_messages(20))
    assert read_frames(data, size)[0] == read_frames(data)[0]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("share", [0.02, 0.3])
def test_every_damaged_message_is_counted_as_missing_and_as_lost(seed: int, share: float) -> None:
    """A damaged message has a wrong end byte and perhaps a dropped or an inserted byte: all are detected."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    sent = synthesise_messages(CYCLES, seed)
    is_undamaged = (rng.random(len(sent)) >= share).tolist()
    is_undamaged[0] = is_undamaged[-1] = True
    pieces = []
    for message, is_kept in zip(sent, is_undamaged, strict=True):
        cut = int(rng.integers(8, len(message.data) - 1))
        changed = [
            message.data[:-1] + b"\x0b",
            message.data[:cut] + message.data[cut + 1 : -1] + b"\x0b",
            message.data[:cut] + b"\xaa" + message.data[cut:-1] + b"\x0b",
        ]
        pieces.append(message.data if is_kept else changed[int(rng.integers(3))])
    data = b"".join(pieces)
    assert_losses_match(sent, is_undamaged, data, is_undamaged.count(False))


@pytest.mark.parametrize("seed", range(6))
def test_board_that_the_hub_does_not_send_is_missing_but_not_lost_on_the_wire(seed: int) -> None:
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    not_sent = {(int(rng.integers(1, CYCLES - 1)), int(rng.choice(ORDER))) for _ in range(25)}
    sent = synthesise_messages(CYCLES, seed, not_sent=not_sent)
    frames, skin = read_frames(join_messages(sent))
    missing = Counter(address for _, address in not_sent)
    assert {address: count.missing for address, count in skin.losses.boards.items() if count.missing} == dict(missing)
    assert skin.losses.lost_on_wire == 0
    assert len(frames) == len(sent)


def test_board_that_the_hub_gives_up_leaves_the_read_sequence_and_the_others_lose_nothing() -> None:
    lost_board = ORDER[4]
    sent = synthesise_messages(CYCLES, not_sent=[(cycle, lost_board) for cycle in range(30, CYCLES)])
    frames, skin = read_frames(join_messages(sent))
    assert [cycle for _, cycle in frames] == [message.cycle for message in sent]
    assert sum(count.missing for count in skin.losses.boards.values()) == 0
    assert lost_board not in skin.link.read_sequence  # type: ignore[attr-defined]


def test_board_that_responds_later_in_a_cycle_belongs_to_this_cycle() -> None:
    sent = synthesise_messages(CYCLES)
    for cycle in (20, 41, 60):  # the hub reads the failed board again after all others
        index = next(i for i, m in enumerate(sent) if m.cycle == cycle and m.address == ORDER[3 * (cycle % 4)])
        last = max(i for i, m in enumerate(sent) if m.cycle == cycle)
        sent.insert(last, sent.pop(index))
    frames, skin = read_frames(join_messages(sent))
    assert [cycle for _, cycle in frames] == [message.cycle for message in sent]
    assert sum(count.missing for count in skin.losses.boards.values()) == 0


def test_message_with_the_address_of_another_board_changes_no_cycle_of_the_other_messages() -> None:
    """0x08, 0x0D and 0x19 have messages of equal length, so the link cannot detect a changed address."""
    sent = synthesise_messages(CYCLES)
    wrong = [i for i, message in enumerate(sent) if message.address == 0x0D and message.cycle in (30, 50)]
    wrong_address = {wrong[0]: b"\x08", wrong[1]: b"\x19"}
    data = b"".join(
        message.data[:2] + wrong_address.get(i, message.data[2:3]) + message.data[3:] for i, message in enumerate(sent)
    )
    frames, skin = read_frames(data)
    correct = [pair for i, pair in enumerate(frames) if i not in wrong]
    assert correct == [(message.address, message.cycle) for i, message in enumerate(sent) if i not in wrong]
    assert {address: count.missing for address, count in skin.losses.boards.items() if count.missing} == {0x0D: 2}


@pytest.mark.parametrize("cycles", [1, 3, 10])
def test_messages_of_whole_cycles_lost_in_an_interruption_are_counted_as_missing_and_as_lost(cycles: int) -> None:
    """A full buffer of the host loses all bytes from the middle of one message to the middle of a later one."""
    sent = synthesise_messages(CYCLES)
    begin = next(i for i, m in enumerate(sent) if m.cycle == 40 and m.address == ORDER[5])
    end = begin + cycles * len(ORDER) + 3
    data = join_messages(sent[:begin]) + sent[begin].data[:40] + sent[end].data[-20:] + join_messages(sent[end + 1 :])
    frames, skin = read_frames(data)
    received = sent[:begin] + sent[end + 1 :]
    assert [address for address, _ in frames] == [message.address for message in received]
    assert frames[-1] == (ORDER[-1], CYCLES - 1)
    missing = count_missing([(message.address, message.cycle) for message in received])
    assert {address: count.missing for address, count in skin.losses.boards.items()} == dict(missing)
    assert skin.losses.lost_on_wire >= cycles * len(ORDER)


def test_pause_of_the_hub_is_not_counted_as_a_loss() -> None:
    """The hub sends 30 poll cycles from 120 s on its clock, nothing for 5 s, and 30 further cycles."""
    first = synthesise_messages(30)
    sent = first + synthesise_messages(30, 2, time_ms=120_000.0 + len(join_messages(first)) * BYTE_MS + 5_000.0)
    _, skin = read_frames(join_messages(sent))
    assert sum(count.missing for count in skin.losses.boards.values()) == 0


@pytest.mark.parametrize("share", [0.01, 0.001])
@pytest.mark.parametrize("seed", range(3))
def test_random_damage_loses_no_undamaged_message_and_shifts_no_cycle(seed: int, share: float) -> None:
    """Bytes are changed, dropped and inserted, but every undamaged message arrives in its cycle.

    A few damaged messages are accepted as messages of another board, so the loss counters differ slightly from the
    true losses.
    """
    print(f"seed {seed}")
    sent = synthesise_messages(400, seed)
    data, is_undamaged = damage_bytes(sent, share, seed)
    skin = Skin(OriginalLink(BytesLink(data), load_hand("original"), FORMATS["original"]), load_hand("original"))
    received = {(frame.address, frame.cycle, frame.raw_counts.tobytes()) for frame in skin}
    undamaged = [message for message, is_kept in zip(sent, is_undamaged, strict=True) if is_kept]
    assert {(message.address, message.cycle, message.data[7:-1]) for message in undamaged} <= received
    accepted = skin.link.decoder.messages  # type: ignore[attr-defined]
    assert sum(count.missing for count in skin.losses.boards.values()) == pytest.approx(len(sent) - accepted, abs=60)
    assert skin.losses.lost_on_wire == pytest.approx(len(sent) - accepted, rel=0.02, abs=5)
    assert skin.losses.restarts == 0


def test_restart_of_the_hub_is_counted_and_its_frames_are_delivered() -> None:
    """The restart sets the clock of the hub to 0: the timestamps step back from more than 120 s to 50 ms."""
    sent = synthesise_messages(30) + synthesise_messages(30, 2, time_ms=50.0)
    frames, skin = read_frames(join_messages(sent))
    assert len(frames) == len(sent)
    assert skin.losses.restarts == 1
    assert sum(count.missing for count in skin.losses.boards.values()) == 0


def test_read_sequence_is_learned_from_the_stream_and_begins_after_the_pause() -> None:
    order = list(np.random.default_rng(3).permutation(ORDER))
    _, skin = read_frames(join_messages(synthesise_messages(30, order=[int(a) for a in order], pause_ms=50.0)))
    assert skin.link.read_sequence == tuple(order)  # type: ignore[attr-defined]
