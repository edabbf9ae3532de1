"""From a URL to a CAN channel at the hand's bit rate, through python-can."""

from typing import Any

import can

from taxel.hand.allegro.errors import CanUrlError
from taxel.hand.allegro.protocol import BITRATE

_FORMS = "can:socketcan:can0, can:pcan:PCAN_USBBUS1, can:virtual:NAME or can:udp:239.74.163.2"
_UDP_PORT = 43113  # python-can's own default
_INTERFACES = {"socketcan": "socketcan", "pcan": "pcan", "virtual": "virtual", "udp": "udp_multicast"}
# What python-can's backends let through.
_REFUSALS = (can.CanError, OSError, ValueError, ImportError, NameError, AttributeError)
_REMEDIES = {
    "socketcan": f"is it up? sudo ip link set {{channel}} up type can bitrate {BITRATE}",
    "pcan": "is the adapter plugged in and PEAK's PCANBasic library installed? "
    "With the kernel's own driver use can:socketcan:can0",
    "virtual": "choose another name",
    "udp": "expected a multicast group of this network such as 239.74.163.2; python-can needs msgpack for it",
}


def open_bus(url: str) -> can.BusABC:
    """Open the CAN channel that `url` names; the caller shuts it down.

    ``can:socketcan:can0`` (its bit rate is the interface's own, set with `ip link`), ``can:pcan:PCAN_USBBUS1``,
    ``can:virtual:NAME`` (inside this process), ``can:udp:GROUP`` or ``can:udp:GROUP:PORT`` (between processes; an IPv6
    group stands in brackets). Raises CanUrlError with one line that says what to do.
    """
    scheme, _, rest = url.partition(":")
    kind, _, channel = rest.partition(":")
    if scheme != "can" or kind not in _INTERFACES or not channel:
        raise CanUrlError(url, f"is no CAN channel; expected {_FORMS}")
    options: dict[str, Any] = {"bitrate": BITRATE}
    if kind == "udp":
        channel, options["port"] = _group_and_port(url, channel)
    try:
        return can.Bus(channel, _INTERFACES[kind], **options)
    except (
        can.CanError,
        OSError,
        ValueError,
        ImportError,
        NameError,
        AttributeError,
    ) as error:  # what backends let out
        reason = " ".join(str(error).split()) or type(error).__name__
        raise CanUrlError(url, f"cannot be opened ({reason}); {_REMEDIES[kind].format(channel=channel)}") from error


def _group_and_port(url: str, text: str) -> tuple[str, int]:
    group, bracket, rest = text.removeprefix("[").partition("]") if text.startswith("[") else ("", "", "")
    if not bracket:
        group, colon, port = text.partition(":")
        rest = colon + port
    number = rest.removeprefix(":") or str(_UDP_PORT)
    if not number.isdecimal() or not 0 < int(number) < 0x10000 or (rest and not rest.startswith(":")):
        raise CanUrlError(url, f"port must be a number from 1 to 65535, found '{rest}'; expected can:udp:GROUP:PORT")
    return group, int(number)
