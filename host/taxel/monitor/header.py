"""What a reading says in words, for any view: pairs of text and whether it is bad news."""

from __future__ import annotations

import math

from taxel.monitor.advice import LAG_BYTES
from taxel.monitor.reading import SkinReading

QUEUE_BYTES = 1 << 14
"""What waits between two portions is less; more is worth a word, in real time: other sources wait for their reader."""

Part = tuple[str, bool]


def figures(reading: SkinReading) -> list[Part]:
    """Rates, boards, what is active."""
    total = len(reading.boards)
    parts = [
        (f"{reading.scans_hz:.1f} scans/s", False),
        (f"{reading.boards_streaming}/{total} boards", reading.boards_streaming < total),
        (f"{reading.frames_hz:.0f} frames/s", False),
    ]
    if reading.is_measuring:
        parts += [
            (f"{int(reading.active.sum())} active", False),
            (f"signal up to {_counts(reading.largest_signal)}", False),
        ]
    else:
        parts.append((f"baseline {100 * reading.baseline:.0f} %", False))
    return parts


def errors(reading: SkinReading) -> list[Part]:
    """Everything that went wrong so far, by where it went wrong; one good word if nothing did."""
    counts = [
        ("lost on the wire", reading.lost_on_wire),
        ("damaged", reading.damaged),
        ("missing", reading.missing),
        ("bytes discarded", reading.bytes_discarded),
        ("hub restarts", reading.hub_restarts),
        ("dropped by the hub", reading.hub_dropped or 0),
        ("bus recoveries", reading.bus_recoveries or 0),
    ]
    return [(f"{count} {name}", True) for name, count in counts if count] or [("no errors", False)]


def load(reading: SkinReading) -> list[Part]:
    """How late frames are, what waits, and what this program costs."""
    parts = []
    if reading.age_s is not None:
        median, largest = (1e3 * age for age in reading.age_s)
        parts.append((f"age {median:.0f} to {largest:.0f} ms", False))
    if reading.bytes_waiting > QUEUE_BYTES and reading.age_s is not None:
        parts.append((f"{reading.bytes_waiting} B wait", reading.bytes_waiting > LAG_BYTES))
    parts.append((f"cpu {100 * reading.cpu_share:.0f} %", reading.cpu_share > 0.95))
    return parts


def line(reading: SkinReading) -> str:
    """All of it in one line of text."""
    words = [text for text, _ in (*figures(reading), *errors(reading), *load(reading))]
    head = f"{reading.watched_s:7.1f} s  " + ", ".join(words)
    return f"{head}; {reading.advice}" if reading.advice else head


def _counts(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.0f}"
