"""The raw bytes of the emulated original hub: `emulator:?protocol=original` without translation."""

import time

import numpy as np
import pytest

from taxel.emulated import open_emulator, open_original_emulator
from taxel.hand import load_hand
from taxel.hand.original_firmware import FIRST_GENERATION, OriginalFirmware, list_polled_addresses
from taxel.hand.world import format_world, make_original_settings
from taxel.link import LinkError
from taxel.link.emulator import run_emulator
from taxel_protocol.original import FORMATS
from taxel_protocol.original_stream import OriginalDecoder

ORIGINAL = load_hand("original")


def read_stream(url: str, size: int, hand: str = "original") -> bytes:
    """Read at least `size` bytes of the emulated original hub of a packaged hand."""
    link = open_original_emulator(url, load_hand(hand))
    data = b""
    deadline = time.monotonic() + 20.0
    try:
        while len(data) < size and time.monotonic() < deadline:
            chunk = link.read(1.0)
            data += chunk.data if chunk else b""
    finally:
        link.close()
    assert len(data) >= size
    return data


def split_messages(stream: bytes) -> list[bytes]:
    """Divide an undamaged stream into its complete messages; the second byte of a message is its length."""
    messages = []
    while len(stream) > 1 and len(stream) >= stream[1]:
        messages.append(stream[: stream[1]])
        stream = stream[stream[1] :]
    return messages


def test_the_stream_contains_a_message_of_every_board_in_the_read_order_of_the_hub():
    """A message has 8 bytes besides its counts: 0x01, length, address, 4 bytes of timestamp, 0x0A.

    The 17 messages after the first 17 contain every board once, in the read order, beginning with any board.
    """
    messages = split_messages(read_stream("emulator:?protocol=original&speed=max", 5000))
    taxels = {board.address: board.kind.taxel_count for board in ORIGINAL.boards}
    order = list_polled_addresses(ORIGINAL)
    assert order[0] == 0x17
    assert len(order) == 17
    assert {message[2] for message in messages} == set(taxels)
    for message in messages:
        assert message[0] == 0x01
        assert message[-1] == 0x0A
        assert len(message) == 2 * taxels[message[2]] + 8
    second_cycle = [message[2] for message in messages[17:34]]
    start = order.index(second_cycle[0])
    assert second_cycle == order[start:] + order[:start]


def test_skipped_boards_are_not_polled():
    messages = split_messages(read_stream("emulator:?protocol=original&speed=max&skip=0x0B,0x17", 4000))
    assert {message[2] for message in messages} == {board.address for board in ORIGINAL.boards} - {0x0B, 0x17}


def test_messages_without_timestamp_are_four_bytes_shorter():
    messages = split_messages(read_stream("emulator:?protocol=original&speed=max&message=no_timestamp", 3000))
    taxels = {board.address: board.kind.taxel_count for board in ORIGINAL.boards}
    assert all(len(message) == 2 * taxels[message[2]] + 4 for message in messages)


def test_in_real_time_the_hub_sends_its_bytes_at_most_at_the_rate_of_the_uart():
    bytes_per_second = 11520  # 115,200 baud, 10 bits per byte
    start = time.monotonic()
    read_stream("emulator:?protocol=original", bytes_per_second)
    assert 0.9 < time.monotonic() - start < 5.0  # a busy computer may read later


@pytest.mark.parametrize(
    ("hand", "message", "message_format"),
    [
        ("original", "timestamp", "original"),
        ("original", "timestamp&accelerations=0x0B,0x17,0x1C", "original_accelerations"),
        ("first_generation", "timestamp", "first_generation"),
        ("first_generation", "no_timestamp", "first_generation_untimed"),
        ("first_generation", "high_byte_first", "first_generation_test"),
    ],
)
def test_the_decoder_of_the_original_stream_accepts_every_byte(hand, message, message_format):
    decoder = OriginalDecoder(FORMATS[message_format])
    stream = read_stream(f"emulator:?protocol=original&speed=max&message={message}", 20000, hand)
    messages = decoder.push(stream) + decoder.finish()
    whole = split_messages(stream)
    assert [message.address for message in messages] == [message[2] for message in whole]
    assert sum(len(message) for message in whole) > 19000
    assert all(500 < count < 2500 for message in messages for count in message.counts)
    assert decoder.discarded_bytes == len(stream) - sum(len(message) for message in whole)  # the incomplete last one


@pytest.mark.parametrize(
    ("option", "expected"),
    [
        ("generation=second", "'generation' must be one of thesis, first"),
        ("variant=fpcb", "'variant' must be one of main, branch"),
        ("message=long", "'message' must be one of timestamp"),
        ("known_faults=rust", "'known_faults' must be one of truncated_taxel"),
        ("delay_ms=-1", "'delay_ms' must be a number from 0 to 100000"),
        ("ring=8", "'ring' must be a whole number from 16 to 4096"),
        ("ring=20.5", "'ring' must be a whole number"),
        ("pacing=2", "'pacing' must be a whole number from 0 to 1"),
        ("skip=0x30", "'skip' must contain addresses of boards"),
        ("accelerations=0x30", "'accelerations' must contain addresses of boards"),
        ("skip=all", "'skip' must contain addresses of boards"),
        ("order=8", "unknown option 'order'"),
    ],
)
def test_a_wrong_option_is_rejected_with_the_expected_value(option, expected):
    with pytest.raises(LinkError, match="option") as error:
        open_original_emulator(f"emulator:?protocol=original&{option}", ORIGINAL)
    assert expected in str(error.value)
    assert "\n" not in str(error.value)


def test_the_raw_link_requires_the_original_protocol():
    with pytest.raises(LinkError, match="expected the option protocol=original"):
        open_original_emulator("emulator:", ORIGINAL)


def test_options_of_the_original_hub_are_unknown_without_the_original_protocol():
    hand = load_hand("allegro")
    with pytest.raises(LinkError, match="unknown option 'ring'"):
        open_emulator("emulator:?ring=128", hand)


@pytest.mark.parametrize("name", ["original", "original_complete", "first_generation"])
def test_every_original_hand_runs_in_the_emulator(name, tmp_path):
    hand = load_hand(name)
    world = format_world(hand, make_original_settings(FIRST_GENERATION))
    statistics = run_emulator(world, tmp_path / "stream.bin", 2.0)["original"]
    assert statistics["failed_tries"] == 0
    assert statistics["messages"] == statistics["cycles"] * len(hand.boards)


def test_known_faults_reach_the_world_file():
    world = format_world(
        ORIGINAL, make_original_settings(OriginalFirmware(known_faults=["wrong_buffer", "wait_for_ever"]))
    )
    assert "faults=wrong_buffer,wait_for_ever" in world


def test_a_force_lowers_the_count_of_its_taxel_only():
    link = open_original_emulator("emulator:?protocol=original&live=1&noise_counts=0", ORIGINAL)
    decoder = OriginalDecoder(FORMATS["original"])
    palm, taxel = 0x15, 5

    def read_palm(seconds: float) -> list[int]:
        """Read for a time; return the counts of the last message of the palm."""
        counts: list[int] = []
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            chunk = link.read(0.1)
            for message in decoder.push(chunk.data) if chunk else []:
                counts = list(message.counts) if message.address == palm else counts
        return counts

    try:
        unloaded = read_palm(0.8)
        forces = np.zeros(ORIGINAL.n_taxels)
        forces[ORIGINAL.get_slice(palm).start + taxel] = 1.0
        link.apply(forces)
        loaded = read_palm(0.8)
    finally:
        link.close()
    signal_counts = np.subtract(unloaded, loaded)
    assert 300 < signal_counts[taxel] < 700  # counts under 1 N; the full scale has 4,000 counts
    assert not np.delete(signal_counts, taxel).any()
