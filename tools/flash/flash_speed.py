"""How long `taxel flash` takes for 17 boards of 12 KiB, and for the hub, in virtual time.

python tools/flash/flash_speed.py              the table: a quarter of a minute
python tools/flash/flash_speed.py --json F     the same as JSON

400 kHz, 1 Mbaud; every row is read back as a sum, every image confirms itself. `each way`: the USB adapter holds bytes
back for so long in both directions; `to the host`: in that one only, as its latency timer does.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

sys.path.insert(0, str(Path(__file__).parent))

from flash_worlds import firmware_of, full_hand

from taxel.errors import TaxelError
from taxel.link.virtual import VirtualMemoryLink, VirtualWorld
from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_tools.hub_target import HubTarget
from taxel_tools.interleave import run, run_all
from taxel_tools.program import Progress, update, update_target
from taxel_tools.wires import HubWire

BOARDS: Final = 17
LATENCY_MS: Final = 16.0
BOOT_S: Final = 0.5
VERSION: Final = (1, 2, 3)
NO_LIMIT: Final = 0


@dataclass(frozen=True)
class Setting:
    """What stands between host and hub. `window`: bytes of commands under way; 0: as many as the hub allows."""

    latency: str
    held: bool
    window: int = NO_LIMIT

    @property
    def lines(self) -> list[str]:
        """Lines of the world file."""
        down = LATENCY_MS if self.latency == "each way" else 1.0
        return [f"usb_latency_down_ms {down}", f"flow_control {int(self.held)}"]


@dataclass(frozen=True)
class Speed:
    """Virtual seconds: of all boards at once (None with one command under way), and of one of them alone."""

    setting: Setting
    at_once_s: float | None
    alone_s: float

    @property
    def serial_s(self) -> float:
        """One board after the other."""
        return BOARDS * self.alone_s


SETTINGS: Final = (
    Setting("each way", held=True),
    Setting("each way", held=False),
    Setting("each way", held=False, window=1),
    Setting("to the host", held=True),
    Setting("to the host", held=False),
    Setting("to the host", held=False, window=1),
)


def ignore(progress: Progress) -> None:
    """Nobody watches."""


def seconds_for(setting: Setting, boards: int, rows: int) -> float:
    """Virtual seconds until so many boards run new firmware. Raises `TaxelError` if one does not."""
    firmware = firmware_of(BootDevice.BOARD, rows, VERSION, seed=1)
    with VirtualWorld(full_hand(setting.lines, usb_latency_ms=LATENCY_MS)) as world:
        world.run(BOOT_S)
        wire = HubWire(VirtualMemoryLink(world))
        wire.hub.window = setting.window or wire.hub.window
        addresses = wire.scan()[:boards]
        began = world.now_s
        results = run_all(wire, {one: update(one, firmware, wire.now_s, ignore) for one in addresses})
        for result in results.values():
            if isinstance(result, TaxelError):
                raise result
        return world.now_s - began


def hub_seconds(setting: Setting, rows: int) -> float:
    """Virtual seconds until the hub runs new firmware and polls its boards."""
    firmware = firmware_of(BootDevice.HUB, rows, VERSION, seed=1)
    with VirtualWorld(full_hand(setting.lines, usb_latency_ms=LATENCY_MS)) as world:
        world.run(BOOT_S)
        target = HubTarget(VirtualMemoryLink(world))
        began = world.now_s
        run(target.wire, update_target(target, firmware, ignore))
        return world.now_s - began


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=LAYOUTS[BootDevice.BOARD].slot_rows, help="of a board's image")
    parser.add_argument("--json", type=Path, help="write the figures there")
    options = parser.parse_args(arguments)
    speeds = []
    print(f"{'latency 16 ms':<14}{'hub holds back':>15}{'under way':>15}{'17 at once':>12}{'one by one':>12}")
    for setting in SETTINGS:
        at_once = None if setting.window == 1 else seconds_for(setting, BOARDS, options.rows)
        speed = Speed(setting, at_once, seconds_for(setting, 1, options.rows))
        speeds.append(speed)
        held = "yes" if setting.held else "no"
        window = "one command" if setting.window == 1 else "3072 bytes" if setting.held else "255 bytes"
        shown = "" if at_once is None else f"{at_once:.1f} s"
        print(f"{setting.latency:<14}{held:>15}{window:>15}{shown:>12}{speed.serial_s:>10.1f} s")
    hub_rows = min(options.rows + 8, LAYOUTS[BootDevice.HUB].slot_rows)
    hub = {setting.latency: hub_seconds(setting, hub_rows) for setting in (SETTINGS[0], SETTINGS[3])}
    for latency, seconds in hub.items():
        print(f"the hub itself, {latency}: {seconds:.1f} s")
    if options.json is not None:
        figures = [asdict(speed) | {"serial_s": speed.serial_s} for speed in speeds]
        options.json.write_text(json.dumps({"boards": figures, "hub": hub}, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
