"""Duration of `taxel flash` for 17 boards of 12 KiB, and for the hub, in virtual time.

    python tools/flash/flash_speed.py              the table, in about 15 seconds
    python tools/flash/flash_speed.py --json F     the same as JSON

I2C at 400 kHz, UART at 1 Mbaud; every row is read back as a sum, every image confirms itself. `each way`: the USB
adapter delays bytes in both directions; `to the host`: only in this direction, as its latency timer does.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from taxel.output import write_whole

sys.path.insert(0, str(Path(__file__).parent))

from flash_worlds import make_firmware_images, make_full_hand_world

from taxel.errors import TaxelError
from taxel.link.virtual import VirtualMemoryLink, VirtualWorld
from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_tools.firmware_update import Progress, update_board, update_target
from taxel_tools.hub_target import HubTarget
from taxel_tools.scheduler import run, run_all
from taxel_tools.wires import HubWire

BOARDS: Final = 17
LATENCY_MS: Final = 16.0
BOOT_S: Final = 0.5
VERSION: Final = (1, 2, 3)
NO_LIMIT: Final = 0


@dataclass(frozen=True)
class Setting:
    """Connection between host and hub. `window`: limit of command bytes in flight; 0: as many as the hub allows."""

    latency: str
    has_flow_control: bool
    window: int = NO_LIMIT

    @property
    def lines(self) -> list[str]:
        """Lines of the world file for this connection between host and hub."""
        down = LATENCY_MS if self.latency == "each way" else 1.0
        return [f"usb_latency_down_ms {down}", f"flow_control {int(self.has_flow_control)}"]


@dataclass(frozen=True)
class Speed:
    """Virtual seconds for all boards at once (None with one command in flight), and for one board."""

    setting: Setting
    at_once_s: float | None
    alone_s: float

    @property
    def serial_s(self) -> float:
        """Virtual seconds to update all boards one after the other."""
        return BOARDS * self.alone_s

    def to_json(self) -> dict[str, Any]:
        """Return the setting and the measured durations of updates (virtual seconds) as values of a JSON document.

        held: whether the connection has flow control. window: as in `Setting`. at_once_s: all boards at once. alone_s:
        one board. serial_s: all boards one after the other.
        """
        setting = {
            "latency": self.setting.latency,
            "held": self.setting.has_flow_control,
            "window": self.setting.window,
        }
        return {
            "setting": setting,
            "at_once_s": self.at_once_s,
            "alone_s": self.alone_s,
            "serial_s": self.serial_s,
        }


SETTINGS: Final = (
    Setting("each way", has_flow_control=True),
    Setting("each way", has_flow_control=False),
    Setting("each way", has_flow_control=False, window=1),
    Setting("to the host", has_flow_control=True),
    Setting("to the host", has_flow_control=False),
    Setting("to the host", has_flow_control=False, window=1),
)


def ignore_progress(progress: Progress) -> None:
    """Ignore the progress of an update."""


def measure_boards(setting: Setting, boards: int, rows: int) -> float:
    """Return the virtual seconds until `boards` boards run new firmware of `rows` rows.

    Raises `TaxelError` if an update fails.
    """
    firmware = make_firmware_images(BootDevice.BOARD, rows, VERSION, seed=1)
    with VirtualWorld(make_full_hand_world(setting.lines, usb_latency_ms=LATENCY_MS)) as world:
        world.run(BOOT_S)
        wire = HubWire(VirtualMemoryLink(world))
        wire.hub.window = setting.window or wire.hub.window
        addresses = wire.scan()[:boards]
        start_s = world.now_s
        results = run_all(
            wire, {address: update_board(address, firmware, wire.now_s, ignore_progress) for address in addresses}
        )
        for result in results.values():
            if isinstance(result, TaxelError):
                raise result
        return world.now_s - start_s


def measure_hub(setting: Setting, rows: int) -> float:
    """Return the virtual seconds until the hub runs new firmware of `rows` rows and polls its boards."""
    firmware = make_firmware_images(BootDevice.HUB, rows, VERSION, seed=1)
    with VirtualWorld(make_full_hand_world(setting.lines, usb_latency_ms=LATENCY_MS)) as world:
        world.run(BOOT_S)
        target = HubTarget(VirtualMemoryLink(world))
        start_s = world.now_s
        run(target.wire, update_target(target, firmware, ignore_progress))
        return world.now_s - start_s


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure the durations of firmware updates, print the table, and write it as JSON if requested."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=LAYOUTS[BootDevice.BOARD].slot_rows, help="rows of a board's image")
    parser.add_argument("--json", type=Path, help="write the results to this file")
    options = parser.parse_args(arguments)
    speeds = []
    print(f"{'latency 16 ms':<14}{'flow control':>15}{'in flight':>15}{'17 at once':>12}{'one by one':>12}")
    for setting in SETTINGS:
        at_once = None if setting.window == 1 else measure_boards(setting, BOARDS, options.rows)
        speed = Speed(setting, at_once, measure_boards(setting, 1, options.rows))
        speeds.append(speed)
        flow_control = "yes" if setting.has_flow_control else "no"
        window = "one command" if setting.window == 1 else "3072 bytes" if setting.has_flow_control else "255 bytes"
        at_once_text = "" if at_once is None else f"{at_once:.1f} s"
        print(f"{setting.latency:<14}{flow_control:>15}{window:>15}{at_once_text:>12}{speed.serial_s:>10.1f} s")
    hub_rows = min(options.rows + 8, LAYOUTS[BootDevice.HUB].slot_rows)
    # The hub is measured with flow control, for both latencies.
    hub = {setting.latency: measure_hub(setting, hub_rows) for setting in (SETTINGS[0], SETTINGS[3])}
    for latency, seconds in hub.items():
        print(f"the hub, {latency}: {seconds:.1f} s")
    if options.json is not None:
        results = [speed.to_json() for speed in speeds]
        write_whole(options.json, json.dumps({"boards": results, "hub": hub}, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
