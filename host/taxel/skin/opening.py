"""Opening of a skin: from a URL to a link, a hand description and an iterator over frames."""

import os
from contextlib import ExitStack
from typing import cast, get_args, overload

from taxel.errors import TaxelError
from taxel.hand import Hand, list_packaged_hands, load_hand
from taxel.hand.loading import parse_hand_description
from taxel.link import Link, LinkError, ReopeningLink, open_link
from taxel.original_hub import is_original_url, open_original
from taxel.skin.multi import MultiSkin
from taxel.skin.skin import FrameFormat, Skin

DEFAULT_HAND = "original"


@overload
def open_skin(
    url: str,
    hand: Hand | str | os.PathLike[str] | None = None,
    rate_hz: float | None = None,
    frames: FrameFormat | None = None,
) -> Skin: ...
@overload
def open_skin(
    url: list[str] | tuple[str, ...],
    hand: Hand | str | os.PathLike[str] | None = None,
    rate_hz: float | None = None,
    frames: FrameFormat | None = None,
) -> MultiSkin: ...
def open_skin(
    url: str | list[str] | tuple[str, ...],
    hand: Hand | str | os.PathLike[str] | None = None,
    rate_hz: float | None = None,
    frames: FrameFormat | None = None,
) -> Skin | MultiSkin:
    """Open the skin at a URL and start its frames; a list of URLs opens several ports as one skin (`MultiSkin`).

    url: `serial:///dev/ttyUSB0`, `i2c:///dev/i2c-1` (boards without a hub), `emulator:` (options after `?`),
    `file:capture.bin`, `file:skin.mcap`, a pyserial URL or a scheme of a plug-in. hand: name of a packaged description,
    a file or a `Hand`; None: the hand that a recording contains, else "original". rate_hz: highest rate of scans; None:
    the rate that the bus permits. frames: "plain" (16-bit counts) or "compact" (the same counts in fewer bytes; boards
    and hub must support the format); None: the URL's option `frames`, else "plain". Both formats give the same frames.
    With the option `protocol=original`, the URL of a serial port, socket, file or emulator reads the original hub (see
    `taxel.original_hub.open_original`); the default hand is then `original`.

    Raises a one-line `TaxelError` for a missing port, a hub that does not respond, another protocol version, a board
    that the hand does not have, or a board that answers on two ports.
    """
    if not isinstance(url, str):
        return _open_ports(url, hand, rate_hz, frames)
    url, frame_format = _split_frame_format(url, frames)
    link, description = open_source(url, hand)
    return Skin(link, description, rate_hz, frame_format)


def _open_ports(
    urls: list[str] | tuple[str, ...],
    hand: Hand | str | os.PathLike[str] | None,
    rate_hz: float | None,
    frames: FrameFormat | None,
) -> MultiSkin:
    """Open several ports with boards of one hand; arguments as for `open_skin`. All ports are closed after an error."""
    if not urls:
        raise TaxelError("the list of ports is empty; expected URLs such as serial:///dev/ttyUSB0")
    twice = next((url for url in urls if urls.count(url) > 1), None)
    if twice is not None:
        raise TaxelError(f"{twice}: occurs twice in the list of ports; name every port once")
    description = _resolve_hand(hand or DEFAULT_HAND)
    with ExitStack() as stack:
        skins = {url: stack.enter_context(open_skin(url, description, rate_hz, frames)) for url in urls}
        skin = MultiSkin(skins)
        stack.pop_all()  # from here on, the skin closes the ports
        return skin


def open_source(url: str, hand: Hand | str | os.PathLike[str] | None = None) -> tuple[Link, Hand]:
    """Open the link of a URL; return (link, description of the hand), without starting the frames.

    Arguments and errors are those of `open_skin`.
    """
    if is_original_url(url):
        return open_original(url, hand)
    description = _resolve_hand(hand or DEFAULT_HAND)
    link = open_link(url, description)
    if hand is not None or not link.is_recorded:
        return link, description
    try:
        return link, load_recorded_hand(link)
    except BaseException:
        link.close()
        raise


def open_waiting_source(url: str, hand: Hand | str | os.PathLike[str] | None = None) -> tuple[Link, Hand]:
    """Open the link of a URL as `open_source`; a port that vanishes later is opened again when it is back.

    Recordings and emulators in this process end as with `open_source`, because they cannot come back.
    """
    link, description = open_source(url, hand)
    if link.is_recorded or not link.is_real_time or url.startswith("emulator:"):
        return link, description
    return ReopeningLink(link, lambda: open_source(url, hand)[0]), description


def load_recorded_hand(link: Link) -> Hand:
    """Return the hand that a recording contains; else the packaged hand that it names; else the default hand."""
    header = getattr(link, "header", {})
    text = header.get("hand_description")
    if isinstance(text, str):
        return parse_hand_description(text.encode(), f"{link.name} (its hand)")
    name = header.get("hand")
    return load_hand(name if isinstance(name, str) and name in list_packaged_hands() else DEFAULT_HAND)


def _resolve_hand(hand: Hand | str | os.PathLike[str]) -> Hand:
    """Return `hand` itself, or load the hand with this packaged name or from this description file."""
    return hand if isinstance(hand, Hand) else load_hand(hand)


def _split_frame_format(url: str, frames: FrameFormat | None) -> tuple[str, FrameFormat]:
    """Return (URL without its option `frames`, frame format).

    The format is the argument `frames`, else the option of the URL, else "plain". Raises LinkError for another format.
    """
    head, mark, query = url.partition("?")
    if not mark or url.startswith("file:"):
        return url, frames or "plain"
    options = query.split("&")
    formats = [option.removeprefix("frames=") for option in options if option.startswith("frames=")]
    if formats and formats[-1] not in get_args(FrameFormat):
        raise LinkError(url, f"option 'frames' must be {' or '.join(get_args(FrameFormat))}, found '{formats[-1]}'")
    other_options = "&".join(option for option in options if not option.startswith("frames="))
    bare_url = head + (f"?{other_options}" if other_options else "")
    return bare_url, frames or (cast(FrameFormat, formats[-1]) if formats else "plain")
