"""URLs of links: their schemes and options, and the table of functions that open them."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final
from urllib.parse import SplitResult, parse_qs, urlsplit

from taxel.link.base import Link
from taxel.link.errors import LinkError
from taxel.link.serial_port import SerialLink
from taxel.plugins import LINKS, list_plugin_names, load_plugin

LOWEST_BAUD, HIGHEST_BAUD = 1e3, 1e8

OWN_SCHEMES: Final[Mapping[str, str]] = MappingProxyType(
    {"i2c": "taxel.link.linux_hub.url:open_linux_hub", "serial": "taxel.link.url:open_serial"}
)
"""Function that opens the URLs of each scheme of this package, as "module:attribute". All other schemes, also `file`
and `emulator` of packages that depend on this one, are entry points of the group `taxel.links`.
"""


def open_link(url: str, hand: Any = None) -> Link:
    """Open the link that a URL names.

    url: `serial:///dev/ttyUSB0?baud=1000000` or `/dev/ttyUSB0`, a serial port; `i2c:///dev/i2c-1` or `/dev/i2c-1`, an
    I2C adapter on the bus of boards without a hub; `file:capture.bin`, a recording; `emulator:`, an emulated skin; a
    scheme of a plug-in; every other scheme is passed to pyserial (`socket://`, `rfc2217://`, `loop://`). hand:
    `taxel.hand.Hand` at the other end of the link, which some schemes need. Raises a one-line `LinkError` with a
    remedy.
    """
    scheme, colon, _ = url.partition(":")
    if colon and scheme in list_plugin_names(LINKS, OWN_SCHEMES):
        opener = load_plugin(LINKS, scheme, OWN_SCHEMES)
        link: Link = opener(url, hand)
        return link
    if url.startswith("/dev/i2c-"):
        return open_link(f"i2c://{url}", hand)
    if url.startswith("/dev/") or "://" in url:
        return SerialLink(url)
    expected = ", ".join(f"{name}:" for name in list_plugin_names(LINKS, OWN_SCHEMES))
    raise LinkError(url, f"is not a URL that can be opened; expected a serial port (/dev/...) or one of {expected}")


def open_serial(url: str, hand: Any = None) -> SerialLink:
    """Open a serial port by URL: `serial:///dev/ttyUSB0`.

    Options: `baud` (bit/s, default 1000000); `rtscts=1` if RTS and CTS are wired to the hub, so that the hub can stop
    the host; `low_latency=0` to leave the driver's latency timer unchanged. hand: not used. Raises `LinkError`.
    """
    parts = split_url(url)
    options = _parse_options(url, parts.query, {"baud", "rtscts", "low_latency"})
    # With two slashes, as in serial://dev/ttyUSB0, "dev" is parsed as a host; the error then names dev/ttyUSB0.
    port = parts.netloc + parts.path
    if not port:
        raise LinkError(url, "names no port; expected serial:///dev/ttyUSB0")
    return SerialLink(
        port,
        _parse_baud(url, options.get("baud", "1000000")),
        _parse_flag(url, "rtscts", options["rtscts"]) if "rtscts" in options else None,
        _parse_flag(url, "low_latency", options.get("low_latency", "1")),
    )


def get_recorded_path(url: str) -> str | None:
    """Return the path of the file in a `file:` URL; None for any other URL. Raises `LinkError` for an empty path."""
    if not url.startswith("file:"):
        return None
    path = url.removeprefix("file:")
    if not path or "\0" in path:
        raise LinkError(url, "names no file; expected file:capture.bin")
    return path.removeprefix("//") if path.startswith("///") else path


def split_url(url: str) -> SplitResult:
    """Split a URL into its parts. Raises `LinkError` for a string that is no URL."""
    try:
        return urlsplit(url)
    except ValueError as error:
        raise LinkError(url, f"is not a URL ({error})") from None


def _parse_options(url: str, query: str, allowed: set[str]) -> dict[str, str]:
    """Return the options after the `?` of a URL, by name. Raises `LinkError` for an option that is not in `allowed`."""
    options = {name: values[-1] for name, values in parse_qs(query, keep_blank_values=True).items()}
    unknown = sorted(set(options) - allowed)
    if unknown:
        raise LinkError(url, f"unknown option '{unknown[0]}'; known are {', '.join(sorted(allowed))}")
    return options


def _parse_baud(url: str, text: str) -> float:
    """Convert the URL's option 'baud' to bit/s. Raises `LinkError` for another text or a value out of range."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not LOWEST_BAUD <= value <= HIGHEST_BAUD:
        raise LinkError(url, f"option 'baud' must be a number from 1000 to 100000000, found '{text}'")
    return value


def _parse_flag(url: str, name: str, text: str) -> bool:
    """Convert the URL's option `name`, 0 or 1, to a bool. Raises `LinkError` for another text."""
    if text not in {"0", "1"}:
        raise LinkError(url, f"option '{name}' must be 0 or 1, found '{text}'")
    return text == "1"
