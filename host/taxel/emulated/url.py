"""The `emulator:` URL: an emulated skin of a given hand, in a process of its own."""

from typing import Any
from urllib.parse import parse_qs

from taxel.hand import Hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import EmulatorLink, LinkError
from taxel.link.url import split_url

_NUMBERS = {
    "seed": (0.0, 2.0**53),
    "scl_hz": (1e4, 5e6),
    "baud": (1e3, 1e8),
    "usb_latency_ms": (0.0, 255.0),
    "noise_counts": (0.0, 1e4),
    "clock_spread_ppm": (0.0, 5e4),
}
"""Lowest and highest value of each number of `WorldSettings` that a URL may set."""

_OTHERS = {"speed", "stimulus", "duration_s", "live", "effect", "threads"}


def open_emulator(url: str, hand: Hand) -> EmulatorLink:
    """Start an emulated skin of `hand`.

    Options of the URL: `speed=real` (default) or `speed=max` (virtual time, as fast as it is read), `stimulus=FILE`
    (see `taxel.link.write_stimulus`) or `live=1` (see `EmulatorLink.apply`), `duration_s`, `effect=LINE` (as often as
    wanted: a line of the world file without the word `effect`), `threads` (1 to 16 that share its work; for speed=max
    on a machine with cores to spare), and the numbers of `WorldSettings`: seed, scl_hz, baud, usb_latency_ms,
    noise_counts, clock_spread_ppm. Raises `LinkError` for an unknown option or a value out of range.
    """
    parts = split_url(url)
    if parts.path or parts.netloc:
        raise LinkError(url, "expected emulator: or emulator:?option=value")
    options = {name: values[-1] for name, values in parse_qs(parts.query, keep_blank_values=True).items()}
    unknown = sorted(set(options) - set(_NUMBERS) - _OTHERS)
    if not options.get("stimulus", "x"):
        raise LinkError(url, "option 'stimulus' must name a file, found ''")
    if unknown:
        raise LinkError(url, f"unknown option '{unknown[0]}'; known are {', '.join(sorted({*_NUMBERS, *_OTHERS}))}")
    speed = options.get("speed", "real")
    if speed not in {"real", "max"}:
        raise LinkError(url, f"option 'speed' must be real or max, found '{speed}'")
    live = options.get("live", "0")
    if live not in {"0", "1"} or (live == "1" and "stimulus" in options):
        raise LinkError(url, f"option 'live' must be 0 or 1, and 1 only without a stimulus, found '{live}'")
    numbers: dict[str, Any] = {
        name: _number(url, name, text, *_NUMBERS[name]) for name, text in options.items() if name in _NUMBERS
    }
    if "seed" in numbers:
        if numbers["seed"] % 1.0:
            raise LinkError(url, f"option 'seed' must be a whole number, found '{options['seed']}'")
        numbers["seed"] = int(numbers["seed"])
    settings = WorldSettings(**numbers, effects=_effects(url, parts.query))
    threads = _number(url, "threads", options.get("threads", "1"), 1, 16)
    if threads % 1.0:
        raise LinkError(url, f"option 'threads' must be a whole number, found '{options['threads']}'")
    duration = _number(url, "duration_s", options["duration_s"], 1e-3, 1e7) if "duration_s" in options else None
    return EmulatorLink(
        format_world(hand, settings),
        options.get("stimulus"),
        speed == "max",
        duration,
        settings.baud,
        hand.n_taxels if live == "1" else None,
        int(threads),
    )


def _effects(url: str, query: str) -> list[str]:
    lines = parse_qs(query).get("effect", [])
    for line in lines:
        if not line.isprintable() or "#" in line:  # it becomes one line of the world file
            raise LinkError(url, f"option 'effect' must be one line without '#', found {line!r}")
    return lines


def _number(url: str, name: str, text: str, low: float, high: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not low <= value <= high:
        raise LinkError(url, f"option '{name}' must be a number from {low:g} to {high:g}, found '{text}'")
    return value
