"""The virtual rig: every wire ends in one emulated world, and the CAN channel in a virtual Allegro hand."""

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from hil_tests.harness.rig_file import RigDescription
from hil_tests.harness.virtual.can_bus import VirtualCanBus, VirtualCanFaults
from hil_tests.harness.virtual.faults import VirtualFaultInjector
from hil_tests.harness.virtual.images import images
from hil_tests.harness.virtual.power import VirtualPower
from hil_tests.harness.virtual.stimulus import VirtualCounts, VirtualStimulus
from hil_tests.harness.virtual.uart import VirtualClock, VirtualUart
from taxel.hand.world import ScanSettings, WorldSettings, format_world
from taxel.link.virtual import VirtualSMBus, VirtualWorld


def open_virtual(
    description: RigDescription, build: Mapping[str, Any], stack: ExitStack, *, counts: bool
) -> dict[str, Any]:
    """Drivers of a world put together as `build` says: fields of `WorldSettings`, `lines` of a world file, `only`
    (places of the boards that are there), `may_fault` (a processor may fault).
    """
    settings = {name: value for name, value in build.items() if name not in {"lines", "only", "scan", "may_fault"}}
    scan = {"scan": ScanSettings(**build["scan"])} if "scan" in build else {}
    text = format_world(description.hand, WorldSettings(**{**description.world, **settings, **scan}))
    text = _only(text, build.get("only")) + "".join(f"{line}\n" for line in build.get("lines", ()))
    port = description.devices["uart"].options.get("port", "pty")
    lines, files = _executed(description, text)
    world = stack.enter_context(VirtualWorld(text + lines, port, counts=counts, files=files))
    stack.callback(_check_processors, world, executed_of(description, text), bool(build.get("may_fault")))
    can_bus = VirtualCanBus(stack)
    return {
        "clock": VirtualClock(world),
        "uart": VirtualUart(world, port, float(description.world.get("baud", WorldSettings.baud))),
        "i2c": VirtualSMBus(world),
        "can": can_bus,
        "can_faults": VirtualCanFaults(can_bus),
        "power": VirtualPower(world),
        "faults": VirtualFaultInjector(world),
        "stimulus": VirtualStimulus(world, description.hand),
        "counts": VirtualCounts(world),
    }


def _executed(description: RigDescription, text: str) -> tuple[str, dict[str, Path]]:
    """Lines of the world file for the processors of this world that execute their images, and those files."""
    if not description.executed:
        return "", {}
    files = {name: images() / name for name in ("board-factory.hex", "hub-factory.hex")}
    executed = (address for address in executed_of(description, text) if address)
    boards = "".join(f"image 0x{address:02X} board-factory.hex\n" for address in executed)
    return boards + ("hub_image hub-factory.hex\n" if 0 in description.executed else ""), files


def executed_of(description: RigDescription, text: str) -> list[int]:
    """Those of a world file's boards that execute their images, and 0 for the hub."""
    return [address for address in description.executed if not address or f"board 0x{address:02X} " in text]


def _check_processors(world: VirtualWorld, executed: list[int], may_fault: bool) -> None:
    """No processor has asked for what nobody has modelled, and none has faulted."""
    for address in executed:
        processor = world.processor(address)
        assert not processor.is_broken, f"the processor of 0x{address:02X} stands still at 0x{processor.pc:04X}"
        assert may_fault or not processor.faults, (
            f"the processor of 0x{address:02X} has faulted {processor.faults} times"
        )


def _only(text: str, places: Any) -> str:
    if places is None:
        return text
    lines = text.splitlines()
    boards = [line for line in lines if line.startswith("board ")]
    kept = [boards[place] for place in places]
    return "\n".join(line for line in lines if not line.startswith("board ") or line in kept) + "\n"
