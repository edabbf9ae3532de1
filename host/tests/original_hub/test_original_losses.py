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
    join,
    synthesise,
)
from taxel.hand import load_hand
from taxel.original_hub import OriginalLink
from taxel.skin import Skin
from taxel_protocol.original import FORMATS

CYCLES = 120


def read_frames(data: bytes, size: int = 700) -> tuple[list[tuple[int, int]], Skin]:
    """(address, cycle) of every frame that the link makes of a stream, and the skin with its counters."""
    skin = Skin(OriginalLink(BytesLink(data, size), load_hand("original"), FORMATS["original"]), load_hand("original"))
    return [(frame.address, frame.cycle) for frame in skin], skin


def count_missing(received: list[tuple[int, int]]) -> Counter[int]:
    """Missing messages of each board between its first and its last received message, from the true cycles."""
    missing: Counter[int] = Counter()
    for address in {address for address, _ in received}:
        cycles = [cycle for board, cycle in received if board == address]
        missing[address] = cycles[-1] - cycles[0] + 1 - len(cycles)
    return missing


def assert_losses_match(sent: list[SentMessage], keep: list[bool], data: bytes, lost_on_wire: int) -> None:
    """Check frames, cycles and both loss counters for a stream in which the messages with `keep` are undamaged."""
    expected = [(message.address, message.cycle) for message, kept in zip(sent, keep, strict=True) if kept]
    frames, skin = read_frames(data)
    first = expected[0][1]
    assert frames == [(address, cycle - first) for address, cycle in expected]
    missing = count_missing(expected)
    assert {a: count.missing for a, count in skin.losses.boards.items()} == dict(missing)
    assert skin.losses.lost_on_wire == lost_on_wire
    assert skin.bytes_discarded == len(data) - sum(len(m.data) for m, kept in zip(sent, keep, strict=True) if kept)


def test_undamaged_stream_has_no_losses() -> None:
    sent = synthesise(CYCLES)
    assert_losses_match(sent, [True] * len(sent), join(sent), 0)


@pytest.mark.parametrize("size", [1, 7, 4096])
def test_frames_do_not_depend_on_the_pieces(size: int) -> None:
    data = join(synthesise(20))
    assert read_frames(data, size)[0] == read_frames(data)[0]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("share", [0.02, 0.3])
def test_every_damaged_message_is_counted_as_missing_and_as_lost(seed: int, share: float) -> None:
    """A damaged message has another end byte, one dropped byte or one inserted byte: all are detected."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    sent = synthesise(CYCLES, seed)
    keep = (rng.random(len(sent)) >= share).tolist()
    keep[0] = keep[-1] = True
    pieces = []
    for message, kept in zip(sent, keep, strict=True):
        cut = int(rng.integers(8, len(message.data) - 1))
        changed = [
            message.data[:-1] + b"\x0b",
            message.data[:cut] + message.data[cut + 1 : -1] + b"\x0b",
            message.data[:cut] + b"\xaa" + message.data[cut:-1] + b"\x0b",
        ]
        pieces.append(message.data if kept else changed[int(rng.integers(3))])
    data = b"".join(pieces)
    assert_losses_match(sent, keep, data, keep.count(False))


@pytest.mark.parametrize("seed", range(6))
def test_board_that_the_hub_does_not_send_is_missing_but_not_lost_on_the_wire(seed: int) -> None:
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    not_sent = {(int(rng.integers(1, CYCLES - 1)), int(rng.choice(ORDER))) for _ in range(25)}
    sent = synthesise(CYCLES, seed, not_sent=not_sent)
    frames, skin = read_frames(join(sent))
    missing = Counter(address for _, address in not_sent)
    assert {a: count.missing for a, count in skin.losses.boards.items() if count.missing} == dict(missing)
    assert skin.losses.lost_on_wire == 0
    assert len(frames) == len(sent)


def test_board_that_the_hub_gives_up_leaves_the_read_sequence_and_the_others_lose_nothing() -> None:
    lost_board = ORDER[4]
    sent = synthesise(CYCLES, not_sent=[(cycle, lost_board) for cycle in range(30, CYCLES)])
    frames, skin = read_frames(join(sent))
    assert [cycle for _, cycle in frames] == [message.cycle for message in sent]
    assert sum(count.missing for count in skin.losses.boards.values()) == 0
    assert lost_board not in skin.link.read_sequence  # type: ignore[attr-defined]


def test_board_that_answers_later_in_the_cycle_belongs_to_this_cycle() -> None:
    sent = synthesise(CYCLES)
    for cycle in (20, 41, 60):  # the hub reads the failed board again after all others
        index = next(i for i, m in enumerate(sent) if m.cycle == cycle and m.address == ORDER[3 * (cycle % 4)])
        last = max(i for i, m in enumerate(sent) if m.cycle == cycle)
        sent.insert(last, sent.pop(index))
    frames, skin = read_frames(join(sent))
    assert [cycle for _, cycle in frames] == [message.cycle for message in sent]
    assert sum(count.missing for count in skin.losses.boards.values()) == 0


def test_message_with_the_address_of_another_board_changes_no_cycle() -> None:
    """0x08, 0x0D and 0x19 have messages of equal length, so that a changed address is not detected."""
    sent = synthesise(CYCLES)
    wrong = [i for i, m in enumerate(sent) if m.address == 0x0D and m.cycle in (30, 50)]
    data = b"".join(
        message.data[:2] + (b"\x08" if i == wrong[0] else b"\x19") + message.data[3:] if i in wrong else message.data
        for i, message in enumerate(sent)
    )
    frames, skin = read_frames(data)
    right = [pair for i, pair in enumerate(frames) if i not in wrong]
    assert right == [(m.address, m.cycle) for i, m in enumerate(sent) if i not in wrong]
    assert {a: c.missing for a, c in skin.losses.boards.items() if c.missing} == {0x0D: 2}


@pytest.mark.parametrize("cycles", [1, 3, 10])
def test_interruption_that_loses_whole_cycles_is_counted(cycles: int) -> None:
    """A full buffer of the host loses all bytes from the middle of one message to the middle of a later one."""
    sent = synthesise(CYCLES)
    begin = next(i for i, m in enumerate(sent) if m.cycle == 40 and m.address == ORDER[5])
    end = begin + cycles * len(ORDER) + 3
    data = join(sent[:begin]) + sent[begin].data[:40] + sent[end].data[-20:] + join(sent[end + 1 :])
    frames, skin = read_frames(data)
    received = sent[:begin] + sent[end + 1 :]
    assert [address for address, _ in frames] == [message.address for message in received]
    assert frames[-1] == (ORDER[-1], CYCLES - 1)
    missing = count_missing([(m.address, m.cycle) for m in received])
    assert {a: count.missing for a, count in skin.losses.boards.items()} == dict(missing)
    assert skin.losses.lost_on_wire >= cycles * len(ORDER)


def test_pause_of_the_hub_loses_nothing() -> None:
    first = synthesise(30)
    sent = first + synthesise(30, 2, time_ms=120_000.0 + len(join(first)) * BYTE_MS + 5_000.0)
    _, skin = read_frames(join(sent))
    assert sum(count.missing for count in skin.losses.boards.values()) == 0


@pytest.mark.parametrize("share", [0.01, 0.001])
@pytest.mark.parametrize("seed", range(3))
def test_random_damage_loses_no_undamaged_message_and_no_cycle(seed: int, share: float) -> None:
    """Changed, dropped and inserted bytes: every undamaged message arrives in its cycle. A few damaged messages are
    accepted under the address of another board, so that the counters of losses differ from the truth by these.
    """
    print(f"seed {seed}")
    sent = synthesise(400, seed)
    data, keep = damage_bytes(sent, share, seed)
    skin = Skin(OriginalLink(BytesLink(data), load_hand("original"), FORMATS["original"]), load_hand("original"))
    received = {(frame.address, frame.cycle, frame.raw_counts.tobytes()) for frame in skin}
    undamaged = {(m.address, m.cycle, m.data[7:-1]) for m, kept in zip(sent, keep, strict=True) if kept}
    assert undamaged <= received
    accepted = skin.link.decoder.messages  # type: ignore[attr-defined]
    assert sum(count.missing for count in skin.losses.boards.values()) == pytest.approx(len(sent) - accepted, abs=60)
    assert skin.losses.lost_on_wire == pytest.approx(len(sent) - accepted, rel=0.02, abs=5)
    assert skin.losses.restarts == 0


def test_restart_of_the_hub_is_counted_and_its_frames_are_delivered() -> None:
    sent = synthesise(30) + synthesise(30, 2, time_ms=50.0)
    frames, skin = read_frames(join(sent))
    assert len(frames) == len(sent)
    assert skin.losses.restarts == 1
    assert sum(count.missing for count in skin.losses.boards.values()) == 0


def test_read_sequence_is_learned_from_the_stream_and_begins_after_the_pause() -> None:
    order = list(np.random.default_rng(3).permutation(ORDER))
    _, skin = read_frames(join(synthesise(30, order=[int(a) for a in order], pause_ms=50.0)))
    assert skin.link.read_sequence == tuple(order)  # type: ignore[attr-defined]
