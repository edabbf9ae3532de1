"""The emulator as a link: it says what is wrong in its own words, counts what it did, and leaves nothing behind."""

import contextlib
import os
import signal
import tempfile
import threading
import time

import numpy as np
import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import (
    CaptureLink,
    CaptureWriter,
    EmulatorLink,
    LinkError,
    PortVanishedError,
    run_emulator,
    write_stimulus,
)
from taxel_protocol import FrameType, ReferenceDecoder, encode_frame
from taxel_protocol.frames import CommandPayload, HostHandshake
from taxel_protocol.layout import pack

PATIENCE_S = 20.0
HANDSHAKE = encode_frame(
    FrameType.HOST_HANDSHAKE, 0, pack(HostHandshake, {"tag": 9, "version_min": 1, "version_max": 1})
)
START = encode_frame(FrameType.COMMAND, 1, pack(CommandPayload, {"tag": 10, "command": 1}))

BAD_WORLDS = {
    "empty": ("", "a world|no board"),
    "another file": ("hello\n", "line 1: expected 'taxel-world 1'"),
    "another version": ("taxel-world 2\n", "line 1: expected 'taxel-world 1'"),
    "no board": ("taxel-world 1\n", "no board is described"),
    "unknown keyword": ("taxel-world 1\nbored 1\n", "line 2: unknown keyword 'bored'"),
    "not a number": ("taxel-world 1\nscl_hz fast\n", "line 2: scl_hz: expected a number .* found 'fast'"),
    "out of range": ("taxel-world 1\n\nbaud 10\n", "line 3: baud: expected a number from 1000 .* found '10'"),
    "number missing": ("taxel-world 1\nseed\n", "line 2: a number is missing"),
    "seed": ("taxel-world 1\nseed -x\n", "line 2: seed: expected a whole number"),
    "scan": ("taxel-world 1\nscan 1000 1000 1 1 1\n", "line 2: sub-conversions times"),
    "fault": ("taxel-world 1\nfault 1 unplug 0x20\n", "line 2: no board has that address"),
}


def read_to_the_end(link):
    """(bytes, how it ended)."""
    data = b""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        try:
            chunk = link.read(0.2)
        except (EOFError, LinkError) as end:
            return data, end
        data += chunk.data if chunk else b""
    raise AssertionError("the link has not ended")


def ask(link, request, wanted):
    """Send a request and read until a frame of type `wanted` comes."""
    decoder = ReferenceDecoder()
    link.write(request)
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        chunk = link.read(0.2)
        found = [frame for frame in decoder.push(chunk.data if chunk else b"") if frame[0] == wanted]
        if found:
            return found[0]
    raise AssertionError("no answer")


def open_stream(world, **options):
    """A link on which frames are coming."""
    link = EmulatorLink(world, **options)
    ask(link, HANDSHAKE, FrameType.HUB_HANDSHAKE)
    ask(link, START, FrameType.REPLY)
    return link


def test_the_hub_answers(small_world):
    link = EmulatorLink(small_world)
    assert (link.is_real_time, link.is_recorded, link.baud) == (True, False, 1e6)
    frame = ask(link, HANDSHAKE, FrameType.HUB_HANDSHAKE)
    assert frame[2][0] in (0, 9)  # the handshake frame after power-on, or the answer to this one
    link.close()


def test_bytes_that_another_reader_took_are_not_waited_for(small_world, monkeypatch):
    """Two threads that read one link are both told that there is something; one of them finds nothing."""
    link = EmulatorLink(small_world)
    ask(link, HANDSHAKE, FrameType.HUB_HANDSHAKE)
    monkeypatch.setattr("taxel.link.emulator.select.select", lambda reads, *others: (reads, [], []))
    assert any(link.read(1.0) is None for _ in range(1000))
    link.close()


@pytest.mark.parametrize("name", BAD_WORLDS)
def test_a_bad_world_ends_in_the_emulators_own_line(name):
    world, words = BAD_WORLDS[name]
    link = EmulatorLink(world)
    _, end = read_to_the_end(link)
    assert isinstance(end, PortVanishedError)
    assert "\n" not in str(end)
    with pytest.raises(PortVanishedError, match=words):
        raise end
    link.close()


def test_whoever_asks_second_hears_the_emulators_line_too():
    link = EmulatorLink("taxel-world 1\nbored 1\n")
    read_to_the_end(link)
    for _ in range(3):
        with pytest.raises(PortVanishedError, match="unknown keyword 'bored'"):
            link.write(HANDSHAKE)
    for _ in range(3):
        with pytest.raises(PortVanishedError, match="unknown keyword 'bored'"):
            link.read(0.1)
    link.close()


def test_a_world_for_another_skin_than_the_stimulus_is_refused(tmp_path, small_world):
    write_stimulus(tmp_path / "a.stm", [0.0], np.zeros((1, 3)))
    link = EmulatorLink(small_world, stimulus=tmp_path / "a.stm")
    _, end = read_to_the_end(link)
    assert "expected values for 64 taxels, found 3" in str(end)
    link.close()


def test_a_stimulus_that_breaks_off_ends_the_stream_after_what_was_sent(tmp_path, small_world):
    path = tmp_path / "a.stm"
    write_stimulus(path, [0.0, 0.5, 1.0], np.zeros((3, 64)))
    path.write_bytes(path.read_bytes()[:-1])
    link = EmulatorLink(small_world, stimulus=path, fast=True)
    link.write(HANDSHAKE + START)
    data, end = read_to_the_end(link)
    assert len(data) > 1000
    assert isinstance(end, PortVanishedError)
    assert "ends inside a record" in str(end)
    link.close()


def test_a_finite_emulation_ends_with_an_end(small_world):
    link = EmulatorLink(small_world, fast=True, duration_s=1.0)
    link.write(HANDSHAKE + START)
    data, end = read_to_the_end(link)
    assert len(data) > 1000
    assert isinstance(end, EOFError)
    assert isinstance(read_to_the_end(link)[1], EOFError)
    link.close()


def test_statistics_say_what_was_sent(small_world):
    link = EmulatorLink(small_world, fast=True, duration_s=1.0)
    link.write(HANDSHAKE + START)
    data, _ = read_to_the_end(link)
    statistics = link.statistics()
    assert statistics["virtual_seconds"] == 1.0
    assert statistics["bytes_delivered"] == len(data)
    assert statistics["uart_bytes_sent"] == len(data)
    assert [board["address"] for board in statistics["boards"]] == [0x40]
    link.close()


def test_statistics_are_there_after_close(small_world):
    link = EmulatorLink(small_world, fast=True, duration_s=0.5)
    read_to_the_end(link)
    link.close()
    assert link.statistics()["virtual_seconds"] == 0.5
    assert link.statistics()["frames_sent"] > 0


def test_statistics_of_an_emulation_that_was_ended_early(small_world):
    link = open_stream(small_world)
    link.close()
    assert 0.0 < link.statistics()["virtual_seconds"] < PATIENCE_S


def test_nothing_is_left_after_close(small_world, emulators, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    before = emulators()
    link = open_stream(small_world)
    assert len(emulators() - before) == 1
    assert list(tmp_path.iterdir())
    link.close()
    assert emulators() == before
    assert not list(tmp_path.iterdir())
    link.close()  # once more is no mistake


def test_a_closed_link_refuses_bytes_in_one_line(small_world):
    link = EmulatorLink(small_world)
    link.close()
    with pytest.raises(LinkError) as caught:
        link.write(HANDSHAKE)
    assert "\n" not in str(caught.value)


def test_nothing_is_left_after_a_fast_emulation_that_nobody_reads(small_world, emulators):
    before = emulators()
    link = EmulatorLink(small_world, fast=True)
    link.write(HANDSHAKE + START)
    time.sleep(0.3)  # its socket fills up and it waits for a reader
    link.close()
    assert emulators() == before


def test_an_emulator_that_was_killed_is_a_vanished_port(small_world, emulators):
    before = emulators()
    link = open_stream(small_world)
    (pid,) = emulators() - before
    os.kill(pid, signal.SIGKILL)
    _, end = read_to_the_end(link)
    assert isinstance(end, PortVanishedError)
    assert "status" in str(end)
    link.close()


def test_a_link_outlives_the_thread_that_opened_it(small_world):
    links = []
    opener = threading.Thread(target=lambda: links.append(open_stream(small_world)))
    opener.start()
    opener.join()
    link = links[0]
    for _ in range(5):
        assert ask(link, HANDSHAKE, FrameType.HUB_HANDSHAKE)[0] == FrameType.HUB_HANDSHAKE
    link.close()


def test_several_emulators_do_not_disturb_each_other(small_world):
    links = [EmulatorLink(small_world, fast=True, duration_s=0.5) for _ in range(3)]
    for link in links:
        link.write(HANDSHAKE + START)
    for link in links:
        assert isinstance(read_to_the_end(link)[1], EOFError)
        link.close()


def write_host_input(path):
    with CaptureWriter(path) as writer:
        writer.write(HANDSHAKE, 100_000_000)
        writer.write(START, 150_000_000)


def test_a_run_without_a_host_is_repeatable_to_the_byte_in_any_number_of_threads(tmp_path):
    hand = load_hand("allegro")
    settings = WorldSettings(faults=("0.5 unplug 0x22", "0.8 plug 0x22", "1.0 corrupt 0x23 3"))
    write_host_input(tmp_path / "host.bin")
    times = np.arange(0.0, 1.5, 0.02)
    write_stimulus(tmp_path / "press.stm", times, np.outer(np.sin(times) ** 2, np.ones(hand.n_taxels)))
    files = []
    counts = []
    for run, threads in (("a", 1), ("b", 3), ("c", 1)):
        world = format_world(hand, settings if run != "c" else WorldSettings(seed=2, faults=settings.faults))
        capture = tmp_path / f"{run}.bin"
        counts.append(run_emulator(world, capture, 1.5, tmp_path / "host.bin", tmp_path / "press.stm", threads))
        files.append(capture.read_bytes())
    assert files[0] == files[1]
    assert files[0] != files[2]
    for statistics in counts:
        del statistics["wall_seconds"]
    assert counts[0] == counts[1]
    assert counts[0]["frames_sent"] > 100


def test_a_run_records_bytes_at_the_time_at_which_they_left_the_adapter(tmp_path, small_world):
    write_host_input(tmp_path / "host.bin")
    statistics = run_emulator(small_world, tmp_path / "a.bin", 1.0, host_input=tmp_path / "host.bin")
    link = CaptureLink(tmp_path / "a.bin")
    chunks = []
    with contextlib.suppress(EOFError):
        while True:
            chunks.append(link.read())
    times = [chunk.arrival_ns for chunk in chunks]
    assert times == sorted(times)
    assert 0 < times[0] < times[-1] <= 1_000_000_000
    assert sum(len(chunk.data) for chunk in chunks) == statistics["bytes_delivered"]
    link.close()


def test_a_run_refuses_bad_input_with_the_emulators_own_line(tmp_path, small_world):
    bad = tmp_path / "bad"
    bad.write_bytes(b"nothing")
    cases = [
        ({"world": "taxel-world 1\n"}, "no board is described"),
        ({"host_input": bad}, "expected a capture file"),
        ({"host_input": tmp_path / "none"}, "No such file"),
        ({"stimulus": bad}, "TAXELSTM"),
        ({"stimulus": tmp_path / "none"}, "No such file"),
        ({"capture": tmp_path / "none" / "a.bin"}, "No such file"),
        ({"duration_s": -1.0}, "--duration: expected a number"),
        ({"duration_s": float("nan")}, "--duration: expected a number"),
        ({"threads": 0}, "--threads: expected a number from 1 to 16"),
        ({"threads": 17}, "--threads: expected a number from 1 to 16"),
    ]
    for changed, words in cases:
        arguments = {"world": small_world, "capture": tmp_path / "a.bin", "duration_s": 0.1} | changed
        with pytest.raises(LinkError, match=words) as caught:
            run_emulator(**arguments)
        assert "\n" not in str(caught.value)


def test_every_digit_of_the_settings_reaches_the_world():
    settings = WorldSettings(
        scl_hz=399_999.5, hub_clock_ppm=12_345.678, noise_counts=3.1415926, usb_latency_ms=15.9999999
    )
    words = dict(line.split(maxsplit=1) for line in format_world(load_hand("flat8"), settings).splitlines())
    for name in ("scl_hz", "hub_clock_ppm", "noise_counts", "usb_latency_ms"):
        assert float(words[name]) == getattr(settings, name)
