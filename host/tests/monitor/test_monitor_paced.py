"""Playback of a capture at its recorded speed or a multiple of it."""

import time

import pytest

from taxel.link import CaptureWriter, open_link
from taxel.monitor import PacedLink, SpeedError, open_paced


@pytest.fixture
def clock(monkeypatch):
    """A clock that advances only during `time.sleep`."""
    now = [1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(time, "sleep", lambda seconds: now.__setitem__(0, now[0] + seconds))
    return now


@pytest.fixture
def capture(tmp_path):
    """URL of a capture of ten chunks of one byte (0 to 9), 10 ms apart."""
    with CaptureWriter(tmp_path / "capture.bin") as writer:
        for number in range(10):
            writer.write(bytes([number]), 5_000_000_000 + number * 10_000_000)
    return f"file:{tmp_path / 'capture.bin'}"


@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_chunks_arrive_at_their_recorded_times_divided_by_the_speed(clock, capture, speed):
    """The capture contains ten chunks, the bytes 0 to 9, at intervals of 10 ms; `clock` begins at 1000 s."""
    link = PacedLink(open_link(capture), speed)
    arrivals = []
    while len(arrivals) < 10:
        chunk = link.read(0.003)
        if chunk is not None:
            arrivals.append((chunk.data[0], clock[0] - 1000.0))
    with pytest.raises(EOFError):
        link.read(0.003)
    link.close()
    assert [number for number, _ in arrivals] == list(range(10))
    assert [time_s for _, time_s in arrivals] == pytest.approx(
        [number * 0.01 / speed for number in range(10)], abs=1e-6
    )


def test_a_late_reader_gets_all_due_chunks_without_waiting(clock, capture):
    """The chunks, the bytes 0 to 9, have intervals of 10 ms: after 35 ms, the chunks 1, 2 and 3 are due."""
    link = PacedLink(open_link(capture))
    link.read(0.0)
    clock[0] += 0.035
    collected = []
    while (chunk := link.read(0.1)) is not None:
        collected.append(chunk.data[0])
    link.close()
    assert collected == [1, 2, 3]
    assert clock[0] == pytest.approx(1000.035)  # no read has advanced the clock


@pytest.mark.parametrize(("url", "speed"), [("file:x", 0.0), ("file:x", float("nan")), ("emulator:", 2.0)])
def test_invalid_speed_is_refused(url, speed):
    with pytest.raises(SpeedError, match="speed"):
        open_paced(url, speed=speed)
