"""CAN channels by URL at the bit rate of the hand, through python-can."""

from typing import Any

import can

from taxel.hand.allegro.errors import CanUrlError
from taxel.hand.allegro.protocol import BITRATE

_URL_EXAMPLES = "can:socketcan:can0, can:pcan:PCAN_USBBUS1, can:virtual:NAME or can:udp:239.74.163.2"
_UDP_PORT = 43113  # default of python-can
_INTERFACES = {"socketcan": "socketcan", "pcan": "pcan", "virtual": "virtual", "udp": "udp_multicast"}
_REMEDIES = {
    "socketcan": f"check that it is up: sudo ip link set {{channel}} up type can bitrate {BITRATE}",
    "pcan": "check the adapter and the installation of PEAK's PCANBasic library; "
    "with the kernel driver use can:socketcan:can0",
    "virtual": "choose another name",
    "udp": "use a multicast group of this network such as 239.74.163.2, and install msgpack",
}


def open_bus(url: str) -> can.BusABC:
    """Open the CAN channel of `url`; the caller shuts it down.

    ``can:socketcan:can0`` (the bit rate is set with `ip link`), ``can:pcan:PCAN_USBBUS1``, ``can:virtual:NAME`` (within
    this process), ``can:udp:GROUP`` or ``can:udp:GROUP:PORT`` (between processes; an IPv6 group in brackets). Raises
    CanUrlError for any other URL, and for a channel that cannot be opened.
    """
    scheme, _, location = url.partition(":")
    kind, _, channel = location.partition(":")
    if scheme != "can" or kind not in _INTERFACES or not channel:
        raise CanUrlError(url, f"is not the URL of a CAN channel; expected {_URL_EXAMPLES}")
    options: dict[str, Any] = {"bitrate": BITRATE}
    if kind == "udp":
        channel, options["port"] = _parse_group_and_port(url, channel)
    try:
        return can.Bus(channel, _INTERFACES[kind], **options)
    except (
        can.CanError,
        OSError,
        ValueError,
        ImportError,
        NameError,
        AttributeError,
    ) as error:  # exceptions of the python-can backends
        reason = " ".join(str(error).split()) or type(error).__name__
        raise CanUrlError(url, f"cannot be opened ({reason}); {_REMEDIES[kind].format(channel=channel)}") from error


def _parse_group_and_port(url: str, text: str) -> tuple[str, int]:
    """Return multicast group and port from the part `text` of a can:udp: URL; the port is optional.

    Raises CanUrlError for an invalid port.
    """
    group, bracket, port_suffix = text.removeprefix("[").partition("]") if text.startswith("[") else ("", "", "")
    if not bracket:
        group, colon, port = text.partition(":")
        port_suffix = colon + port
    number = port_suffix.removeprefix(":") or str(_UDP_PORT)
    if not number.isdecimal() or not 0 < int(number) < 0x10000 or (port_suffix and not port_suffix.startswith(":")):
        raise CanUrlError(
            url, f"port: expected a number from 1 to 65535, found {port_suffix!r}; use can:udp:GROUP:PORT"
        )
    return group, int(number)
