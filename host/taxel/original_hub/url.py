"""URLs with `protocol=original`: the link of the bytes, the hand, and the format of the messages."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final
from urllib.parse import unquote

from taxel.hand import Hand, load_hand
from taxel.link import Link, LinkError, SerialLink, open_link
from taxel.link.byte_file import open_byte_file
from taxel.link.url import OWN_SCHEMES, get_recorded_path
from taxel.original_hub.link import OriginalLink
from taxel.plugins import LINKS, list_plugin_names
from taxel_protocol.original import FORMATS, OriginalFormat

PROTOCOL: Final = "protocol=original"
BAUD: Final = 115200.0
"""Baud rate of the original hub's UART, bit/s."""

_OWN_OPTIONS: Final = ("protocol", "hand", "variant")


@dataclass(frozen=True)
class OriginalSource:
    """The parts of a URL with `protocol=original`.

    url: URL of the link that carries the hub's bytes. hand, variant: values of the options with these names; None if
    they are missing. options: all options by name.
    """

    url: str
    hand: str | None
    variant: str | None
    options: Mapping[str, str]

    @property
    def scheme(self) -> str:
        """Part of the URL before the colon, such as "serial"."""
        return self.url.partition(":")[0]


def is_original_url(url: str) -> bool:
    """Return whether a URL contains the option `protocol=original`."""
    return PROTOCOL in url.rpartition("?")[2].split("&") if "?" in url else False


def split_original_url(url: str) -> OriginalSource:
    """Split a URL with `protocol=original` into the URL of the hub's bytes and the options of this package.

    A serial port without the option `baud` gets the baud rate of the original hub.
    """
    head, _, query = url.rpartition("?")
    parts = [part for part in query.split("&") if part]
    options = {name: unquote(value) for name, _, value in (part.partition("=") for part in parts)}
    is_emulator = head.startswith("emulator:")
    kept = [part for part in parts if part.partition("=")[0] not in _OWN_OPTIONS]
    variant = options.get("variant")
    if is_emulator:
        kept.append(PROTOCOL)
        # Another variant selects how the emulated hub treats boards that do not respond; it is passed to the emulator.
        if variant is not None and variant not in FORMATS:
            kept.append(f"variant={variant}")
            variant = None
    if head.startswith("/dev/"):
        head = f"serial://{head}"
    if head.startswith("serial:") and "baud" not in options:
        kept.append(f"baud={BAUD:.0f}")
    if head.startswith("file:"):  # a recording has no options
        kept = []
    return OriginalSource(head + (f"?{'&'.join(kept)}" if kept else ""), options.get("hand"), variant, options)


def open_original(url: str, hand: Hand | str | os.PathLike[str] | None = None) -> tuple[OriginalLink, Hand]:
    """Open the original hub at a URL with `protocol=original`, and return the link and the hand at its other end.

    url: any URL that gives bytes of the original hub: a serial port, `socket://`, `file:` (bytes or a capture file), or
    `emulator:`. Options: `hand=` (packaged hand or description file; default `original`, or `first_generation` for a
    format of the first generation), `variant=` (format of the messages, a key of `taxel_protocol.original.FORMATS`),
    `baud=` (default 115200), and those of the URL itself. hand: takes precedence over the option. Raises `TaxelError`
    with a one-line message.
    """
    source = split_original_url(url)
    if source.variant is not None and source.variant not in FORMATS:
        raise LinkError(url, f"option 'variant' must be one of {', '.join(FORMATS)}, found '{source.variant}'")
    chosen = hand or source.hand or _get_default_hand(source.variant)
    description = chosen if isinstance(chosen, Hand) else load_hand(chosen)
    message_format = select_format(url, source, description)
    baud = _parse_baud(url, source)
    link = _open_bytes(source, description, baud)
    return OriginalLink(link, description, message_format, baud), description


def _get_default_hand(variant: str | None) -> str:
    """Return the name of the packaged hand whose boards send messages in the format `variant` (None: the default)."""
    is_first = variant is not None and variant.startswith("first_generation")
    return "first_generation" if is_first else "original"


def select_format(url: str, source: OriginalSource, hand: Hand) -> OriginalFormat:
    """Return the format of the messages that a hand's boards send.

    Without the option `variant`, it is the format "original" or "first_generation" whose boards have the same numbers
    of taxels as those of the hand. Raises LinkError if hand and format do not match.
    """
    name = source.variant or ("first_generation" if _find_mismatch(FORMATS["original"], hand) else "original")
    message_format = FORMATS[name]
    mismatch = _find_mismatch(message_format, hand)
    if mismatch is not None:
        raise LinkError(url, f"{mismatch}; name the hand with hand=, or the format with variant=")
    return _apply_emulator_options(message_format, source) if source.scheme == "emulator" else message_format


def _find_mismatch(message_format: OriginalFormat, hand: Hand) -> str | None:
    """Describe the first board of a hand whose number of taxels differs from the format's; None if all agree."""
    for board in hand.boards:
        taxels = message_format.taxels.get(board.address)
        if taxels != board.kind.taxel_count:
            found = "no such board" if taxels is None else f"{taxels} taxels"
            return (
                f"board 0x{board.address:02X} of hand '{hand.name}' has {board.kind.taxel_count} taxels, but format "
                f"'{message_format.name}' has {found}"
            )
    return None


def _apply_emulator_options(message_format: OriginalFormat, source: OriginalSource) -> OriginalFormat:
    """Return the message format changed by the emulator options `message` and `accelerations` of the URL.

    message: "timestamp" (default; no change), "no_timestamp" (no timestamp after the address) or "high_byte_first"
    (big-endian counts). accelerations: I2C addresses, separated by commas, of the boards that send three accelerations
    after their counts; they replace the addresses of the format.
    """
    kind = source.options.get("message", "timestamp")
    accelerated = tuple(int(text, 0) for text in source.options.get("accelerations", "").split(",") if text)
    return replace(
        message_format,
        has_timestamp=message_format.has_timestamp and kind != "no_timestamp",
        is_big_endian=message_format.is_big_endian or kind == "high_byte_first",
        accelerated=accelerated or message_format.accelerated,
    )


def _parse_baud(url: str, source: OriginalSource) -> float:
    """Return the baud rate of the wire, bit/s. Raises LinkError for a value that no wire has."""
    text = source.options.get("baud", f"{BAUD:.0f}")
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1e3 <= value <= 1e8:
        raise LinkError(url, f"option 'baud' must be a number from 1000 to 100000000, found '{text}'")
    return value


def _open_bytes(source: OriginalSource, hand: Hand, baud: float) -> Link:
    """Open the link that carries the bytes of the original hub."""
    path = get_recorded_path(source.url)
    if path is not None:
        return open_byte_file(path, baud)
    if "://" in source.url and source.scheme not in list_plugin_names(LINKS, OWN_SCHEMES):
        return SerialLink(source.url, baud)  # a URL of pyserial does not state the baud rate
    return open_link(source.url, hand)
