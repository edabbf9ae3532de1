"""The virtual rig: every wire ends in one emulated world, and the CAN channel in a virtual Allegro hand."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

from hil_tests.harness.rig_file import RigDescription
from hil_tests.harness.virtual.can_bus import VirtualCanBus, VirtualCanFaults
from hil_tests.harness.virtual.faults import VirtualFaultInjector
from hil_tests.harness.virtual.power import VirtualPower
from hil_tests.harness.virtual.stimulus import VirtualCounts, VirtualStimulus
from hil_tests.harness.virtual.uart import VirtualClock, VirtualUart
from taxel.hand.world import ScanSettings, WorldSettings, world_text
from taxel.link.virtual import VirtualSMBus, VirtualWorld


def open_virtual(
    description: RigDescription, build: Mapping[str, Any], stack: ExitStack, *, counts: bool
) -> dict[str, Any]:
    """Drivers of a world put together as `build` says: fields of `WorldSettings`, `lines` of a world file, `only`
    (places of the boards that are there).
    """
    settings = {name: value for name, value in build.items() if name not in {"lines", "only", "scan"}}
    scan = {"scan": ScanSettings(**build["scan"])} if "scan" in build else {}
    text = world_text(description.hand, WorldSettings(**{**description.world, **settings, **scan}))
    text = _only(text, build.get("only")) + "".join(f"{line}\n" for line in build.get("lines", ()))
    port = description.devices["uart"].options.get("port", "pty")
    world = stack.enter_context(VirtualWorld(text, port, counts=counts))
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


def _only(text: str, places: Any) -> str:
    if places is None:
        return text
    lines = text.splitlines()
    boards = [line for line in lines if line.startswith("board ")]
    kept = [boards[place] for place in places]
    return "\n".join(line for line in lines if not line.startswith("board ") or line in kept) + "\n"
