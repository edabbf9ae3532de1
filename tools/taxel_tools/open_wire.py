"""From a URL to a wire."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Final
from urllib.parse import parse_qs

from taxel.hand import Hand, load_hand
from taxel.hand.world import WorldSettings, world_text
from taxel.link import Link, LinkError, open_i2c, open_link
from taxel.link.url import split_url
from taxel.link.virtual import VirtualMemoryLink, VirtualSMBus, VirtualWorld
from taxel_tools.cli_words import address_of
from taxel_tools.wires import BoardWire, HubWire, SmbusWire

I2C_PREFIX: Final = "/dev/i2c-"
NO_HUB: Final = "leads to the boards' bus; the hub takes firmware on its UART only, such as serial:///dev/ttyUSB0"
BOOT_S: Final = 0.5
"""World seconds until every emulated board answers and the hub knows it."""
LINES: Final = {"usb_latency_down_ms", "flow_control"}
OPTIONS: Final = {"board", "hand", "wire", "seed", "usb_latency_ms", "scl_hz", "baud", "word"} | LINES


@dataclass(frozen=True)
class EmulatedBench:
    """What is behind an emulated wire: the world, and the boards that are plugged into it."""

    world: VirtualWorld
    hand: Hand


@contextmanager
def open_wire(url: str) -> Iterator[BoardWire]:
    """The wire that `url` names, closed at the end.

    `serial:///dev/ttyUSB0` and every other link: through the hub. `/dev/i2c-1` or `i2c:///dev/i2c-1`: an adapter.
    `emulator:`: an emulated hand in virtual time, options `hand`, `board=ADDRESS` (only those plugged in, as often as
    wanted), `wire=hub` or `wire=i2c`, `seed`, `usb_latency_ms`, `usb_latency_down_ms`, `flow_control`, `scl_hz`,
    `baud`, and `word=LINE` (as often as wanted) for lines of the world file, such as `word=blank 0x21`.
    Raises `LinkError`, `WireError`, `HubError`.
    """
    path = url.removeprefix("i2c://")
    if path.startswith(I2C_PREFIX):
        wire: BoardWire = SmbusWire(open_i2c(path), path)
    elif url.startswith("emulator:"):
        with open_emulated(url) as (emulated, _):
            yield emulated
        return
    else:
        wire = HubWire(open_link(url))
    try:
        yield wire
    finally:
        wire.close()


@contextmanager
def open_hub_link(url: str) -> Iterator[Link]:
    """The hub's UART that `url` names, closed at the end. Raises `LinkError`, also for an I2C adapter."""
    if url.removeprefix("i2c://").startswith(I2C_PREFIX):
        raise LinkError(url, NO_HUB)
    if url.startswith("emulator:"):
        with _emulated(url) as (bench, baud, kind):
            if kind != "hub":
                raise LinkError(url, NO_HUB)
            yield VirtualMemoryLink(bench.world, baud)
        return
    link = open_link(url)
    try:
        yield link
    finally:
        link.close()


@contextmanager
def open_emulated(url: str) -> Iterator[tuple[BoardWire, EmulatedBench]]:
    """An emulated bench and a wire to it; for `emulator:` URLs only. Raises `LinkError`."""
    with _emulated(url) as (bench, baud, kind):
        world = bench.world
        wire: BoardWire
        if kind == "hub":
            wire = HubWire(VirtualMemoryLink(world, baud))
        else:
            wire = SmbusWire(VirtualSMBus(world), "emulator:", lambda: world.now_s, world.run)
        yield wire, bench


@contextmanager
def _emulated(url: str) -> Iterator[tuple[EmulatedBench, float, str]]:
    """A bench that has booted, the baud rate of its UART, and which wire is meant."""
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
    hand = _with_boards(load_hand(options.get("hand", "allegro")), words.get("board", ()))
    text = world_text(hand, settings)
    lines = [f"{name} {_number(url, name, options[name]):g}" for name in sorted(LINES & set(options))]
    text += "".join(f"{line}\n" for line in [*lines, *words.get("word", ())])
    with VirtualWorld(text) as world:
        world.run(BOOT_S)
        yield EmulatedBench(world, hand), settings.baud, kind


def _with_boards(hand: Hand, wanted: Sequence[str]) -> Hand:
    """The hand with nothing but the boards at these addresses; with all of them if none is named."""
    if not wanted:
        return hand
    addresses = {address_of(text, "board") for text in wanted}
    for address in addresses:
        hand.board(address)  # raises UnknownBoardError
    return replace(hand, boards=tuple(board for board in hand.boards if board.address in addresses))


def _number(url: str, name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise LinkError(url, f"option '{name}' must be a number, found '{text}'") from None
