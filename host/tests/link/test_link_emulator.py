"""The emulator as a link: error messages, statistics, and the removal of processes and files on close."""

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
from taxel_protocol import Command, FrameType, ReferenceDecoder, encode_frame
from taxel_protocol.frames import CommandPayload, HostHandshake
from taxel_protocol.layout import pack

TIMEOUT_S = 20.0
HANDSHAKE = encode_frame(
    FrameType.HOST_HANDSHAKE, 0, pack(HostHandshake, {"tag": 9, "version_min": 1, "version_max": 1})
)
START_COMMAND = encode_frame(FrameType.COMMAND, 1, pack(CommandPayload, {"tag": 10, "command": Command.START}))

INVALID_WORLDS = {  # case: (world text, regular expression of the error)
    "empty": ("", "a world|no board"),
    "another file": ("another format\n", "line 1: expected 'taxel-world 1'"),
    "another version": ("taxel-world 2\n", "line 1: expected 'taxel-world 1'"),
    "no board": ("taxel-world 1\n", "no board is described"),
    "control character": ("taxel-world 1\nscl\x0bhz 1\n", "line 2: the line contains a control character; remove it"),
    "unknown keyword": ("taxel-world 1\nbored 1\n", "line 2: unknown keyword 'bored'"),
    "not a number": ("taxel-world 1\nscl_hz fast\n", "line 2: scl_hz: expected a number .* found 'fast'"),
    "out of range": ("taxel-world 1\n\nbaud 10\n", "line 3: baud: expected a number from 1000 .* found '10'"),
    "number missing": ("taxel-world 1\nseed\n", "line 2: a number is missing"),
    "seed": ("taxel-world 1\nseed -x\n", "line 2: seed: expected a whole number"),
    "scan": ("taxel-world 1\nscan 1000 1000 1 1 1\n", "line 2: sub-conversions times"),
    "fault": ("taxel-world 1\nfault 1 unplug 0x20\n", "line 2: no board has that address"),
}


def read_to_end(link):
    """Read a link to its end; return all bytes, and the exception that ended the reading."""
    data = b""
    deadline = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline:
        try:
            chunk = link.read(0.2)
        except (EOFError, LinkError) as end:
            return data, end
        data += chunk.data if chunk else b""
    raise AssertionError("the link has not ended")


def request_frame(link, request, reply_type):
    """Send a request and return the first frame of type `reply_type`."""
    decoder = ReferenceDecoder()
    link.write(request)
    deadline = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline:
        chunk = link.read(0.2)
        replies = [frame for frame in decoder.push(chunk.data if chunk else b"") if frame[0] == reply_type]
        if replies:
            return replies[0]
    raise AssertionError("no answer")


def open_streaming_link(world, **options):
    """Open a link to an emulated hub, and let the hub stream frames."""
    link = EmulatorLink(world, **options)
    request_frame(link, HANDSHAKE, FrameType.HUB_HANDSHAKE)
    request_frame(link, START_COMMAND, FrameType.REPLY)
    return link


def test_the_emulated_hub_answers_a_handshake(small_world):
    link = EmulatorLink(small_world)
    assert (link.is_real_time, link.is_recorded, link.baud) == (True, False, 1e6)
    frame = request_frame(link, HANDSHAKE, FrameType.HUB_HANDSHAKE)
    assert frame[2][0] in (0, 9)  # tag 0: sent after power-on; tag 9: the answer to this request
    link.close()


def test_a_read_returns_none_if_another_thread_has_read_the_bytes(small_world, monkeypatch):
    # `select` wakes both threads that read a link, but only one of the two threads receives the bytes.
    link = EmulatorLink(small_world)
    request_frame(link, HANDSHAKE, FrameType.HUB_HANDSHAKE)
    monkeypatch.setattr("taxel.link.emulator.select.select", lambda reads, *_: (reads, [], []))
    assert any(link.read(1.0) is None for _ in range(1000))
    link.close()


@pytest.mark.parametrize("name", INVALID_WORLDS)
def test_an_invalid_world_raises_the_one_line_error_of_the_emulator(name):
    world, message = INVALID_WORLDS[name]
    link = EmulatorLink(world)
    _, end = read_to_end(link)
    assert isinstance(end, PortVanishedError)
    assert "\n" not in str(end)
    with pytest.raises(PortVanishedError, match=message):
        raise end
    link.close()


def test_every_read_and_write_after_a_failure_raises_the_error_of_the_emulator():
    link = EmulatorLink("taxel-world 1\nbored 1\n")
    read_to_end(link)
    for _ in range(3):
        with pytest.raises(PortVanishedError, match="unknown keyword 'bored'"):
            link.write(HANDSHAKE)
    for _ in range(3):
        with pytest.raises(PortVanishedError, match="unknown keyword 'bored'"):
            link.read(0.1)
    link.close()


def test_a_stimulus_for_another_number_of_taxels_is_refused(tmp_path, small_world):
    write_stimulus(tmp_path / "a.stm", [0.0], np.zeros((1, 3)))
    link = EmulatorLink(small_world, stimulus=tmp_path / "a.stm")
    _, end = read_to_end(link)
    assert "expected values for 64 taxels, found 3" in str(end)
    link.close()


def test_a_truncated_stimulus_ends_the_stream_after_the_bytes_sent_before(tmp_path, small_world):
    path = tmp_path / "a.stm"
    write_stimulus(path, [0.0, 0.5, 1.0], np.zeros((3, 64)))
    path.write_bytes(path.read_bytes()[:-1])
    link = EmulatorLink(small_world, stimulus=path, fast=True)
    link.write(HANDSHAKE + START_COMMAND)
    data, end = read_to_end(link)
    assert len(data) > 1000
    assert isinstance(end, PortVanishedError)
    assert "ends inside a record" in str(end)
    link.close()


def test_an_emulation_of_limited_duration_ends_with_end_of_file(small_world):
    link = EmulatorLink(small_world, fast=True, duration_s=1.0)
    link.write(HANDSHAKE + START_COMMAND)
    data, end = read_to_end(link)
    assert len(data) > 1000
    assert isinstance(end, EOFError)
    assert isinstance(read_to_end(link)[1], EOFError)
    link.close()


def test_statistics_contain_the_bytes_sent_and_the_boards(small_world):
    link = EmulatorLink(small_world, fast=True, duration_s=1.0)
    link.write(HANDSHAKE + START_COMMAND)
    data, _ = read_to_end(link)
    statistics = link.statistics()
    assert statistics["virtual_seconds"] == 1.0
    assert statistics["bytes_delivered"] == len(data)
    assert statistics["uart_bytes_sent"] == len(data)
    assert [board["address"] for board in statistics["boards"]] == [0x40]
    link.close()


def test_statistics_are_available_after_close(small_world):
    link = EmulatorLink(small_world, fast=True, duration_s=0.5)
    read_to_end(link)
    link.close()
    assert link.statistics()["virtual_seconds"] == 0.5
    assert link.statistics()["frames_sent"] > 0


def test_closing_a_running_emulation_keeps_its_statistics(small_world):
    link = open_streaming_link(small_world)
    link.close()
    assert 0.0 < link.statistics()["virtual_seconds"] < TIMEOUT_S


def test_close_ends_the_process_and_removes_its_files(small_world, emulator_processes, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    before = emulator_processes()
    link = open_streaming_link(small_world)
    assert len(emulator_processes() - before) == 1
    assert list(tmp_path.iterdir())
    link.close()
    assert emulator_processes() == before
    assert not list(tmp_path.iterdir())
    link.close()  # a second call has no effect


def test_a_closed_link_refuses_bytes_in_one_line(small_world):
    link = EmulatorLink(small_world)
    link.close()
    with pytest.raises(LinkError) as caught:
        link.write(HANDSHAKE)
    assert "\n" not in str(caught.value)


def test_close_ends_a_fast_emulation_that_waits_for_a_reader(small_world, emulator_processes):
    before = emulator_processes()
    link = EmulatorLink(small_world, fast=True)
    link.write(HANDSHAKE + START_COMMAND)
    time.sleep(0.3)  # the socket of the emulator fills, and the emulator waits for a reader
    link.close()
    assert emulator_processes() == before


def test_a_killed_emulator_is_reported_as_a_vanished_port(small_world, emulator_processes):
    before = emulator_processes()
    link = open_streaming_link(small_world)
    (pid,) = emulator_processes() - before
    os.kill(pid, signal.SIGKILL)
    _, end = read_to_end(link)
    assert isinstance(end, PortVanishedError)
    assert "status" in str(end)
    link.close()


def test_a_link_works_after_the_thread_that_opened_it_has_ended(small_world):
    links = []
    opener = threading.Thread(target=lambda: links.append(open_streaming_link(small_world)))
    opener.start()
    opener.join()
    link = links[0]
    for _ in range(5):
        assert request_frame(link, HANDSHAKE, FrameType.HUB_HANDSHAKE)[0] == FrameType.HUB_HANDSHAKE
    link.close()


def test_several_emulators_run_independently(small_world):
    links = [EmulatorLink(small_world, fast=True, duration_s=0.5) for _ in range(3)]
    for link in links:
        link.write(HANDSHAKE + START_COMMAND)
    for link in links:
        assert isinstance(read_to_end(link)[1], EOFError)
        link.close()


def write_host_input(path):
    """Write a capture with a handshake at 0.1 s and the start command at 0.15 s."""
    with CaptureWriter(path) as writer:
        writer.write(HANDSHAKE, 100_000_000)
        writer.write(START_COMMAND, 150_000_000)


def test_a_run_without_a_host_gives_the_same_bytes_for_any_number_of_threads_and_others_for_another_seed(tmp_path):
    hand = load_hand("allegro")
    settings = WorldSettings(faults=("0.5 unplug 0x22", "0.8 plug 0x22", "1.0 corrupt 0x23 3"))
    write_host_input(tmp_path / "host.bin")
    times = np.arange(0.0, 1.5, 0.02)
    write_stimulus(tmp_path / "press.stm", times, np.outer(np.sin(times) ** 2, np.ones(hand.n_taxels)))
    captures = []
    statistics_of_runs = []
    for run, threads in (("a", 1), ("b", 3), ("c", 1)):  # run c has another seed
        world = format_world(hand, settings if run != "c" else WorldSettings(seed=2, faults=settings.faults))
        capture = tmp_path / f"{run}.bin"
        statistics_of_runs.append(
            run_emulator(world, capture, 1.5, tmp_path / "host.bin", tmp_path / "press.stm", threads)
        )
        captures.append(capture.read_bytes())
    assert captures[0] == captures[1]
    assert captures[0] != captures[2]
    for statistics in statistics_of_runs:
        del statistics["wall_seconds"]
    assert statistics_of_runs[0] == statistics_of_runs[1]
    assert statistics_of_runs[0]["frames_sent"] > 100


def test_a_run_records_all_bytes_with_times_within_its_duration(tmp_path, small_world):
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


def test_a_run_with_invalid_input_raises_the_one_line_error_of_the_emulator(tmp_path, small_world):
    invalid_file = tmp_path / "bad"
    invalid_file.write_bytes(b"nothing")
    cases = [
        ({"world": "taxel-world 1\n"}, "no board is described"),
        ({"host_input": invalid_file}, "expected a capture file"),
        ({"host_input": tmp_path / "none"}, "No such file"),
        ({"stimulus": invalid_file}, "TAXELSTM"),
        ({"stimulus": tmp_path / "none"}, "No such file"),
        ({"capture": tmp_path / "none" / "a.bin"}, "No such file"),
        ({"duration_s": -1.0}, "--duration: expected a number"),
        ({"duration_s": float("nan")}, "--duration: expected a number"),
        ({"threads": 0}, "--threads: expected a number from 1 to 16"),
        ({"threads": 17}, "--threads: expected a number from 1 to 16"),
    ]
    for changed_arguments, message in cases:
        arguments = {"world": small_world, "capture": tmp_path / "a.bin", "duration_s": 0.1} | changed_arguments
        with pytest.raises(LinkError, match=message) as caught:
            run_emulator(**arguments)
        assert "\n" not in str(caught.value)


def test_settings_are_written_to_the_world_with_all_digits():
    settings = WorldSettings(
        scl_hz=399_999.5, hub_clock_ppm=12_345.678, noise_counts=3.1415926, usb_latency_ms=15.9999999
    )
    world_lines = dict(line.split(maxsplit=1) for line in format_world(load_hand("flat8"), settings).splitlines())
    for name in ("scl_hz", "hub_clock_ppm", "noise_counts", "usb_latency_ms"):
        assert float(world_lines[name]) == getattr(settings, name)


@pytest.mark.parametrize("option", ["stimulus", "host_input"])
def test_a_pipe_as_input_of_the_emulator_is_refused_without_waiting(tmp_path, option):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(LinkError, match=r"pipe: cannot be read \(is a pipe, no regular file"):
        run_emulator("", tmp_path / "a.bin", 0.1, **{option: pipe})
