"""The `emulator:` URL: starts an emulated skin of a given hand in a separate process."""

from typing import Any
from urllib.parse import parse_qs

from taxel.emulated.original_url import ORIGINAL_OPTIONS, parse_original_firmware
from taxel.emulated.wiring_url import parse_wiring
from taxel.hand import Hand
from taxel.hand.world import WorldSettings, format_world, make_original_settings
from taxel.link import EmulatorLink, LinkError
from taxel.link.url import split_url

_NUMBER_RANGES = {
    "seed": (0.0, 2.0**53),
    "scl_hz": (1e4, 5e6),
    "baud": (1e3, 1e8),
    "usb_latency_ms": (0.0, 255.0),
    "noise_counts": (0.0, 1e4),
    "clock_spread_ppm": (0.0, 5e4),
}
"""Minimum and maximum of each number of `WorldSettings` that a URL may set."""

_OTHER_OPTIONS = {
    "speed",
    "stimulus",
    "duration_s",
    "live",
    "effect",
    "threads",
    "protocol",
    "fault",
    "branch",
    "wiring",
}


def open_emulator(url: str, hand: Hand) -> EmulatorLink:
    """Start an emulated skin of a hand and return the link to its hub.

    Options of the URL:

    - `speed=real` (default) or `speed=max`: real time, or virtual time that passes as fast as the reader reads.
    - `stimulus=FILE`: forces, counts or a scene (see `taxel.link.write_stimulus`).
    - `live=1`: forces are set while the emulator runs (see `EmulatorLink.apply`); not together with `stimulus`.
    - `duration_s`: the emulator ends after this time.
    - `effect=LINE`: an effect line of the world file without the keyword `effect`; may be repeated.
    - `fault=LINE`: a fault line of the world file without the keyword `fault`; may be repeated. A fault of a branch may
      name the branch: `fault=5 branch_open index 0`.
    - `wiring=passive` or `wiring=buffered`, `branch=NAME key=value ...`: changes of the hand's star wiring, in which
      each branch is a cable from the hub to some boards; `branch` may be repeated, with the keys `pullup_ohm`,
      `capacitance_pf`, `series_ohm`.
    - `threads`: 1 to 16; more threads help with `speed=max` on a machine with free cores.
    - The numbers of `WorldSettings`: seed, scl_hz, baud, usb_latency_ms, noise_counts, clock_spread_ppm.
    - `protocol=original`: the original hub and boards, see `open_original_emulator`.

    Raises `LinkError` for an unknown option or a value out of range.
    """
    return _start_emulator(url, hand)


def open_original_emulator(url: str, hand: Hand) -> EmulatorLink:
    """Start an emulated original hand and return a link that carries the original hub's bytes, without translation.

    url: `emulator:?protocol=original` with the options of `open_emulator` and those of `parse_original_firmware`. The
    clock rates are those of the original hardware unless the URL states others. The hub sends from power-up on and
    ignores the bytes that are written to the link. Raises `LinkError` as `open_emulator` does, and for a URL without
    `protocol=original`.
    """
    query = parse_qs(split_url(url).query, keep_blank_values=True)
    if query.get("protocol", [""])[-1] != "original":
        raise LinkError(url, "expected the option protocol=original")
    return _start_emulator(url, hand)


def _start_emulator(url: str, hand: Hand) -> EmulatorLink:
    """Start the emulator of a URL, with the project's own firmware or with the original one."""
    parts = split_url(url)
    if parts.path or parts.netloc:
        raise LinkError(url, "expected emulator: or emulator:?option=value")
    options = {name: values[-1] for name, values in parse_qs(parts.query, keep_blank_values=True).items()}
    _check_choices(url, options)
    numbers: dict[str, Any] = {
        name: _parse_number(url, name, text, *_NUMBER_RANGES[name])
        for name, text in options.items()
        if name in _NUMBER_RANGES
    }
    if "seed" in options:
        numbers["seed"] = _parse_integer(url, "seed", options["seed"], *_NUMBER_RANGES["seed"])
    effects = _parse_lines(url, "effect", parts.query)
    faults = sorted(_parse_lines(url, "fault", parts.query), key=_get_fault_time)
    wiring = parse_wiring(url, options.get("wiring"), _parse_lines(url, "branch", parts.query), hand)
    lines: dict[str, Any] = {"effects": effects, "faults": faults, "wiring": wiring}
    if options.get("protocol") == "original":
        firmware = parse_original_firmware(url, options, hand)
        settings = make_original_settings(firmware, **numbers, **lines)
    else:
        settings = WorldSettings(**numbers, **lines)
    threads = _parse_integer(url, "threads", options.get("threads", "1"), 1, 16)
    duration = _parse_number(url, "duration_s", options["duration_s"], 1e-3, 1e7) if "duration_s" in options else None
    return EmulatorLink(
        format_world(hand, settings),
        options.get("stimulus"),
        options.get("speed") == "max",
        duration,
        settings.baud,
        hand.n_taxels if options.get("live") == "1" else None,
        threads,
    )


def _check_choices(url: str, options: dict[str, str]) -> None:
    """Raise `LinkError` for an unknown option, or an invalid value of `protocol`, `stimulus`, `speed` or `live`."""
    protocol = options.get("protocol", "taxel")
    if protocol not in {"taxel", "original"}:
        raise LinkError(url, f"option 'protocol' must be taxel or original, found '{protocol}'")
    known = {*_NUMBER_RANGES, *_OTHER_OPTIONS, *(ORIGINAL_OPTIONS if protocol == "original" else ())}
    unknown = sorted(set(options) - known)
    if not options.get("stimulus", "x"):  # an empty file name; "x" stands for a missing option
        raise LinkError(url, "option 'stimulus' must name a file, found ''")
    if unknown:
        raise LinkError(url, f"unknown option '{unknown[0]}'; known are {', '.join(sorted(known))}")
    speed = options.get("speed", "real")
    if speed not in {"real", "max"}:
        raise LinkError(url, f"option 'speed' must be real or max, found '{speed}'")
    live = options.get("live", "0")
    if live not in {"0", "1"} or (live == "1" and "stimulus" in options):
        raise LinkError(url, f"option 'live' must be 0 or 1, and 1 only without a stimulus, found '{live}'")


def _parse_lines(url: str, name: str, query: str) -> list[str]:
    """Return the values of the repeatable option `name`, each of which becomes a line of the world file.

    query: part of the URL after "?". Raises `LinkError` for a value with several lines, control characters or "#".
    """
    lines = parse_qs(query).get(name, [])
    for line in lines:
        if not line.isprintable() or "#" in line:  # the text becomes one line of the world file
            raise LinkError(url, f"option '{name}' must be one line without '#', found {line!r}")
    return lines


def _get_fault_time(line: str) -> float:
    """Return the time of a fault line, seconds, by which faults are sorted; infinity if its first word is no number."""
    try:
        return float(line.split()[0])
    except (ValueError, IndexError):
        return float("inf")  # sorted last; the emulator reports the invalid line


def _parse_number(url: str, name: str, text: str, low: float, high: float) -> float:
    """Parse the number of an option in an emulator URL. Raises `LinkError` unless it is from `low` to `high`."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not low <= value <= high:
        raise LinkError(url, f"option '{name}' must be a number from {low:g} to {high:g}, found '{text}'")
    return value


def _parse_integer(url: str, name: str, text: str, low: float, high: float) -> int:
    """Parse the integer of an option in an emulator URL. Raises `LinkError` unless it is from `low` to `high`."""
    value = _parse_number(url, name, text, low, high)
    if value % 1.0:
        raise LinkError(url, f"option '{name}' must be a whole number, found '{text}'")
    return int(value)
