"""Options of `emulator:?protocol=original`: the settings of the original hub and boards."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from taxel.hand import Hand
from taxel.hand.original_firmware import (
    FIRST_GENERATION,
    KNOWN_FAULTS,
    MESSAGES,
    THESIS,
    VARIANTS,
    OriginalFirmware,
    list_polled_addresses,
)
from taxel.link import LinkError

GENERATIONS: Final = {"thesis": THESIS, "first": FIRST_GENERATION}

_NUMBERS: Final = {"delay_ms": (0.0, 1e5), "copy_us": (0.0, 1e4), "ring": (16.0, 4096.0), "pacing": (0.0, 1.0)}
"""Minimum and maximum of each option with a number; `ring` and `pacing` are whole numbers."""

ORIGINAL_OPTIONS: Final = frozenset(
    {"generation", "variant", "message", "known_faults", "skip", "accelerations", *_NUMBERS}
)


def parse_original_firmware(url: str, options: Mapping[str, str], hand: Hand) -> OriginalFirmware:
    """Parse the options of a URL that set the firmware of the original hub and boards.

    `generation=thesis` (default) or `first` sets the default of all other options. `OriginalFirmware` describes the
    options `variant`, `message`, `known_faults` (names separated by commas), `delay_ms`, `pacing` (0 or 1), `ring`
    (bytes) and `copy_us`. `skip`: addresses of boards that the hub does not poll, separated by commas, such as
    0x0B,0x17. `accelerations`: addresses of boards that send three more words after their counts. Raises `LinkError`
    for an invalid value of an option.
    """
    firmware = GENERATIONS[_parse_choice(url, "generation", options.get("generation", "thesis"), tuple(GENERATIONS))]
    changes: dict[str, Any] = {}
    if "variant" in options:
        changes["variant"] = _parse_choice(url, "variant", options["variant"], VARIANTS)
    if "message" in options:
        changes["message"] = _parse_choice(url, "message", options["message"], MESSAGES)
    if options.get("known_faults"):
        names = options["known_faults"].split(",")
        changes["known_faults"] = [_parse_choice(url, "known_faults", name, KNOWN_FAULTS) for name in names]
    if options.get("skip"):
        changes["skipped_addresses"] = _parse_boards(url, "skip", options["skip"], hand)
    if options.get("accelerations"):
        changes["accelerated_addresses"] = _parse_boards(url, "accelerations", options["accelerations"], hand)
    for name in ("delay_ms", "copy_us"):
        if name in options:
            changes[name] = _parse_number(url, name, options[name])
    if "ring" in options:
        changes["ring_size"] = int(_parse_number(url, "ring", options["ring"], is_whole=True))
    if "pacing" in options:
        changes["is_paced"] = _parse_number(url, "pacing", options["pacing"], is_whole=True) == 1.0
    return replace(firmware, **changes)


def _parse_choice(url: str, name: str, text: str, choices: tuple[str, ...]) -> str:
    """Return the value `text` of the option `name`. Raises `LinkError` unless it is one of `choices`."""
    if text not in choices:
        raise LinkError(url, f"option '{name}' must be one of {', '.join(choices)}, found '{text}'")
    return text


def _parse_boards(url: str, name: str, text: str, hand: Hand) -> list[int]:
    """Parse the value of the option `name`: addresses of boards of the hand, separated by commas.

    Raises `LinkError` for another value, and for the option `skip` if the hub would poll no board.
    """
    try:
        addresses = [int(word, 0) for word in text.split(",")]
        if name == "skip":  # called for its check: it raises ValueError for an unknown address or no polled board
            list_polled_addresses(hand, addresses)
        elif not set(addresses) <= {board.address for board in hand.boards}:
            raise ValueError(f"hand {hand.name} has other addresses")
    except ValueError as error:
        raise LinkError(url, f"option '{name}' must contain addresses of boards, found '{text}' ({error})") from None
    return addresses


def _parse_number(url: str, name: str, text: str, is_whole: bool = False) -> float:
    """Parse the value of the option `name` as a number. is_whole: the number must be an integer.

    Raises `LinkError` for another value, and for a number out of range.
    """
    low, high = _NUMBERS[name]
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not low <= value <= high or (is_whole and value % 1.0):
        kind = "whole number" if is_whole else "number"
        raise LinkError(url, f"option '{name}' must be a {kind} from {low:g} to {high:g}, found '{text}'")
    return value
