"""Texts of a reading for all views: each part is a pair of a text and whether it reports a problem."""

import math
import time

from taxel.monitor.advice import LAG_BYTES
from taxel.monitor.reading import SkinReading
from taxel.proximity.watch import WARNING_PROBABILITY

QUEUE_BYTES = 1 << 14
"""Number of unprocessed bytes above which a view displays it, for a stream in real time. Fewer bytes arrive between two
polls; a source that is not in real time waits for the reader, so its number of bytes means nothing.
"""

Part = tuple[str, bool]
"""Text of a status line, and whether it reports a problem."""


def format_rates(reading: SkinReading) -> list[Part]:
    """Return the parts of the status line for the rates, the boards, and the active taxels or the baseline's progress.

    While no frames arrive, the parts are the banner "no data since ..." and the number of streaming boards.
    """
    total = len(reading.boards)
    banner = format_banner(reading)
    if banner is not None:
        return [(banner, True), (f"{reading.boards_streaming}/{total} boards", True)]
    parts = [
        (f"{reading.scans_hz:.1f} scans/s", False),
        (f"{reading.boards_streaming}/{total} boards", reading.boards_streaming < total),
        (f"{reading.frames_hz:.0f} frames/s", False),
    ]
    if reading.is_measuring:
        parts += [
            (f"{int(reading.active.sum())} active", False),
            (f"signal up to {_format_counts(reading.largest_signal)}", False),
        ]
    else:
        parts.append((f"baseline {100 * reading.baseline_progress:.0f} %", False))
    return parts + _format_proximity(reading)


def _format_proximity(reading: SkinReading) -> list[Part]:
    """Return the part of the status line for the nearest target before contact; empty without a target.

    A predicted contact is reported as a problem.
    """
    near = [each for each in reading.proximity or () if each.distance_m is not None]
    if not near:
        return []
    nearest = min(near, key=lambda each: each.distance_m.median if each.distance_m else math.inf)
    distance, speed = nearest.distance_m, nearest.speed_m_s
    if distance is None or speed is None:
        return []
    name = nearest.board.replace("_", " ")
    text = f"target {1e3 * distance.median:.1f} mm from {name}, {1e3 * speed.median:+.0f} mm/s"
    return [(text, nearest.contact_soon > WARNING_PROBABILITY)]


def format_banner(reading: SkinReading) -> str | None:
    """Return the text "no data since 12:03:04" (local time) if no frames arrive; None otherwise."""
    if reading.no_data_since_s is None:
        return None
    return f"no data since {format_clock(reading.no_data_since_s)}"


def format_clock(unix_s: float) -> str:
    """Format Unix seconds as local time, such as 12:03:04."""
    return time.strftime("%H:%M:%S", time.localtime(unix_s))


def format_errors(reading: SkinReading) -> list[Part]:
    """Return a part of the status line for each error counter above 0, or "no errors"; empty while no frames arrive.

    Unknown frames are listed too, but are not a problem.
    """
    counts = [
        ("lost on the wire", reading.lost_on_wire),
        ("damaged", reading.damaged),
        ("missing", reading.missing),
        ("bytes discarded", reading.bytes_discarded),
        ("hub restarts", reading.hub_restarts),
        ("dropped by the hub", reading.hub_dropped or 0),
        ("bus recoveries", reading.bus_recoveries or 0),
    ]
    parts = [(f"{count} {name}", True) for name, count in counts if count]
    if not parts and reading.no_data_since_s is None:
        parts = [("no errors", False)]
    return [*parts, (f"{reading.unknown} unknown frames", False)] if reading.unknown else parts


def format_load(reading: SkinReading) -> list[Part]:
    """Return the parts of the status line for the age of the frames, the unprocessed bytes, and the processor load.

    The age and the bytes are omitted for a stream that is not in real time, and the bytes up to `QUEUE_BYTES`.
    """
    parts = []
    if reading.age_s is not None and reading.no_data_since_s is None:
        median, largest = (1e3 * age for age in reading.age_s)
        parts.append((f"age {median:.0f} to {largest:.0f} ms", False))
    if reading.bytes_waiting > QUEUE_BYTES and reading.age_s is not None:
        parts.append((f"{reading.bytes_waiting} B wait", reading.bytes_waiting > LAG_BYTES))
    parts.append((f"cpu {100 * reading.cpu_share:.0f} %", reading.cpu_share > 0.95))
    return parts


def format_line(reading: SkinReading) -> str:
    """Format a reading as one line: rates, errors, load and advice."""
    texts = [text for text, _ in (*format_rates(reading), *format_errors(reading), *format_load(reading))]
    line = f"{reading.watched_s:7.1f} s  " + ", ".join(texts)
    return f"{line}; {reading.advice}" if reading.advice else line


def _format_counts(value: float) -> str:
    """Format a signal as whole counts; "-" for NaN."""
    return "-" if math.isnan(value) else f"{value:.0f}"
