"""The URL of an I2C adapter: `i2c:///dev/i2c-1?boards=auto`."""

from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import parse_qs

from taxel.link.errors import LinkError
from taxel.link.linux_hub.adapter import check_board_answers, open_adapter, read_scl_hz
from taxel.link.linux_hub.link import LinuxHubLink
from taxel_protocol.limits import ADDRESS_MAX, ADDRESS_MIN

DEVICE_PREFIX: Final = "/dev/i2c-"
SCHEME: Final = "i2c:"
ALL_ADDRESSES: Final = tuple(range(ADDRESS_MIN, ADDRESS_MAX + 1))
LOWEST_SCL_HZ, HIGHEST_SCL_HZ = 1e4, 5e6
"""Permitted bus clocks, Hz: slower than SMBus permits, to ultra-fast mode of the I2C specification."""


@dataclass(frozen=True)
class I2cUrl:
    """Parts of the URL of an I2C adapter.

    device: path of the adapter. addresses: I2C addresses at which boards are searched. scl_hz: clock of the bus, Hz;
    None: that of the adapter's device tree.
    """

    device: str
    addresses: tuple[int, ...]
    scl_hz: float | None


def is_i2c_url(url: str) -> bool:
    """Whether a URL or path names an I2C adapter: `i2c:...` or `/dev/i2c-N`."""
    return url.startswith((SCHEME, DEVICE_PREFIX))


def parse_i2c_url(url: str) -> I2cUrl:
    """Split the URL of an I2C adapter. Raises `LinkError` for an unknown option or value."""
    head, _, query = url.partition("?")
    device = head.removeprefix(SCHEME)
    device = device.removeprefix("//") if device.startswith("///") else device
    if not (device.startswith(DEVICE_PREFIX) and device.removeprefix(DEVICE_PREFIX)):
        raise LinkError(url, "names no I2C adapter; expected i2c:///dev/i2c-1")
    options = {name: values[-1] for name, values in parse_qs(query, keep_blank_values=True).items()}
    unknown = sorted(set(options) - {"boards", "scl_hz"})
    if unknown:
        raise LinkError(url, f"unknown option '{unknown[0]}'; known are boards, scl_hz")
    scl_hz = _parse_scl_hz(url, options["scl_hz"]) if "scl_hz" in options else None
    return I2cUrl(device, _parse_boards(url, options.get("boards", "auto")), scl_hz)


def open_linux_hub(url: str, hand: Any = None) -> LinuxHubLink:
    """Open an I2C adapter of this computer as the bus of a skin without a hub.

    Options: `boards=auto` (default: boards are searched at all addresses) or `boards=0x1C,0x1D` (no other address is
    used); `scl_hz`: clock of the bus, Hz (default: the value in the device tree, else 100000). The option `scl_hz` does
    not change the clock: taxel derives the time limits of transfers from it. hand: not used; every function that opens
    a URL has this parameter. Raises a one-line `LinkError`.
    """
    parts = parse_i2c_url(url)
    bus = open_adapter(parts.device)
    try:
        check_board_answers(bus, parts.device, parts.addresses)
    except BaseException:
        bus.close()
        raise
    return LinuxHubLink(bus, parts.device, parts.scl_hz or read_scl_hz(parts.device), parts.addresses)


def _parse_boards(url: str, text: str) -> tuple[int, ...]:
    """Return the addresses of the option `boards`; all addresses for `auto`. Raises `LinkError` for another text."""
    if text == "auto":
        return ALL_ADDRESSES
    try:
        addresses = tuple(int(part, 0) for part in text.split(","))
    except ValueError:
        addresses = ()
    if not addresses or any(not ADDRESS_MIN <= address <= ADDRESS_MAX for address in addresses):
        limits = f"0x{ADDRESS_MIN:02X} to 0x{ADDRESS_MAX:02X}"
        raise LinkError(
            url, f"option 'boards' must be auto, or addresses from {limits} such as 0x1C,0x1D; found '{text}'"
        )
    return addresses


def _parse_scl_hz(url: str, text: str) -> float:
    """Convert the option `scl_hz` to a bus clock, Hz. Raises `LinkError` for another text or a value out of range."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not LOWEST_SCL_HZ <= value <= HIGHEST_SCL_HZ:
        raise LinkError(
            url, f"option 'scl_hz' must be a number from {LOWEST_SCL_HZ:.0f} to {HIGHEST_SCL_HZ:.0f}, found '{text}'"
        )
    return value
