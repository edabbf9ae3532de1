"""Flash, RAM, worst-case stack and cycles of the images in a build folder against their budgets.

python tools/firmware/firmware_size.py --build DIR [--json FILE] [--page FILE] [--compare FILE]

Prints the table, writes it as JSON and as a page, says what changed since another JSON, and fails where a budget is
exceeded. Budgets: flash from the layout, RAM and stack from the image's own linker script, cycles from what they are
spent in (`firmware_cycles.py`).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

from firmware_cycles import FirmwareCycles
from firmware_cycles import measure as measure_cycles
from firmware_elf import LinkedImage, read_linked_image
from firmware_stack import CallGraph, StackUse, disassemble, noted_frames, read_call_table

from taxel.errors import TaxelError
from taxel_protocol.bootloader import BOOT_BOOTLOADER_ROWS, BOOT_ROW_SIZE, LAYOUTS, BootDevice
from taxel_tools.errors import FirmwareFileError

IMAGES: Final = ("bootloader-board", "bootloader-hub", "board-a", "board-b", "hub-a", "hub-b")
PORT: Final = Path(__file__).parents[2] / "firmware" / "boards" / "psoc4200"
RAM_BEGIN: Final = 0x20000000
COLUMNS: Final = ("image", "flash", "of", "static RAM", "stack", "reserved", "RAM", "of", "cycles")

PAGE: Final = """# Size of the images

Written by `make size` from the linked images of the CY8C4245AXI-483, in bytes. Static RAM counts from the start of RAM
on: vectors, the words that survive a reset, variables. Stack is the worst case: the deepest chain of calls from the
reset handler, and the interrupts that can cut into it with their exception frames
(`tools/firmware/firmware_stack.py`). What the supervisory ROM takes of the stack during a flash call is not known; what
is reserved beyond the worst case is there for it. Cycles are those in which the processor is awake, counted in executed
images: of a board of the largest kind for a scan and a poll, of the time that a scan takes; of the hub for a poll and a
frame, of the time from frame to frame while it streams 17 boards (all kinds: [firmware-cycles.md](firmware-cycles.md)).
`make size` fails when flash, stack, RAM or cycles exceed their budget.
{compiler}

All of them keep to 3 KiB of the part's 4 KiB.

{table}

Deepest chains:

{chains}
"""


@dataclass(frozen=True)
class Size:
    """Of one image, in bytes. `chain`: the functions of the worst case, interrupts last."""

    flash: int
    flash_budget: int
    static_ram: int
    stack: int
    stack_reserve: int
    ram_budget: int
    chain: tuple[str, ...]
    cycles: dict[str, int] | None = None
    """By what they are spent for, and the budget of them all as `of`; None: nothing was counted."""

    @property
    def ram(self) -> int:
        """Static, and the worst case of the stack."""
        return self.static_ram + self.stack

    @property
    def spent(self) -> int:
        """Cycles of all that was counted."""
        return sum(count for name, count in (self.cycles or {}).items() if name != "of")

    def excess(self) -> str:
        """What is over its budget, or nothing."""
        found = [
            f"{name} {used} of {budget} {unit}"
            for name, used, budget, unit in (
                ("flash", self.flash, self.flash_budget, "bytes"),
                ("stack", self.stack, self.stack_reserve, "bytes"),
                ("RAM", self.ram, self.ram_budget, "bytes"),
                ("awake", self.spent, (self.cycles or {}).get("of", 0), "cycles"),
            )
            if used > budget
        ]
        return ", ".join(found)


def flash_budget(linked: LinkedImage) -> int:
    """Bytes that the image may have: its slot, or the bootloader's rows."""
    if "image_slot" in linked.symbols:
        return LAYOUTS[BootDevice(linked.symbol("image_device"))].slot_size
    return BOOT_BOOTLOADER_ROWS * BOOT_ROW_SIZE


def measure(linked: LinkedImage, use: StackUse) -> Size:
    """The size of one image."""
    end = max((part.address + part.size for part in linked.sections if part.address >= RAM_BEGIN), default=RAM_BEGIN)
    return Size(
        len(linked.content),
        flash_budget(linked),
        end - RAM_BEGIN,
        use.total,
        linked.symbol("image_stack"),
        linked.symbol("image_ram_budget"),
        use.chain,
    )


def measure_all(build: Path, objdump: str, calls: Path) -> dict[str, Size]:
    """Sizes of all images of a build folder. Raises FirmwareFileError, OSError."""
    table = read_call_table(calls)
    shared = list(build.rglob("memory.c*.su"))
    sizes = {}
    for name in IMAGES:
        path = build / f"{name}.elf"
        linked = read_linked_image(path)
        noted = noted_frames([*shared, *build.glob(f"{name}.elf.ltrans*.su")])
        graph = CallGraph(linked, disassemble(str(path), objdump), noted, table)
        sizes[name] = measure(linked, graph.use(name))
    return sizes


def with_cycles(sizes: dict[str, Size], counted: FirmwareCycles) -> dict[str, Size]:
    """The same with what was counted in the images of slot A; those of slot B are the same program."""
    palm, hub = counted.boards[-1], counted.hub
    cycles = {
        "board": {"scan": palm.scan, "poll": palm.poll, "of": palm.budget},
        "hub": {"poll": hub.poll, "frame": hub.frame, "of": hub.budget},
    }
    return {name: replace(size, cycles=cycles.get(name[:-2])) for name, size in sizes.items()}


def _cycles_cell(cycles: dict[str, int] | None) -> str:
    if cycles is None:
        return ""
    parts = [f"{name} {count:,}" for name, count in cycles.items() if name != "of"]
    return f"{' + '.join(parts)} of {cycles['of']:,}"


def table_lines(sizes: dict[str, Size]) -> list[str]:
    """The table in Markdown."""
    lines = [f"| {' | '.join(COLUMNS)} |", f"|---{'|---:' * (len(COLUMNS) - 1)}|"]
    for name, size in sizes.items():
        numbers = (size.flash, size.flash_budget, size.static_ram, size.stack, size.stack_reserve, size.ram)
        cells = " | ".join(f"{number:,}" for number in (*numbers, size.ram_budget))
        lines.append(f"| {name} | {cells} | {_cycles_cell(size.cycles)} |")
    return lines


def page(sizes: dict[str, Size], compiler: str) -> str:
    """The whole page."""
    chains = [f"- {name}: {', '.join(size.chain)}" for name, size in sizes.items() if not name.endswith("-b")]
    return PAGE.format(compiler=compiler, table="\n".join(table_lines(sizes)), chains="\n".join(chains))


def as_json(sizes: dict[str, Size], compiler: str) -> str:
    """The same for a later comparison."""
    document = {"compiler": compiler, "images": {name: asdict(size) for name, size in sizes.items()}}
    return json.dumps(document, indent=1) + "\n"


def changes(sizes: dict[str, Size], before: Path) -> list[str]:
    """A line for each image that grew or shrank since the JSON `before`. Raises FirmwareFileError, OSError."""
    try:
        images: dict[str, dict[str, Any]] = json.loads(before.read_text())["images"]
        lines = []
        for name, size in sizes.items():
            now, then = asdict(size), images.get(name)
            if then is None:
                lines.append(f"{name}: new")
                continue
            parts = [
                f"{key.replace('_', ' ')} {now[key] - then[key]:+d}"
                for key in ("flash", "static_ram", "stack")
                if now[key] != then[key]
            ]
            spent = {name: count - (then["cycles"] or {}).get(name, 0) for name, count in (size.cycles or {}).items()}
            parts += [f"cycles of a {name} {change:+d}" for name, change in spent.items() if change and name != "of"]
            lines += [f"{name}: {', '.join(parts)}"] if parts else []
    except (ValueError, KeyError, TypeError, AttributeError):
        raise FirmwareFileError(
            str(before), "file", "JSON of an earlier run", "something else", "write it anew"
        ) from None
    return lines or ["no image changed its size"]


def compiler_of(objdump: str) -> str:
    """A sentence that names the compiler beside this objdump."""
    run = subprocess.run(
        [objdump.replace("objdump", "gcc"), "-dumpversion"], capture_output=True, text=True, check=True
    )
    return f"Compiler: arm-none-eabi-gcc {run.stdout.strip()}."


def main() -> int:
    """Measure, write, compare; 1 if a budget is exceeded or a file cannot be used."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=Path, required=True, help="folder of the cross build")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--page", type=Path)
    parser.add_argument("--compare", type=Path, help="JSON of an earlier run")
    parser.add_argument("--calls", type=Path, default=PORT / "calls.toml")
    parser.add_argument("--objdump", default="arm-none-eabi-objdump")
    options = parser.parse_args()
    try:
        counted = measure_cycles(options.build / "images")
        sizes = with_cycles(measure_all(options.build, options.objdump, options.calls), counted)
        compiler = compiler_of(options.objdump)
        compared = changes(sizes, options.compare) if options.compare else []
        print("\n".join([*table_lines(sizes), *compared]))
        if options.json:
            options.json.write_text(as_json(sizes, compiler))
        if options.page:
            options.page.write_text(page(sizes, compiler))
    except (TaxelError, OSError, subprocess.CalledProcessError) as error:
        print(f"firmware_size: {error}", file=sys.stderr)
        return 1
    over = {name: size.excess() for name, size in sizes.items() if size.excess()}
    for name, excess in over.items():
        print(f"firmware_size: {name}: over budget: {excess}", file=sys.stderr)
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
