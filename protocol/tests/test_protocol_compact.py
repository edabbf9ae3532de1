"""The C coding of compact snapshots equals its definition in Python, and rejects everything else."""

import ctypes
import json
import math
import random
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel_protocol import compact, compact_tables
from taxel_protocol.compact import CompactError, KeyFrame, Taxel
from taxel_protocol.framing import crc32
from taxel_protocol.limits import COMPACT_TAXELS_MAX

ROOT = Path(__file__).resolve().parents[2]
BOARDS = json.loads((ROOT / "protocol" / "vectors" / "compact.json").read_text())["boards"]
CAPACITY = 600
OK, DAMAGED, NO_KEY_FRAME = 0, 1, 2
ACKNOWLEDGE, FORGET = 1, 2

means = st.integers(0, compact_tables.COMPACT_MEAN_MAX)
levels = st.integers(0, compact_tables.COMPACT_LEVEL_MAX)
taxels = st.builds(Taxel, means, levels)
arbitrary_counts = st.integers(0, 0xFFFF)


class _KeyFrame(ctypes.Structure):
    """`struct taxel_compact_key_frame`."""

    _fields_ = [
        ("is_valid", ctypes.c_bool),
        ("taxels", ctypes.c_uint8),
        ("updates", ctypes.c_uint8),
        ("id", ctypes.c_uint16),
        ("timestamp_us", ctypes.c_uint32),
        ("states", ctypes.c_uint32 * COMPACT_TAXELS_MAX),
    ]

    def equals(self, other: KeyFrame) -> bool:
        """Return whether a key frame of the definition has the same content."""
        head = (self.id, self.timestamp_us, self.updates, self.taxels)
        states = [taxel.mean << 10 | taxel.level for taxel in other.taxels]
        same = head == (other.id, other.timestamp_us, other.updates, len(states))
        return same and self.states[: len(states)] == states


class _Receiver(ctypes.Structure):
    """`struct taxel_compact_receiver`."""

    _fields_ = [
        ("answer", ctypes.c_uint8),
        ("snapshots_until_repeat", ctypes.c_uint8),
        ("key_frame", _KeyFrame),
        ("pending", _KeyFrame),
    ]


class _Snapshot(ctypes.Structure):
    """`struct taxel_compact_snapshot`."""

    _fields_ = [
        ("sequence", ctypes.c_uint16),
        ("timestamp_us", ctypes.c_uint32),
        ("counts", ctypes.c_uint16 * COMPACT_TAXELS_MAX),
    ]


class Host:
    """The C side of a host, for one board."""

    def __init__(self, library: Any) -> None:
        """Create a receiver without a key frame; library: the C codec."""
        self._library = library
        self.state = _Receiver()
        self.snapshot = _Snapshot()

    def receive(self, address: int, taxel_count: int, data: bytes) -> int:
        """Decode a compact snapshot in C; return OK, DAMAGED or NO_KEY_FRAME."""
        size = ctypes.c_size_t(len(data))
        buffer = (ctypes.c_char * len(data)).from_buffer_copy(data) if data else None
        return int(
            self._library.taxel_compact_receive(
                ctypes.byref(self.state), address, taxel_count, buffer, size, ctypes.byref(self.snapshot)
            )
        )

    def get_decoded(self, taxel_count: int) -> tuple[int, int, list[int]]:
        """Return the last decoded snapshot as (sequence, timestamp, counts)."""
        return self.snapshot.sequence, self.snapshot.timestamp_us, self.snapshot.counts[:taxel_count]


@pytest.fixture(scope="module")
def library(codec_library_path: str) -> Any:
    """C codec with the result types of its compact functions."""
    loaded = ctypes.CDLL(codec_library_path)
    for name in ("encode", "decode"):
        getattr(loaded, f"taxel_compact_{name}").restype = ctypes.c_bool
    loaded.taxel_compact_update.restype = ctypes.c_uint32
    loaded.taxel_compact_residual.restype = ctypes.c_uint8
    return loaded


def pack_states(states: list[Taxel]) -> Any:
    """Return predictions of taxels as the array of numbers that C uses."""
    return (ctypes.c_uint32 * len(states))(*(taxel.mean << 10 | taxel.level for taxel in states))


def encode_in_c(library: Any, states: list[Taxel], counts: list[int]) -> bytes:
    """Encode counts in C with the predictions of their taxels."""
    raw = b"".join(count.to_bytes(2, "little") for count in counts)
    out, size = ctypes.create_string_buffer(CAPACITY), ctypes.c_size_t()
    number, capacity = ctypes.c_size_t(len(counts)), ctypes.c_size_t(CAPACITY)
    assert library.taxel_compact_encode(pack_states(states), raw, number, out, capacity, ctypes.byref(size))
    return out.raw[: size.value]


def decode_in_c(library: Any, states: list[Taxel], data: bytes) -> list[int] | None:
    """Decode counts in C with the predictions of their taxels; return None for invalid bytes."""
    counts = (ctypes.c_uint16 * len(states))()
    sizes = ctypes.c_size_t(len(states)), ctypes.c_size_t(len(data))
    is_valid = library.taxel_compact_decode(pack_states(states), sizes[0], data, sizes[1], counts)
    return list(counts) if is_valid else None


def test_the_cumulative_table_is_the_documented_mixture_of_normal_and_cauchy() -> None:
    """99.5 % normal and 0.5 % Cauchy, three times as wide, at k eighths of the scale, truncated at 8 scales."""
    half = compact_tables.COMPACT_CUMULATIVE[-1]
    normal = [math.erf(k / 8 / math.sqrt(2)) for k in range(65)]
    wide = [math.atan(k / 24) for k in range(65)]
    shares = [0.995 * n / normal[-1] + 0.005 * w / wide[-1] for n, w in zip(normal, wide, strict=True)]
    assert list(compact_tables.COMPACT_CUMULATIVE) == [round(half * share) for share in shares]
    assert compact_tables.COMPACT_ESCAPE + 2 * half == 1 << compact_tables.COMPACT_TOTAL_BITS


def test_the_predicted_count_never_needs_an_escape() -> None:
    """The means, in units of 1/64 count, lie at whole counts, at the edges between counts and at both limits."""
    for level in range(compact_tables.COMPACT_LEVEL_MAX + 1):
        for mean in (0, 31, 32, 33, 64_000, 64_031, 64_032, compact_tables.COMPACT_MEAN_MAX):
            taxel = Taxel(mean, level)
            assert taxel.interval(taxel.centre >> taxel.raw_bits)[1] > 0


@settings(max_examples=300, deadline=None)
@given(taxels, arbitrary_counts | st.integers(-300, 300), st.integers(1, 15))
def test_c_updates_a_state_as_the_definition_does(library: Any, taxel: Taxel, count: int, updates: int) -> None:
    if count <= 300:  # a small number is a difference from the predicted count
        count = min(max(taxel.centre + count, 0), 0xFFFF)
    state = taxel.mean << 10 | taxel.level  # C stores a prediction in one number: the mean above the 10 bits of level
    residual = library.taxel_compact_residual(state, count)
    expected = taxel.update(count, compact_tables.COMPACT_GAINS[updates - 1])
    assert library.taxel_compact_update(state, residual, updates) == expected.mean << 10 | expected.level


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(taxels, arbitrary_counts, st.integers(-40, 40), st.booleans()), min_size=1, max_size=40))
def test_both_implementations_encode_and_decode_the_same_bytes(
    library: Any, samples: list[tuple[Taxel, int, int, bool]]
) -> None:
    states = [taxel for taxel, *_ in samples]
    counts = [min(max(t.centre + near, 0), 0xFFFF) if is_near else count for t, count, near, is_near in samples]
    data = compact.encode_counts(states, counts)
    assert encode_in_c(library, states, counts) == data
    assert not data.endswith(b"\0")
    assert compact.decode_counts(states, data) == counts
    assert decode_in_c(library, states, data) == counts


@settings(max_examples=200, deadline=None)
@given(st.lists(taxels, min_size=1, max_size=20), st.binary(max_size=60))
def test_both_implementations_give_the_same_result_for_arbitrary_bytes(
    library: Any, states: list[Taxel], data: bytes
) -> None:
    try:
        expected = compact.decode_counts(states, data)
    except CompactError:
        expected = None
    assert decode_in_c(library, states, data) == expected


@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board["name"])
def test_c_decodes_the_board_histories_of_the_vectors(library: Any, board: dict[str, Any]) -> None:
    host = Host(library)
    address, key_frame, pending = board["address"], None, None
    for scan, step in enumerate(board["snapshots"]):
        data, counts = bytes.fromhex(step["bytes"]), step["counts"]
        if step["acknowledged"]:
            key_frame, pending = pending, None
        decoded = compact.decode(address, len(counts), data, [key_frame] if key_frame else [])
        assert (decoded.sequence, decoded.timestamp_us, decoded.counts) == (scan, step["timestamp_us"], counts)
        assert host.receive(address, len(counts), data) == OK
        assert host.get_decoded(len(counts)) == (scan, step["timestamp_us"], counts)
        if key_frame and not data[2] & 0x1F:  # width 0: a delta frame, which refers to the key frame in use
            assert host.state.key_frame.equals(key_frame)
        if decoded.key_frame:
            pending = decoded.key_frame
            assert host.state.answer == ACKNOWLEDGE
            assert host.state.pending.equals(pending)
            # A packed key frame (width above 0) starts a new prediction: the earlier key frame is no longer used.
            key_frame = None if data[2] & 0x1F else key_frame


class Board:
    """A board by the Python definition, which marks random snapshots as key frames."""

    def __init__(self, address: int, taxel_count: int, rng: random.Random) -> None:
        """Create a board with random counts, whose spread is constant."""
        self.address, self.taxel_count, self._rng = address, taxel_count, rng
        self.means = [rng.uniform(0, 0xFFFF) for _ in range(taxel_count)]
        self.sigma = rng.choice([0.0, 0.3, 1.5, 30.0, 5000.0])
        self.time = rng.getrandbits(32)
        self.restart()

    def restart(self) -> None:
        """Restart the board: it has no key frame and numbers its snapshots from 0."""
        self.scan = 0
        self.key_frame: KeyFrame | None = None
        self.pending: KeyFrame | None = None

    def take_snapshot(self) -> tuple[bytes, tuple[int, int, list[int]]]:
        """Draw and encode a snapshot; return (bytes, (sequence, timestamp, counts))."""
        rng = self._rng
        self.means = [rng.uniform(0, 0xFFFF) if rng.random() < 0.02 else mean for mean in self.means]
        counts = [min(max(round(rng.gauss(mean, self.sigma)), 0), 0xFFFF) for mean in self.means]
        self.time = (self.time + rng.choice([1000, 20_000, 9_000_000])) % 2**32
        is_key_frame = rng.random() < 0.5
        data = compact.encode(self.address, self.scan, self.time, counts, self.key_frame, is_key_frame)
        decoded = compact.decode(self.address, self.taxel_count, data, [self.key_frame] if self.key_frame else [])
        self.pending = decoded.key_frame or self.pending
        if data[2] & 0x1F and is_key_frame:
            self.key_frame = None
        content = (self.scan, self.time, counts)
        self.scan = (self.scan + 1) % 65536
        return data, content

    def receive(self, answer: int, key_frame_id: int) -> None:
        """Process an answer of the host: ACKNOWLEDGE or FORGET."""
        if answer == ACKNOWLEDGE and self.pending and self.pending.id == key_frame_id:
            self.key_frame, self.pending = self.pending, None
        elif answer == FORGET:
            self.key_frame = self.pending = None


@pytest.mark.parametrize("seed", range(25))
def test_decoded_counts_are_correct_and_states_equal_under_any_loss(library: Any, seed: int) -> None:
    """Snapshots and answers are lost, late or damaged; boards and hosts restart. The seed replays a case."""
    rng = random.Random(seed)
    board, host = Board(rng.randint(0x08, 0x77), rng.choice([1, 5, 27]), rng), Host(library)
    delayed_answers: list[tuple[int, int]] = []
    decoded_count = 0
    for _ in range(120):
        data, content = board.take_snapshot()
        if rng.random() < 0.03:
            board.restart()
        if rng.random() < 0.03:
            host = Host(library)
        if rng.random() < 0.2:
            continue
        if rng.random() < 0.1:
            damaged = bytearray(data)
            damaged[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            assert host.receive(board.address, board.taxel_count, bytes(damaged)) == DAMAGED
        result = host.receive(board.address, board.taxel_count, data)
        assert result in {OK, NO_KEY_FRAME}
        if result == OK:
            decoded_count += 1
            assert host.get_decoded(board.taxel_count) == content
        if host.state.answer:
            delayed_answers.append((host.state.answer, host.state.pending.id))
            host.state.answer = 0
        if delayed_answers and rng.random() < 0.7:
            board.receive(*delayed_answers.pop(0))
            if rng.random() < 0.2:
                delayed_answers.clear()
        pending = host.state.pending
        if board.key_frame and pending.is_valid and pending.id == board.key_frame.id:
            assert pending.equals(board.key_frame)
    assert decoded_count > 30  # otherwise the test compared too few of the 120 snapshots


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 255), st.integers(0, 255), st.binary(max_size=80), st.booleans(), st.integers(0, 255))
def test_arbitrary_snapshots_are_rejected_or_decoded_as_by_the_definition(
    library: Any, address: int, taxel_count: int, body: bytes, has_valid_crc: bool, format_byte: int
) -> None:
    host = Host(library)
    first = compact.encode_packed(0x20, 1, 2, [1000] * 20, is_key_frame=True)
    host.receive(0x20, 20, first)
    if has_valid_crc and len(body) > 8:  # replace the format and refer to the key frame: its id is a part of its CRC
        body = body[:2] + bytes([format_byte]) + first[-4:-2] + body[5:]
    crc = crc32(body, crc32(bytes([address])))
    data = body + crc.to_bytes(4, "little") if has_valid_crc else body
    key_frames = [compact.decode(0x20, 20, first, []).key_frame]
    try:
        expected = compact.decode(address, taxel_count, data, [key_frame for key_frame in key_frames if key_frame])
    except CompactError:
        assert host.receive(address, taxel_count, data) in {DAMAGED, NO_KEY_FRAME}
        return
    if 0 < taxel_count <= COMPACT_TAXELS_MAX:
        assert host.receive(address, taxel_count, data) == OK
        assert host.get_decoded(taxel_count) == (expected.sequence, expected.timestamp_us, expected.counts)
