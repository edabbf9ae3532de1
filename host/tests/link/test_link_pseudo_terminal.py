"""The emulator behind a pseudo-terminal: a serial port that clients can close and open again."""

import contextlib
import itertools
import signal
import subprocess
import time

import numpy as np
import pytest

import taxel
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import PortVanishedError, SerialLink, write_stimulus
from taxel.link.emulator import find_emulator_program
from taxel_protocol import FrameType, ReferenceDecoder

TIMEOUT_S = 20.0
LARGEST_FRAME_BYTES = 600
COUNTS = {name: 1000 + 3 * np.arange(load_hand(name).n_taxels) for name in ("allegro", "flat8")}


@pytest.fixture
def start_emulator(tmp_path):
    """Function that starts an emulator behind a pseudo-terminal; it returns (process, device path).

    The taxels of the emulator measure COUNTS.
    """
    processes = []

    def start(hand, *arguments):
        description = load_hand(hand)
        (tmp_path / "world.txt").write_text(format_world(description, WorldSettings()))
        write_stimulus(tmp_path / "a.stm", [0.0], [COUNTS[hand]], "counts")
        command = [find_emulator_program(), "--world", tmp_path / "world.txt", "--uart", "pty"]
        command += ["--stimulus", tmp_path / "a.stm"]
        process = subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True)
        processes.append(process)
        return process, process.stdout.readline().strip()

    yield start
    for process in processes:
        process.kill()
        process.wait()
        process.stdout.close()


def check_counts(skin, frames):
    """Check that every frame has the counts of the stimulus."""
    for frame in frames:
        assert np.array_equal(frame.raw_counts, COUNTS[skin.hand.name][skin.hand.get_slice(frame.address)])


@pytest.mark.parametrize("hand", ["flat8", "allegro"])
@pytest.mark.parametrize("speed", [[], ["--fast"]], ids=["real time", "fast"])
def test_a_skin_behind_a_pseudo_terminal_streams_the_stimulus_counts(start_emulator, hand, speed):
    _, device = start_emulator(hand, *speed)
    with taxel.open(f"serial://{device}", hand) as skin:
        frames = list(itertools.islice(skin, 60))
        assert skin.missing_boards == []
        assert {frame.address for frame in frames} == {board.address for board in skin.hand.boards}
        check_counts(skin, frames)
        assert skin.losses.lost_on_wire == 0


def test_a_client_can_close_and_open_the_port_repeatedly(start_emulator):
    _, device = start_emulator("flat8")
    for _ in range(3):
        with taxel.open(f"serial://{device}", "flat8") as skin:
            check_counts(skin, itertools.islice(skin, 20))


def test_a_client_that_leaves_without_a_stop_command_does_not_disturb_the_next_client(start_emulator):
    _, device = start_emulator("allegro")
    for _ in range(3):
        skin = taxel.open(f"serial://{device}", "allegro")
        frames = list(itertools.islice(skin, 40))
        check_counts(skin, frames)
        skin._stream.close()  # like a killed program: the hub continues to stream
        time.sleep(0.4)


def test_bytes_buffered_while_no_client_was_connected_give_no_wrong_frame(start_emulator):
    _, device = start_emulator("allegro")
    skin = taxel.open(f"serial://{device}", "allegro")
    list(itertools.islice(skin, 5))
    skin._stream.close()
    time.sleep(0.7)
    link = SerialLink(device)  # reads the running stream without a handshake
    raw = b""
    deadline = time.monotonic() + TIMEOUT_S
    while len(raw) < 40_000 and time.monotonic() < deadline:
        chunk = link.read(0.1)
        raw += chunk.data if chunk else b""
    link.close()
    decoder = ReferenceDecoder()
    taxel_frames = [frame for frame in decoder.push(raw) if frame[0] == FrameType.TAXELS]
    assert len(taxel_frames) > 100
    hand = load_hand("allegro")
    for _, _, payload in taxel_frames:
        counts = np.frombuffer(payload[14:-4], "<u2")  # between the fields of the frame and the CRC
        assert np.array_equal(counts, COUNTS["allegro"][hand.get_slice(payload[0])])
    assert decoder.discarded_bytes < LARGEST_FRAME_BYTES  # at most the frame whose beginning the first client had read


def test_a_terminated_emulator_is_reported_as_a_vanished_port(start_emulator):
    process, device = start_emulator("flat8")
    skin = taxel.open(f"serial://{device}", "flat8")
    frames = iter(skin)
    check_counts(skin, itertools.islice(frames, 20))
    process.send_signal(signal.SIGTERM)
    with pytest.raises(PortVanishedError) as caught:
        check_counts(skin, frames)
    assert str(caught.value).startswith(device)
    skin.close()


@pytest.mark.parametrize("speed", [[], ["--fast"]], ids=["real time", "fast"])
def test_sigterm_ends_the_emulator_while_no_client_reads(start_emulator, speed):
    process, device = start_emulator("allegro", *speed)
    skin = taxel.open(f"serial://{device}", "allegro")
    skin._stream._pump.stop()  # the port stays open but is not read
    time.sleep(0.5)
    process.send_signal(signal.SIGTERM)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(TIMEOUT_S / 4)
    has_ended = process.poll() is not None
    process.kill()
    skin.close()
    assert has_ended
