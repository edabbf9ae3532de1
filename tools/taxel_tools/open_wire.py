"""From a URL to a wire."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final
from urllib.parse import parse_qs

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, world_text
from taxel.link import LinkError, open_i2c, open_link
from taxel.link.url import split_url
from taxel.link.virtual import VirtualMemoryLink, VirtualSMBus, VirtualWorld
from taxel_tools.wires import BoardWire, HubWire, SmbusWire

I2C_PREFIX: Final = "/dev/i2c-"
BOOT_S: Final = 0.5
"""World seconds until every emulated board answers and the hub knows it."""
OPTIONS: Final = {"hand", "wire", "seed", "usb_latency_ms", "scl_hz", "baud", "word"}


@contextmanager
def open_wire(url: str) -> Iterator[BoardWire]:
    """The wire that `url` names, closed at the end.

    `serial:///dev/ttyUSB0` and every other link: through the hub. `/dev/i2c-1` or `i2c:///dev/i2c-1`: an adapter.
    `emulator:`: an emulated hand in virtual time, options `hand`, `wire=hub` or `wire=i2c`, `seed`, `usb_latency_ms`,
    `scl_hz`, `baud`, and `word=LINE` (as often as wanted) for lines of the world file, such as `word=blank 0x21`.
    Raises `LinkError`, `WireError`, `HubError`.
    """
    path = url.removeprefix("i2c://")
    if path.startswith(I2C_PREFIX):
        wire: BoardWire = SmbusWire(open_i2c(path), path)
    elif url.startswith("emulator:"):
        with _open_emulated(url) as emulated:
            yield emulated
        return
    else:
        wire = HubWire(open_link(url))
    try:
        yield wire
    finally:
        wire.close()


@contextmanager
def _open_emulated(url: str) -> Iterator[BoardWire]:
    words = parse_qs(split_url(url).query)
    unknown = sorted(set(words) - OPTIONS)
    if unknown:
        raise LinkError(url, f"unknown option '{unknown[0]}'; known are {', '.join(sorted(OPTIONS))}")
    options = {name: values[-1] for name, values in words.items()}
    numbers: dict[str, Any] = {
        name: _number(url, name, options[name]) for name in ("usb_latency_ms", "scl_hz", "baud") if name in options
    }
    seed = int(_number(url, "seed", options.get("seed", "1")))
    settings = WorldSettings(seed=seed, **numbers)
    kind = options.get("wire", "hub")
    if kind not in {"hub", "i2c"}:
        raise LinkError(url, f"option 'wire' must be hub or i2c, found '{kind}'")
    text = world_text(load_hand(options.get("hand", "allegro")), settings)
    text += "".join(f"{line}\n" for line in words.get("word", ()))
    with VirtualWorld(text) as world:
        world.run(BOOT_S)
        if kind == "hub":
            yield HubWire(VirtualMemoryLink(world, settings.baud))
        else:
            yield SmbusWire(VirtualSMBus(world), "emulator:", lambda: world.now_s, world.run)


def _number(url: str, name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise LinkError(url, f"option '{name}' must be a number, found '{text}'") from None
