"""From a URL to a link."""

from urllib.parse import SplitResult, parse_qs, urlsplit

from taxel.link.base import Link
from taxel.link.capture import CaptureLink
from taxel.link.errors import LinkError
from taxel.link.serial_port import SerialLink


def open_link(url: str) -> Link:
    """Open what `url` names.

    `serial:///dev/ttyUSB0?baud=1000000` is a serial port (a bare `/dev/...` too); `rtscts=1` says that its RTS and CTS
    are wired to the hub, which may then make this side wait. `file:capture.bin` is a capture; every
    other scheme goes to pyserial (`socket://`, `rfc2217://`, `loop://` ...). Raises `LinkError` with one line that
    says what to do.
    """
    path = recorded_path(url)
    if path is not None:
        return CaptureLink(path)
    if url.startswith("serial:"):
        parts = split_url(url)
        options = _options(url, parts.query, {"baud", "rtscts", "low_latency"})
        port = parts.netloc + parts.path  # serial://dev/ttyX is a mistake that its own words show best
        if not port:
            raise LinkError(url, "names no port; expected serial:///dev/ttyUSB0")
        return SerialLink(
            port,
            _number(url, "baud", options.get("baud", "1000000")),
            _flag(url, "rtscts", options["rtscts"]) if "rtscts" in options else None,
            _flag(url, "low_latency", options.get("low_latency", "1")),
        )
    if url.startswith("/dev/") or "://" in url:
        return SerialLink(url)
    raise LinkError(url, "is not a URL that can be opened; expected serial:///dev/..., emulator:, file:capture.bin")


def recorded_path(url: str) -> str | None:
    """The file that a `file:` URL names; None for another URL. Raises `LinkError` if it names none."""
    if not url.startswith("file:"):
        return None
    path = url.removeprefix("file:")
    if not path or "\0" in path:
        raise LinkError(url, "names no file; expected file:capture.bin")
    return path.removeprefix("//") if path.startswith("///") else path


def split_url(url: str) -> SplitResult:
    """The parts of a URL. Raises `LinkError` for one that has none."""
    try:
        return urlsplit(url)
    except ValueError as error:
        raise LinkError(url, f"is not a URL ({error})") from None


def _options(url: str, query: str, known: set[str]) -> dict[str, str]:
    options = {name: values[-1] for name, values in parse_qs(query, keep_blank_values=True).items()}
    unknown = sorted(set(options) - known)
    if unknown:
        raise LinkError(url, f"unknown option '{unknown[0]}'; known are {', '.join(sorted(known))}")
    return options


def _number(url: str, name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1e3 <= value <= 1e8:
        raise LinkError(url, f"option '{name}' must be a number from 1000 to 100000000, found '{text}'")
    return value


def _flag(url: str, name: str, text: str) -> bool:
    if text not in {"0", "1"}:
        raise LinkError(url, f"option '{name}' must be 0 or 1, found '{text}'")
    return text == "1"
