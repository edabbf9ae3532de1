"""The rig file: which boards, wires and hands stand on the bench. hil_tests/rigs/README.md describes it."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hil_tests.harness.errors import RigError
from taxel.hand import Hand, load_hand

RIGS = Path(__file__).parent.parent / "rigs"

OPTIONS: Mapping[tuple[str, str], Mapping[str, type]] = {
    ("uart", "virtual"): {"port": str},
    ("uart", "serial"): {"url": str},
    ("i2c", "virtual"): {},
    ("i2c", "linux"): {"bus": str},
    ("can", "virtual"): {},
    ("can", "python-can"): {"url": str},
    ("power", "virtual"): {},
    ("power", "modem-line"): {"port": str, "line": str, "on_is_high": bool},
    ("faults", "virtual"): {},
    ("stimulus", "virtual"): {},
    ("stimulus", "operator"): {},
}
"""The options of each driver of each wire."""

OPTIONAL = {"on_is_high", "port"}
WORLD = {"seed": int, "scl_hz": float, "baud": float, "noise_counts": float, "boot_ms": float}


@dataclass(frozen=True)
class Device:
    """A wire's driver and its options."""

    driver: str
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class RigDescription:
    """A rig as its file has it. `world`: settings of the emulated world of a virtual rig. `executed`: addresses of its
    boards whose images are executed as ARM code; 0: the hub's.
    """

    path: Path
    name: str
    hand: Hand
    devices: Mapping[str, Device]
    world: Mapping[str, Any]
    executed: tuple[int, ...] = ()

    @property
    def is_virtual(self) -> bool:
        """Whether the boards are emulated: then every wire is virtual."""
        return self.devices["uart"].driver == "virtual"


def load_rig(name: str) -> RigDescription:
    """`virtual`, another rig of hil_tests/rigs, or the path of a rig file. Raises `RigError`, one line."""
    path = Path(name) if name.endswith(".toml") else RIGS / f"{name}.toml"
    try:
        table = tomllib.loads(path.read_text())
    except OSError as error:
        known = ", ".join(sorted(rig.stem for rig in RIGS.glob("*.toml")))
        raise RigError(f"rig {path}: {error.strerror}; give a .toml file, or one of {known}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RigError(f"rig {path}: is not TOML ({error})") from None
    return _described(path, table)


def _described(path: Path, table: dict[str, Any]) -> RigDescription:
    hand = _field(path, table, "hand", str)
    known = {"name", "hand", "world", "executed"} | {wire for wire, _ in OPTIONS}
    for word in table:
        if word not in known:
            raise RigError(f"rig {path}: '{word}' is unknown; expected one of {', '.join(sorted(known))}")
    devices = {wire: _device(path, wire, table[wire]) for wire in dict.fromkeys(w for w, _ in OPTIONS) if wire in table}
    if "uart" not in devices:
        raise RigError(f"rig {path}: [uart] is missing; every rig needs the hub's UART")
    virtual = {device.driver == "virtual" for device in devices.values()} | {devices["uart"].driver == "virtual"}
    if len(virtual) > 1:
        raise RigError(f"rig {path}: virtual and physical drivers are mixed; a rig is one or the other")
    world = table.get("world", {})
    if world and True not in virtual:
        raise RigError(f"rig {path}: [world] is of virtual rigs only; leave it out")
    for word, value in world.items():
        if word not in WORLD or isinstance(value, bool) or not isinstance(value, WORLD[word] | int):
            raise RigError(f"rig {path}: [world] {word} = {value!r}; expected numbers of {', '.join(sorted(WORLD))}")
    path_or_name = path.parent / hand if hand.endswith(".toml") else hand
    loaded = load_hand(path_or_name)
    executed = _executed(path, table, {board.address for board in loaded.boards})
    if executed and True not in virtual:
        raise RigError(f"rig {path}: 'executed' is of virtual rigs only; leave it out")
    return RigDescription(path, str(table.get("name", path.stem)), loaded, devices, world, executed)


def _executed(path: Path, table: dict[str, Any], boards: set[int]) -> tuple[int, ...]:
    wanted = table.get("executed", [])
    expected = f'rig {path}: executed = {wanted!r}; expected a list of "hub" and addresses of boards, such as 0x2C'
    if not isinstance(wanted, list):
        raise RigError(expected)
    addresses = tuple(0 if one == "hub" else one for one in wanted)
    if any(isinstance(one, bool) or not isinstance(one, int) or one not in boards | {0} for one in addresses):
        raise RigError(expected)
    return addresses


def _device(path: Path, wire: str, table: Any) -> Device:
    if not isinstance(table, dict):
        raise RigError(f"rig {path}: {wire} is not a table; expected [{wire}] and its lines")
    driver = _field(path, table, "driver", str, wire)
    expected = OPTIONS.get((wire, driver))
    if expected is None:
        drivers = ", ".join(sorted(d for w, d in OPTIONS if w == wire))
        raise RigError(f"rig {path}: [{wire}] driver = '{driver}' is unknown; expected {drivers}")
    options = {name: value for name, value in table.items() if name != "driver"}
    for name in options.keys() - expected.keys():
        raise RigError(f"rig {path}: [{wire}] '{name}' is unknown; {driver} takes {', '.join(expected) or 'nothing'}")
    for name, kind in expected.items():
        if name in options or name not in OPTIONAL:
            _field(path, options, name, kind, wire)
    return Device(driver, options)


def _field(path: Path, table: dict[str, Any], name: str, kind: type, wire: str = "") -> Any:
    where = f"rig {path}: " + (f"[{wire}] " if wire else "")
    if name not in table:
        raise RigError(f"{where}'{name}' is missing; expected a {kind.__name__}")
    if not isinstance(table[name], kind):
        raise RigError(f"{where}{name} = {table[name]!r}; expected a {kind.__name__}")
    return table[name]
