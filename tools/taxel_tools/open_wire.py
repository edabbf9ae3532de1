"""Opening of the bus that a URL names."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Final
from urllib.parse import parse_qs

from taxel.hand import Hand, load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import Link, LinkError, open_link
from taxel.link.linux_hub import is_i2c_url, open_adapter, parse_i2c_url
from taxel.link.url import split_url
from taxel.link.virtual import VirtualMasterWorld, VirtualMemoryLink, VirtualSMBus, VirtualWorld
from taxel.original_hub import is_original_url
from taxel_tools.cli_common import parse_address
from taxel_tools.wires import BoardWire, HubWire, SmbusWire

NO_HUB: Final = "is the boards' bus; the hub accepts firmware only on its UART, such as serial:///dev/ttyUSB0"
HUB_SCL_HZ: Final = 400e3
"""Clock of a hub's I2C bus, Hz (firmware/boards/psoc4200)."""

BOOT_S: Final = 0.5
"""World seconds until every emulated board answers and the hub has completed its bus scan."""
WORLD_FILE_OPTIONS: Final = {"usb_latency_down_ms", "flow_control"}
OPTIONS: Final = {"board", "hand", "wire", "seed", "usb_latency_ms", "scl_hz", "baud", "word"} | WORLD_FILE_OPTIONS


@dataclass(frozen=True)
class EmulatedBench:
    """The emulated world of a connection, the boards plugged into that world, and the clock of their bus in Hz."""

    world: VirtualWorld
    hand: Hand
    scl_hz: float = HUB_SCL_HZ


@contextmanager
def open_wire(url: str) -> Iterator[BoardWire]:
    """Open the bus that `url` names, and close the bus at the end of the context.

    `serial:///dev/ttyUSB0` and every other link lead through the hub. `/dev/i2c-1` and `i2c:///dev/i2c-1` are I2C
    adapters. `emulator:` is an emulated hand in virtual time with the options `hand`, `board=ADDRESS` (only these
    boards are plugged in; repeatable), `wire=hub` or `wire=i2c`, `seed`, `usb_latency_ms`, `usb_latency_down_ms`,
    `flow_control`, `scl_hz`, `baud`, and `word=LINE` (repeatable) for lines of the world file, such as `word=blank
    0x21`. Raises `LinkError`, `WireError`, `HubError`.
    """
    reject_original_hub(url)
    if is_i2c_url(url):
        device = parse_i2c_url(url).device
        wire: BoardWire = SmbusWire(open_adapter(device), device)
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


def reject_original_hub(url: str) -> None:
    """Raise `LinkError` for a URL of an original hub, which takes no commands."""
    if is_original_url(url):
        raise LinkError(
            url,
            "is an original hub, which takes no commands; this command needs the project's own firmware on hub and "
            "boards, and a URL without protocol=original",
        )


@contextmanager
def open_hub_link(url: str) -> Iterator[Link]:
    """Open the hub's UART that `url` names. Raises `LinkError`, also for an I2C adapter."""
    reject_original_hub(url)
    if is_i2c_url(url):
        raise LinkError(url, NO_HUB)
    if url.startswith("emulator:"):
        with _start_emulated_bench(url) as (bench, baud, wire_kind):
            if wire_kind != "hub":
                raise LinkError(url, NO_HUB)
            yield VirtualMemoryLink(bench.world, baud)
        return
    link = open_link(url)
    try:
        yield link
    finally:
        link.close()


@contextmanager
def open_stream(url: str) -> Iterator[tuple[Link, float]]:
    """Open the link to the frames of the skin that `url` names; yield it with the clock of its I2C bus in Hz.

    `emulator:` is an emulated hand in virtual time with the options of `open_wire`; with `wire=i2c` it has no hub, and
    a Linux hub polls its boards through an emulated I2C adapter. The bus clock of a hub is `HUB_SCL_HZ`. Raises
    `LinkError`.
    """
    reject_original_hub(url)
    if url.startswith("emulator:"):
        with _start_emulated_bench(url, has_linux_hub=True) as (bench, baud, _):
            yield VirtualMemoryLink(bench.world, baud), bench.scl_hz
        return
    link = open_link(url)
    try:
        yield link, getattr(link, "scl_hz", HUB_SCL_HZ)
    finally:
        link.close()


@contextmanager
def open_emulated(url: str) -> Iterator[tuple[BoardWire, EmulatedBench]]:
    """Open an emulated bench, for `emulator:` URLs only; yield a connection to its bus, and the bench.

    Raises `LinkError`.
    """
    reject_original_hub(url)
    with _start_emulated_bench(url) as (bench, baud, wire_kind):
        world = bench.world
        wire: BoardWire
        if wire_kind == "hub":
            wire = HubWire(VirtualMemoryLink(world, baud))
        else:
            wire = SmbusWire(VirtualSMBus(world), "emulator:", lambda: world.now_s, world.run)
        yield wire, bench


@contextmanager
def _start_emulated_bench(url: str, has_linux_hub: bool = False) -> Iterator[tuple[EmulatedBench, float, str]]:
    """Start the emulated boards of an `emulator:` URL and let them boot.

    has_linux_hub: with `wire=i2c`, a Linux hub on the emulated adapter replaces the hub. Yields the bench, the baud
    rate of the UART, and the kind of connection: "hub" or "i2c". Raises `LinkError` for an invalid option.
    """
    query = parse_qs(split_url(url).query)
    unknown = sorted(set(query) - OPTIONS)
    if unknown:
        raise LinkError(url, f"unknown option '{unknown[0]}', expected one of {', '.join(sorted(OPTIONS))}")
    options = {name: values[-1] for name, values in query.items()}
    numbers: dict[str, Any] = {
        name: _parse_number(url, name, options[name])
        for name in ("usb_latency_ms", "scl_hz", "baud")
        if name in options
    }
    seed = int(_parse_number(url, "seed", options.get("seed", "1")))
    settings = WorldSettings(seed=seed, **numbers)
    wire_kind = options.get("wire", "hub")
    if wire_kind not in {"hub", "i2c"}:
        raise LinkError(url, f"option 'wire' must be hub or i2c, found '{wire_kind}'")
    hand = _select_boards(load_hand(options.get("hand", "original")), query.get("board", ()))
    text = format_world(hand, settings)
    lines = [
        f"{name} {_parse_number(url, name, options[name]):g}" for name in sorted(WORLD_FILE_OPTIONS & set(options))
    ]
    text += "".join(f"{line}\n" for line in [*lines, *query.get("word", ())])
    is_without_hub = has_linux_hub and wire_kind == "i2c"
    with VirtualMasterWorld(text, scl_hz=settings.scl_hz) if is_without_hub else VirtualWorld(text) as world:
        world.run(BOOT_S)
        yield EmulatedBench(world, hand, settings.scl_hz), settings.baud, wire_kind


def _select_boards(hand: Hand, texts: Sequence[str]) -> Hand:
    """Return the hand with only the boards at the given addresses; without addresses, with all boards.

    texts: addresses such as "0x1C". Raises `UnknownBoardError` for an address without a board.
    """
    if not texts:
        return hand
    addresses = {parse_address(text, "board") for text in texts}
    for address in addresses:
        hand.get_board(address)  # Raises UnknownBoardError for an address without a board.
    return replace(hand, boards=tuple(board for board in hand.boards if board.address in addresses))


def _parse_number(url: str, name: str, text: str) -> float:
    """Parse the number in option `name` of a URL. Raises `LinkError` for any other text."""
    try:
        return float(text)
    except ValueError:
        raise LinkError(url, f"option '{name}' must be a number, found '{text}'") from None
