"""The time of a frame is the start of its scan on the host's clock, within 1 ms, for any clock error of the boards.

The synthetic streams contain the true times. For the emulator they follow from the world settings: the clock of a board
starts when the board has booted and runs at its own rate.
"""

import random
from typing import NamedTuple

import numpy as np
import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world, sample_board_clocks_ppm
from taxel.link import CaptureLink, CaptureWriter, Chunk, run_emulator
from taxel.stream import FrameStream
from taxel.stream.clock import LowerEnvelope
from taxel_protocol import Command, FrameType, encode_frame
from taxel_protocol.frames import CommandPayload, HostHandshake
from taxel_protocol.layout import pack

TOLERANCE_S = 1e-3  # largest error of a frame's time
SETTLED_S = 3.0  # time after the start from which the error is checked
BYTE_S = 1e-5  # duration of one byte on the wire
READ_S = 2.4e-3  # duration of the hub's read of one board
SNAPSHOT_AGE_S = 0.03  # largest time from the start of a scan to the hub's read of its counts
HOST_OFFSET_S = 1000.0  # time on the host's clock minus the time of the simulation


class Board:
    """Clock of a board: it runs `ppm` parts per million too fast and shows `begin_us` at the time `boot_s`."""

    def __init__(self, ppm, boot_s=0.04, begin_us=0):
        self.rate, self.boot_s, self.begin_us = 1.0 + ppm * 1e-6, boot_s, begin_us

    def compute_time_us(self, true_s):
        """Return what the clock shows at the true time `true_s`, microseconds."""
        return int(self.begin_us + (true_s - self.boot_s) * self.rate * 1e6)


class SimulatedStream(NamedTuple):
    """Chunks of a simulated stream, and the true time of each of its frames."""

    chunks: list
    true_times_s: dict  # (address, board sequence, cycle) -> start of the scan, seconds on the host's clock

    def find_true_time(self, frame):
        """Return the start of the scan of a received frame, seconds on the host's clock."""
        return self.true_times_s[frame.address, frame.sequence, frame.cycle]


def make_chunks(parts, jitter_s, rng):
    """Make the chunks that a host reads at random intervals of up to `jitter_s`.

    parts: (time at which the hub sends the bytes, on the host's clock; bytes). jitter_s: 0: each part is read when its
    last byte has arrived.
    """
    chunks, line_free_s, read_s = [], 0.0, 0.0
    for departure, data in parts:
        line_free_s = max(line_free_s, departure) + len(data) * BYTE_S
        while read_s < line_free_s:
            read_s = max(read_s + rng.uniform(0.0, jitter_s), line_free_s - jitter_s) if jitter_s else line_free_s
        chunks.append(Chunk(data, round(read_s * 1e9)))
    return chunks


def simulate_stream(
    hub, boards, seconds, jitter_s, seed=1, hub_ppm=0.0, hub_begin_us=0, host_offset_s=HOST_OFFSET_S, begin_s=0.1
):
    """Simulate a hub that polls boards and reads the clock of one board in each cycle.

    boards: address -> list of (time from which on the clock is valid, `Board`): a new clock for each restart. seconds:
    end of the simulation. hub_ppm, hub_begin_us: rate error of the hub's clock, and its reading at the time 0.
    host_offset_s: time on the host's clock minus the time of the simulation.
    """
    rng = random.Random(seed)
    true_times_s = {}
    rate = 1.0 + hub_ppm * 1e-6
    handshake_s = begin_s - 0.05
    handshake = hub.encode_handshake(tag=1, uptime_us=int(hub_begin_us + handshake_s * rate * 1e6))
    parts = [(handshake_s + host_offset_s, handshake)]
    now_s, cycle, sequence = begin_s, 0, 0
    addresses = sorted(boards)

    def hub_us(t):
        return int(hub_begin_us + t * rate * 1e6)

    def find_board(address, t):
        return [board for since, board in boards[address] if since <= t][-1]

    while now_s < seconds:
        for address in addresses:
            scan = now_s - rng.uniform(0.2, 1.0) * SNAPSHOT_AGE_S
            board = find_board(address, scan)
            if scan >= board.boot_s:
                sequence += 1
                data = hub.encode_taxels(
                    address,
                    cycle,
                    range(60),
                    board_sequence=sequence,
                    board_us=board.compute_time_us(scan),
                    hub_us=hub_us(now_s),
                )
                true_times_s[address, sequence % 65536, cycle % 65536] = scan + host_offset_s
                parts.append((now_s + READ_S + host_offset_s, data))
            now_s += READ_S + 2e-5
        address = addresses[cycle % len(addresses)]
        sync_s = now_s + 7e-5
        now_s += 2.5e-4
        board = find_board(address, sync_s)
        if sync_s >= board.boot_s:
            reading = hub.encode_sync(address, board.compute_time_us(sync_s), hub_us(sync_s))
            parts.append((now_s + host_offset_s, reading))
        cycle += 1
    return SimulatedStream(make_chunks(parts, jitter_s, rng), true_times_s)


def measure_errors(link, find_true_time, first_s):
    """Return f64[n frames, 2], seconds: the true time since `first_s`, and the error of the time of each frame."""
    stream = FrameStream(link, lambda message: None)
    rows = []
    try:
        while True:
            stream.poll()
            while stream.frames:
                frame = stream.frames.popleft()
                true_s = find_true_time(frame)
                rows.append((true_s - first_s, frame.time_s - true_s))
    except EOFError:
        return np.array(rows)


def find_largest_error(rows, since_s):
    """Return the largest absolute error of the frames after `since_s`, of which there must be more than 50."""
    settled = rows[rows[:, 0] >= since_s, 1]
    assert len(settled) > 50
    return float(np.abs(settled).max())


PPMS = [-20_000, -7_000, 0, 3, 12_000, 20_000]  # rate errors of the boards' clocks, parts per million


@pytest.mark.parametrize("reads_single_chunks", [False, True], ids=["many chunks at once", "single chunks"])
@pytest.mark.parametrize(("jitter_ms", "hub_ppm"), [(0.0, 0.0), (1.0, 20_000.0), (16.0, -20_000.0)])
def test_board_clocks_off_by_two_percent_are_mapped_to_the_host(
    hub, make_prepared_link, reads_single_chunks, jitter_ms, hub_ppm
):
    boards = {0x20 + i: [(-1.0, Board(ppm))] for i, ppm in enumerate(PPMS)}
    sent = simulate_stream(hub, boards, 5.0, jitter_ms * 1e-3, hub_ppm=hub_ppm)
    link = make_prepared_link(sent.chunks, reads_single_chunks=reads_single_chunks)
    rows = measure_errors(link, sent.find_true_time, HOST_OFFSET_S)
    assert find_largest_error(rows, SETTLED_S) < TOLERANCE_S


@pytest.mark.parametrize("delays_s", [(0.016, 0.0), (0.0, 0.016)], ids=["first point delayed", "second point delayed"])
def test_two_early_arrivals_give_a_slope_within_the_oscillator_tolerance(delays_s):
    # If the USB latency delays one of two points that are 60 ms apart, a line through both is wrong by a quarter.
    envelope = LowerEnvelope()
    for x_us, delay_s in zip((0.0, 60_000.0), delays_s, strict=True):
        envelope.add(x_us, x_us * 1e-6 + delay_s)
    x0, y0, slope = envelope.line
    # Extrapolation to 0.5 s: error of at most the delay plus the tolerance of 2.5 % of the oscillator's rate.
    assert y0 + slope * (500_000.0 - x0) == pytest.approx(0.5, abs=0.016 + 0.025 * 0.5)


@pytest.mark.parametrize("reads_single_chunks", [False, True], ids=["many chunks at once", "single chunks"])
@pytest.mark.parametrize("jitter_ms", [0.0, 16.0])
def test_the_clock_of_a_single_board_is_mapped_to_the_host(hub, make_prepared_link, reads_single_chunks, jitter_ms):
    sent = simulate_stream(hub, {0x40: [(-1.0, Board(15_000))]}, 5.0, jitter_ms * 1e-3, hub_ppm=300.0)
    link = make_prepared_link(sent.chunks, reads_single_chunks=reads_single_chunks)
    rows = measure_errors(link, sent.find_true_time, HOST_OFFSET_S)
    assert find_largest_error(rows, SETTLED_S) < TOLERANCE_S


@pytest.mark.parametrize("reads_single_chunks", [False, True], ids=["many chunks at once", "single chunks"])
@pytest.mark.parametrize("wrapping_clock", ["boards", "hub"])
def test_times_are_continuous_across_a_32_bit_wrap(hub, make_prepared_link, reads_single_chunks, wrapping_clock):
    begin = 2**32 - 4_000_000
    boards = {
        0x20 + i: [(-1.0, Board(ppm, begin_us=begin if wrapping_clock == "boards" else 0))]
        for i, ppm in enumerate(PPMS)
    }
    sent = simulate_stream(hub, boards, 6.0, 2e-3, hub_begin_us=begin if wrapping_clock == "hub" else 0)
    link = make_prepared_link(sent.chunks, reads_single_chunks=reads_single_chunks)
    rows = measure_errors(link, sent.find_true_time, HOST_OFFSET_S)
    assert find_largest_error(rows, SETTLED_S) < TOLERANCE_S


@pytest.mark.parametrize("reads_single_chunks", [False, True], ids=["many chunks at once", "single chunks"])
@pytest.mark.parametrize("begin_us", [0, 1_000_000_000])
def test_a_board_is_mapped_before_and_after_its_restart(hub, make_prepared_link, reads_single_chunks, begin_us):
    # Between a restart and the next clock readings, the frames of a board have the time of the hub's read.
    boards = {0x20 + i: [(-1.0, Board(ppm))] for i, ppm in enumerate(PPMS)}
    boards[0x22] = [(-1.0, Board(-9_000, begin_us=begin_us)), (4.0, Board(-9_000, boot_s=4.04))]
    sent = simulate_stream(hub, boards, 7.0 if reads_single_chunks else 9.0, 2e-3)
    link = make_prepared_link(sent.chunks, reads_single_chunks=reads_single_chunks)
    rows = measure_errors(link, sent.find_true_time, HOST_OFFSET_S)
    if reads_single_chunks:
        is_undisturbed = (rows[:, 0] < 3.9) | (rows[:, 0] > 6.0)
    else:  # frames decoded together with the restart have read times too
        is_undisturbed = rows[:, 0] > 8.0
    assert find_largest_error(rows[is_undisturbed], SETTLED_S) < TOLERANCE_S
    assert np.abs(rows[rows[:, 0] >= SETTLED_S, 1]).max() < 2 * SNAPSHOT_AGE_S + TOLERANCE_S


@pytest.mark.parametrize("period_s", [0.0, 0.5], ids=["fast cycles", "slow cycles"])
def test_a_restart_inside_a_large_batch_does_not_change_the_times_of_earlier_frames(hub, make_prepared_link, period_s):
    # Large batches occur in recordings, and if the reader was busy.
    board = {0x20: [(-1.0, Board(5_000, begin_us=3_000_000_000)), (12.0, Board(5_000, boot_s=12.04))]}
    sent = simulate_stream(hub, board, 24.0, 0.0)
    # A cycle takes about 3 ms and has two chunks, a taxel frame and a clock reading. The step between chunks is odd, so
    # both kinds remain, each about once in `period_s`.
    chunks = sent.chunks if not period_s else sent.chunks[:: round(period_s / 3e-3) | 1]
    rows = measure_errors(make_prepared_link(chunks), sent.find_true_time, HOST_OFFSET_S)
    assert np.abs(rows[:, 1]).max() < 60.0  # the other clock would give an error of an hour


@pytest.mark.parametrize("reads_single_chunks", [False, True], ids=["many chunks at once", "single chunks"])
def test_a_hub_restart_starts_a_new_clock_mapping(make_hub, make_prepared_link, reads_single_chunks):
    boards = {0x20 + i: [(-1.0, Board(ppm, boot_s=-3.0))] for i, ppm in enumerate(PPMS)}
    first_hub, second_hub = make_hub(100), make_hub(0)
    before_restart = simulate_stream(first_hub, boards, 4.5, 2e-3, hub_begin_us=50_000_000)
    restart = Chunk(second_hub.encode_handshake(tag=0, uptime_us=50), before_restart.chunks[-1].arrival_ns + 10_000_000)
    # The boards have the same rate errors (ppm) as before, but they booted earlier in the time of the second stream.
    boards = {address: [(-1.0, Board(b[0][1].rate * 1e6 - 1e6, boot_s=-10.0))] for address, b in boards.items()}
    after_restart = simulate_stream(second_hub, boards, 5.0, 2e-3, host_offset_s=1005.0)
    has_restarted = False

    def find_true_time(frame):
        """Find the true time in the stream before or after the restart, which sets the hub's clock to 0."""
        nonlocal has_restarted
        has_restarted |= frame.hub_time_us < 49_000_000  # the first hub's clock begins at 50 s
        return (after_restart if has_restarted else before_restart).find_true_time(frame)

    rows = measure_errors(
        make_prepared_link(
            [*before_restart.chunks, restart, *after_restart.chunks], reads_single_chunks=reads_single_chunks
        ),
        find_true_time,
        HOST_OFFSET_S,
    )
    # The first stream ends at 4.5 s. The second stream begins at 5 s; its clock mapping has settled after 8.5 s.
    settled = ((rows[:, 0] > 3.0) & (rows[:, 0] < 4.0)) | (rows[:, 0] > 8.5)
    assert find_largest_error(rows[settled], 0.0) < TOLERANCE_S


def test_without_arrival_times_the_frames_have_times_on_the_clock_of_the_hub(hub, make_prepared_link):
    sent = simulate_stream(hub, {0x20: [(-1.0, Board(-20_000))], 0x21: [(-1.0, Board(9_000))]}, 6.0, 0.0)
    # The link declares no real arrival times, so the constant time of 7 ns must not be used.
    link = make_prepared_link([Chunk(chunk.data, 7) for chunk in sent.chunks], has_pacing=False)
    link.is_recorded = False
    rows = measure_errors(link, lambda frame: sent.find_true_time(frame) - HOST_OFFSET_S, 0.0)
    assert find_largest_error(rows, SETTLED_S) < TOLERANCE_S


def write_host_input(path):
    """Write a capture with a handshake of the host at 0.2 s and its start command at 0.25 s."""
    handshake = pack(HostHandshake, {"tag": 1, "version_min": 1, "version_max": 1})
    start = pack(CommandPayload, {"tag": 2, "command": Command.START})
    with CaptureWriter(path) as writer:
        writer.write(encode_frame(FrameType.HOST_HANDSHAKE, 0, handshake), 200_000_000)
        writer.write(encode_frame(FrameType.COMMAND, 1, start), 250_000_000)


class SingleChunkLink(CaptureLink):
    """Capture link that returns None after every chunk, as a port that is read immediately."""

    pause = False

    def read(self, timeout_s=0.0):
        self.pause = not self.pause
        return super().read() if self.pause else None


@pytest.mark.parametrize("reader", [CaptureLink, SingleChunkLink], ids=["many chunks at once", "single chunks"])
@pytest.mark.parametrize("latency_ms", [1.0, 16.0])
@pytest.mark.parametrize(("hand", "hub_ppm"), [("allegro", 12_000.0), ("flat8", -8_000.0)])
def test_frames_of_the_emulator_have_their_true_times(tmp_path, hand, hub_ppm, latency_ms, reader):
    description = load_hand(hand)
    settings = WorldSettings(usb_latency_ms=latency_ms, hub_clock_ppm=hub_ppm)
    write_host_input(tmp_path / "host.bin")
    run_emulator(format_world(description, settings), tmp_path / "a.bin", 6.5, host_input=tmp_path / "host.bin")
    clocks = zip(description.boards, sample_board_clocks_ppm(description, settings), strict=True)
    rates = {board.address: 1.0 + ppm * 1e-6 for board, ppm in clocks}

    def find_true_time(frame):
        return settings.boot_ms * 1e-3 + frame.board_time_us * 1e-6 / rates[frame.address]

    rows = measure_errors(reader(tmp_path / "a.bin"), find_true_time, 0.0)
    largest = find_largest_error(rows, SETTLED_S)
    print(f"{hand}, USB latency {latency_ms:g} ms, hub {hub_ppm:g} ppm: largest error {largest * 1e6:.0f} us")
    assert largest < TOLERANCE_S


@pytest.mark.parametrize("reader", [CaptureLink, SingleChunkLink], ids=["many chunks at once", "single chunks"])
def test_a_restarted_board_of_the_emulator_is_mapped_again(tmp_path, reader):
    description = load_hand("allegro")
    settings = WorldSettings(faults=("4.0 restart 0x22",))
    write_host_input(tmp_path / "host.bin")
    run_emulator(format_world(description, settings), tmp_path / "a.bin", 7.5, host_input=tmp_path / "host.bin")
    clocks = zip(description.boards, sample_board_clocks_ppm(description, settings), strict=True)
    rates = {board.address: 1.0 + ppm * 1e-6 for board, ppm in clocks}

    def find_true_time(frame):
        # The board restarts at 4 s, and answers again only after its boot.
        restarted = frame.address == 0x22 and frame.hub_time_us > 4_030_000
        boot = 4.0 + settings.boot_ms * 1e-3 if restarted else settings.boot_ms * 1e-3
        return boot + frame.board_time_us * 1e-6 / rates[frame.address]

    rows = measure_errors(reader(tmp_path / "a.bin"), find_true_time, 0.0)
    # Until the clock of the restarted board is read again, its frames have the time at which the hub read them. The
    # same is true for earlier frames that are decoded together with the restart.
    is_undisturbed = (rows[:, 0] < (3.9 if reader is SingleChunkLink else 2.0)) | (rows[:, 0] > 6.2)
    assert find_largest_error(rows[is_undisturbed], SETTLED_S) < TOLERANCE_S
    assert np.abs(rows[:, 1]).max() < 0.15
