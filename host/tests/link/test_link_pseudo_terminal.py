"""The emulator behind a pseudo-terminal: a serial port like any other, which clients may leave and come back to."""

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
from taxel.link.emulator import emulator_program
from taxel_protocol import FrameType, ReferenceDecoder

PATIENCE_S = 20.0
COUNTS = {name: 1000 + 3 * np.arange(load_hand(name).n_taxels) for name in ("allegro", "flat8")}


@pytest.fixture
def serve(tmp_path):
    """Start an emulator behind a pseudo-terminal whose taxels measure COUNTS; gives (process, device)."""
    processes = []

    def start(hand, *arguments):
        description = load_hand(hand)
        (tmp_path / "world.txt").write_text(format_world(description, WorldSettings()))
        write_stimulus(tmp_path / "a.stm", [0.0], [COUNTS[hand]], "counts")
        command = [emulator_program(), "--world", tmp_path / "world.txt", "--uart", "pty"]
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
    for frame in frames:
        assert np.array_equal(frame.raw_counts, COUNTS[skin.hand.name][skin.hand.get_slice(frame.address)])


@pytest.mark.parametrize("hand", ["flat8", "allegro"])
@pytest.mark.parametrize("speed", [[], ["--fast"]], ids=["real time", "fast"])
def test_a_skin_behind_a_terminal_streams(serve, hand, speed):
    _, device = serve(hand, *speed)
    with taxel.open(f"serial://{device}", hand) as skin:
        frames = list(itertools.islice(skin, 60))
        assert skin.missing_boards == []
        assert {frame.address for frame in frames} == {board.address for board in skin.hand.boards}
        check_counts(skin, frames)
        assert skin.losses.lost_on_wire == 0


def test_a_client_may_leave_and_come_back(serve):
    _, device = serve("flat8")
    for _ in range(3):
        with taxel.open(f"serial://{device}", "flat8") as skin:
            check_counts(skin, itertools.islice(skin, 20))


def test_a_client_that_leaves_without_a_word_does_no_harm_to_the_next(serve):
    _, device = serve("allegro")
    for _ in range(3):
        skin = taxel.open(f"serial://{device}", "allegro")
        frames = list(itertools.islice(skin, 40))
        check_counts(skin, frames)
        skin._stream.close()  # as a killed program would: the hub goes on streaming to nobody
        time.sleep(0.4)


def test_what_was_sent_while_nobody_listened_is_never_a_wrong_frame(serve):
    _, device = serve("allegro")
    skin = taxel.open(f"serial://{device}", "allegro")
    list(itertools.islice(skin, 5))
    skin._stream.close()
    time.sleep(0.7)
    link = SerialLink(device)  # joins the stream after its start, without a handshake
    raw = b""
    deadline = time.monotonic() + PATIENCE_S
    while len(raw) < 40_000 and time.monotonic() < deadline:
        chunk = link.read(0.1)
        raw += chunk.data if chunk else b""
    link.close()
    decoder = ReferenceDecoder()
    taxels = [frame for frame in decoder.push(raw) if frame[0] == FrameType.TAXELS]
    assert len(taxels) > 100
    hand = load_hand("allegro")
    for _, _, payload in taxels:
        counts = np.frombuffer(payload[14:-4], "<u2")
        assert np.array_equal(counts, COUNTS["allegro"][hand.get_slice(payload[0])])
    assert decoder.discarded_bytes < 600  # no more than the one frame whose beginning the other client took with it


def test_the_end_of_the_emulator_is_a_vanished_port(serve):
    process, device = serve("flat8")
    skin = taxel.open(f"serial://{device}", "flat8")
    frames = iter(skin)
    check_counts(skin, itertools.islice(frames, 20))
    process.send_signal(signal.SIGTERM)
    with pytest.raises(PortVanishedError) as caught:
        check_counts(skin, frames)
    assert str(caught.value).startswith(device)
    skin.close()


@pytest.mark.parametrize("speed", [[], ["--fast"]], ids=["real time", "fast"])
def test_the_emulator_ends_when_it_is_told_to_even_if_nobody_reads(serve, speed):
    process, device = serve("allegro", *speed)
    skin = taxel.open(f"serial://{device}", "allegro")
    skin._stream._pump.stop()  # the port stays open, but nobody reads it any more
    time.sleep(0.5)
    process.send_signal(signal.SIGTERM)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(PATIENCE_S / 4)
    ended = process.poll() is not None
    process.kill()
    skin.close()
    assert ended
