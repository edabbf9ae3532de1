"""Rig files: the skin, the devices with their drivers, and the settings of a virtual rig. Format: rigs/README.md."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from hil_tests.harness.drivers import RegisteredDriver, list_driver_names, load_driver
from hil_tests.harness.errors import RigError
from hil_tests.harness.interfaces import INTERFACES
from hil_tests.harness.parts import PARTS
from taxel.errors import TaxelError
from taxel.hand import Hand, load_hand
from taxel.hand.errors import format_path, format_value
from taxel.input_files import TextError, parse_toml, read_regular_file
from taxel.input_files.toml_text import TOML_BYTES_MAX

RIGS: Final = Path(__file__).parent.parent / "rigs"
HUB: Final = 0
"""Number that stands for the hub where boards are named by their I2C addresses."""
WORLD_SETTINGS: Final = {"seed": int, "scl_hz": float, "baud": float, "noise_counts": float, "boot_ms": float}
"""Settings of the emulated world that a rig file may contain."""


@dataclass(frozen=True)
class Device:
    """Driver of a device with the values of its options."""

    driver: RegisteredDriver
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class RigDescription:
    """Content of a rig file.

    `devices`: by name, in the order in which they are opened, with the default drivers of devices that the file does
    not name. `world`: settings of the emulated world. `executed`: addresses of the boards whose images are executed as
    ARM code; 0 is the hub. `part`: their microcontroller, a key of `PARTS`.
    """

    path: Path
    name: str
    hand: Hand
    devices: Mapping[str, Device]
    world: Mapping[str, Any]
    executed: tuple[int, ...] = ()
    part: str = "psoc4200"

    @property
    def is_virtual(self) -> bool:
        """Whether the boards are emulated; then all drivers are virtual."""
        return self.devices["uart"].driver.is_virtual


def load_rig(name: str) -> RigDescription:
    """Load the rig with this name in hil_tests/rigs, or from this path of a .toml file.

    Raises `TaxelError` with a one-line message.
    """
    path = Path(name) if name.endswith(".toml") else RIGS / f"{name}.toml"
    try:
        table = parse_toml(read_regular_file(path, TOML_BYTES_MAX))
    except OSError as error:
        names = ", ".join(sorted(rig.stem for rig in RIGS.glob("*.toml")))
        raise RigError(f"rig {path}: {error.strerror}; expected a .toml file or one of {names}") from None
    except TextError as error:
        raise RigError(f"rig {path}: is not TOML ({error})") from None
    return _read_description(path, table)


def _read_description(path: Path, table: dict[str, Any]) -> RigDescription:
    """Check the content of a rig file and build its description. Raises `RigError` with a one-line message."""
    hand_name = _read_field(path, table, "hand", str)
    keys = {"name", "hand", "world", "executed", "part"} | INTERFACES.keys()
    for key in table:
        if key not in keys:
            raise RigError(f"rig {path}: {format_value(key)} is unknown; expected one of {', '.join(sorted(keys))}")
    if "uart" not in table:
        raise RigError(f"rig {path}: [uart] is missing; every rig needs the UART of the hub")
    named = {device: _read_device(path, device, table[device]) for device in INTERFACES if device in table}
    is_virtual = named["uart"].driver.is_virtual
    if any(device.driver.is_virtual != is_virtual for device in named.values()):
        raise RigError(f"rig {path}: virtual and physical drivers are mixed; use drivers of one kind")
    for key in ("world", "executed", "part"):
        if table.get(key) and not is_virtual:
            raise RigError(f"rig {path}: '{key}' applies to virtual rigs only; remove it")
    hand = load_hand(path.parent / hand_name if hand_name.endswith(".toml") else hand_name)
    return RigDescription(
        path=path,
        name=_read_field(path, {"name": path.stem, **table}, "name", str),
        hand=hand,
        devices=_add_defaults(named, is_virtual),
        world=_read_world(path, table.get("world", {})),
        executed=_read_executed(path, table.get("executed", []), {board.address for board in hand.boards}),
        part=_read_part(path, table.get("part", "psoc4200")),
    )


def _add_defaults(named: Mapping[str, Device], is_virtual: bool) -> dict[str, Device]:
    """Add a driver for each device that a rig file does not name.

    A virtual rig gets virtual drivers for all devices; a physical rig gets the clock of this machine.
    """
    defaults = dict.fromkeys(INTERFACES, "virtual") if is_virtual else {"clock": "monotonic"}
    return {
        device: named[device] if device in named else Device(load_driver(device, defaults[device]))
        for device in INTERFACES
        if device in named or device in defaults
    }


def _read_world(path: Path, world: Any) -> Mapping[str, Any]:
    """Check the table `[world]` of a rig file, the settings of the emulated boards. Raises `RigError` for an
    unknown name.
    """
    names = ", ".join(sorted(WORLD_SETTINGS))
    if not isinstance(world, dict):
        raise RigError(f"rig {path}: world is not a table; expected [world] with numbers for {names}")
    for name, value in world.items():
        if name not in WORLD_SETTINGS or isinstance(value, bool) or not isinstance(value, WORLD_SETTINGS[name] | int):
            raise RigError(
                f"rig {path}: [world] {format_path(name)} = {format_value(value)}; expected numbers for {names}"
            )
    return world


def _read_executed(path: Path, entries: Any, board_addresses: set[int]) -> tuple[int, ...]:
    """Parse the entry `executed` of a rig file: the processors that execute compiled firmware, as I2C addresses
    (`HUB`: the hub).

    Raises `RigError` for an entry that is neither "hub" nor the address of a board of the rig.
    """
    found = f"rig {path}: executed = {format_value(entries)}"
    expected = f'{found}; expected a list of "hub" and addresses of boards, such as 0x1D'
    if not isinstance(entries, list):
        raise RigError(expected)
    addresses = tuple(HUB if entry == "hub" else entry for entry in entries)
    for address in addresses:
        if isinstance(address, bool) or not isinstance(address, int) or address not in board_addresses | {HUB}:
            raise RigError(expected)
    return addresses


def _read_part(path: Path, part: Any) -> str:
    """Check the entry `part` of a rig file. Raises `RigError` for another microcontroller than those of `PARTS`."""
    if part not in PARTS:
        raise RigError(f"rig {path}: part = {format_value(part)}; expected {' or '.join(PARTS)}")
    return str(part)


def _read_device(path: Path, device: str, table: Any) -> Device:
    """Check the table of one device: driver name, and names and types of the options."""
    if not isinstance(table, dict):
        raise RigError(f"rig {path}: {device} is not a table; expected [{device}] with 'driver' and its options")
    name = _read_field(path, table, "driver", str, device)
    driver = _find_driver(path, device, name)
    values = {key: value for key, value in table.items() if key != "driver"}
    options = {option.name: option for option in driver.options}
    for key in values:
        if key not in options:
            raise RigError(
                f"rig {path}: [{device}] {format_value(key)} is unknown; {name} takes {', '.join(options) or 'nothing'}"
            )
    for option in driver.options:
        if option.name in values or option.is_required:
            _read_field(path, values, option.name, option.type, device)
    return Device(driver, values)


def _find_driver(path: Path, device: str, name: str) -> RegisteredDriver:
    """Load the driver `name` of a device such as "can" or "power". Raises `RigError` with the rig file if it is
    unknown.
    """
    try:
        names = list_driver_names(device)
        if name not in names:
            raise RigError(f"driver = {format_value(name)} is unknown; expected {', '.join(names)}")
        return load_driver(device, name)
    except TaxelError as error:
        raise RigError(f"rig {path}: [{device}] {error}") from None


def _read_field(path: Path, table: dict[str, Any], name: str, kind: type, device: str = "") -> Any:
    """Return the value of entry `name` in a table of a rig file. Raises `RigError` if it is missing or not of the type
    `kind`; a whole number is accepted where a float is expected.

    device: name of the table, for the error message; empty for the top level.
    """
    where = f"rig {path}: " + (f"[{device}] " if device else "")
    if name not in table:
        raise RigError(f"{where}'{name}' is missing; expected a {kind.__name__}")
    value = table[name]
    allowed = (int, float) if kind is float else (kind,)
    if not isinstance(value, allowed) or (isinstance(value, bool) and kind is not bool):
        raise RigError(f"{where}{name} = {format_value(value)}; expected a {kind.__name__}")
    return value
