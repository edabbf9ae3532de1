"""Flash, RAM, worst-case stack and cycles of the images in a build folder, compared with their budgets.

    python tools/firmware/firmware_size.py --part PART --build DIR [--json FILE] [--page FILE] [--compare FILE]

Prints the table, writes it as JSON and as a page, lists the changes since another JSON, and fails if a budget is
exceeded. Budgets: flash from the layout, RAM and stack from the image's linker script, cycles from the available time
(`firmware_cycles.py`).
"""

import argparse
import json
import os
import subprocess
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

from firmware_cycles import FirmwareCycles
from firmware_cycles import measure as measure_cycles
from firmware_elf import LinkedImage, read_linked_image
from firmware_stack import CallGraph, StackUse, disassemble, read_call_table, read_frame_sizes

from taxel.errors import TaxelError
from taxel.output import write_whole
from taxel_protocol.bootloader import BOOT_ROW_SIZE, LAYOUTS, BootDevice
from taxel_tools.errors import FirmwareFileError

ORIGINAL_KINDS: Final = ("palm", "back_of_hand", "finger_tip", "finger_big", "finger_small", "hub")
COMMON_IMAGES: Final = ("bootloader-board", "bootloader-hub", "board-a", "board-b", "hub-a", "hub-b")
IMAGES: Final = {
    "psoc4200": (
        *COMMON_IMAGES,
        *(f"original-{kind}" for kind in ORIGINAL_KINDS),
        "bootloader-one-slot",
        *(f"one-slot-{kind}" for kind in ORIGINAL_KINDS[:-1]),
    ),
    "psoc4100s": COMMON_IMAGES,
}
"""Names of the images by the folder of their port in firmware/boards."""

CALLS: Final = Path(__file__).parents[2] / "firmware" / "boards" / "psoc4" / "calls.toml"
RAM_BEGIN: Final = 0x20000000
FAULT_RECORD: Final = ".noinit.fault"
"""Section at a fixed address between variables and stack: only its own size counts."""
COLUMNS: Final = ("image", "flash", "of", "static RAM", "stack", "reserved", "RAM", "of", "cycles")

PAGE: Final = """# Size of the images

This page lists the flash, RAM and cycles that each firmware image needs. It is written by `make size` from the linked
images for {part}. Sizes are in bytes.

- *static RAM* is the RAM from its start to the end of the variables (interrupt vectors, words that survive a reset,
  variables), plus the fault record of an application, which has its own address between variables and stack.
- *stack* is the largest stack that the image can need: the deepest call chain from the reset handler plus the
  interrupts that can preempt it, with their exception frames (`tools/firmware/firmware_stack.py`). The stack that the
  supervisory ROM uses during a flash call is not published; the RAM left beside the largest stack is reserved for it.
- *cycles* are the cycles in which the processor is awake, counted in executed images. For a [board](glossary.md#board)
  of the largest kind, the cycles of a [scan](glossary.md#scan) and a poll are compared with the duration of a scan. For
  the [hub](glossary.md#hub), the cycles of a poll and a [frame](glossary.md#frame) are compared with the time between
  frames while it streams 17 boards. [firmware-cycles.md](firmware-cycles.md) lists all kinds.

`make size` fails if flash, stack, RAM or cycles of an image exceed their budget. The RAM budget of every image is
three quarters of the RAM of the microcontroller. {compiler}

{table}

Call chains with the largest stack, interrupts last:

{chains}
"""


PART_TEXTS: Final = {
    "psoc4200": """the CY8C4245AXI-483 (32 KiB of flash, 4 KiB of RAM), and for the CY8C4244AZI-443 (16 KiB of flash) of
the original boards and hub (`original-...` without this project's bootloader, `one-slot-...` with it,
[migrate-original-boards.md](migrate-original-boards.md)). Another page lists the images for the second part,
[the PSoC 4100S](firmware-size-psoc4100s.md)""",
    "psoc4100s": """the CY8C4146AXI-S433, a PSoC 4100S with 64 KiB of flash and 8 KiB of RAM
([psoc4100s.md](psoc4100s.md))""",
}


@dataclass(frozen=True)
class Size:
    """Sizes of one image in bytes. chain: functions of the worst case, interrupts last."""

    flash: int
    flash_budget: int
    static_ram: int
    stack: int
    stack_reserve: int
    ram_budget: int
    chain: tuple[str, ...]
    cycles: dict[str, int] | None = None
    """Cycles by activity, and their common budget as `of`; None: not measured."""

    @property
    def ram(self) -> int:
        """RAM that an image needs, in bytes: static variables plus worst-case stack."""
        return self.static_ram + self.stack

    @property
    def spent(self) -> int:
        """Sum of the processor cycles of all activities of an image."""
        return sum(count for name, count in (self.cycles or {}).items() if name != "of")

    def describe_excess(self) -> str:
        """Return the quantities that exceed their budgets in one line, or "" if there are none."""
        exceeded = [
            f"{name} {used} of {budget} {unit}"
            for name, used, budget, unit in (
                ("flash", self.flash, self.flash_budget, "bytes"),
                ("stack", self.stack, self.stack_reserve, "bytes"),
                ("RAM", self.ram, self.ram_budget, "bytes"),
                ("awake", self.spent, (self.cycles or {}).get("of", 0), "cycles"),
            )
            if used > budget
        ]
        return ", ".join(exceeded)


def compute_flash_budget(linked: LinkedImage) -> int:
    """Return the flash bytes available to an image: its slot, the bootloader's rows, or the flash of an original
    device.
    """
    if "image_end_row" in linked.symbols:
        return (linked.symbol("image_end_row") - linked.symbol("image_first_row")) * BOOT_ROW_SIZE
    layout = LAYOUTS[BootDevice(linked.symbol("image_device"))]
    return layout.slot_size if "image_slot" in linked.symbols else layout.bootloader_rows * BOOT_ROW_SIZE


def measure(linked: LinkedImage, use: StackUse) -> Size:
    """Measure the flash, RAM and stack of one linked image. use: its worst-case stack."""
    in_ram = [part for part in linked.sections if part.address >= RAM_BEGIN]
    fault_record = sum(part.size for part in in_ram if part.name == FAULT_RECORD)
    end = max((part.address + part.size for part in in_ram if part.name != FAULT_RECORD), default=RAM_BEGIN)
    return Size(
        len(linked.content),
        compute_flash_budget(linked),
        end - RAM_BEGIN + fault_record,
        use.total,
        linked.symbol("image_stack"),
        linked.symbol("image_ram_budget"),
        use.chain,
    )


def find_frame_size_files(build: Path, sources: tuple[str, ...]) -> list[Path]:
    """Return the compiler's .su files (stack sizes) of the named sources in a build folder.

    A subfolder that another build removes meanwhile is omitted.
    """
    return [
        Path(folder) / name
        for folder, _, names in os.walk(build)
        for name in sorted(names)
        if name.startswith(sources) and name.endswith(".su")
    ]


def measure_all(
    build: Path, objdump: str, calls: Path = CALLS, names: tuple[str, ...] = IMAGES["psoc4200"]
) -> dict[str, Size]:
    """Measure the flash, RAM and stack of the images `names` in a build folder.

    objdump: path of the tool. calls: path of calls.toml. Raises FirmwareFileError, OSError.
    """
    table = read_call_table(calls)
    shared = find_frame_size_files(build, ("memory.c", "standalone.c"))
    sizes = {}
    for name in names:
        path = build / f"{name}.elf"
        linked = read_linked_image(path)
        frame_sizes = read_frame_sizes([*shared, *build.glob(f"{name}.elf.ltrans*.su")])
        graph = CallGraph(linked, disassemble(str(path), objdump), frame_sizes, table)
        sizes[name] = measure(linked, graph.compute_stack_use(name))
    return sizes


def add_cycles(sizes: dict[str, Size], counted: FirmwareCycles) -> dict[str, Size]:
    """Return the sizes with counted processor cycles: those of the largest board, and those of the hub.

    sizes: by image name. The images "board-a", "board-b", "hub-a" and "hub-b" get cycles, other images get none. The
    images of slots A and B are the same program, so both get the cycles that the executed image of slot A needs.
    """
    palm, hub = counted.boards[-1], counted.hub
    cycles = {
        "board": {"scan": palm.scan, "poll": palm.poll, "of": palm.budget},
        "hub": {"poll": hub.poll, "frame": hub.frame, "of": hub.budget},
    }
    return {name: replace(size, cycles=cycles.get(name[:-2])) for name, size in sizes.items()}


def _format_cycles(cycles: dict[str, int] | None) -> str:
    """Return a text such as "scan 120 + poll 30 of 200"; "" for None.

    cycles: processor cycles by activity, and those available by the key "of".
    """
    if cycles is None:
        return ""
    parts = [f"{name} {count:,}" for name, count in cycles.items() if name != "of"]
    return f"{' + '.join(parts)} of {cycles['of']:,}"


def format_table(sizes: dict[str, Size]) -> list[str]:
    """Return the lines of the Markdown table of flash, RAM, stack and processor cycles of all images."""
    lines = [f"| {' | '.join(COLUMNS)} |", f"|---{'|---:' * (len(COLUMNS) - 1)}|"]
    for name, size in sizes.items():
        numbers = (size.flash, size.flash_budget, size.static_ram, size.stack, size.stack_reserve, size.ram)
        cells = " | ".join(f"{number:,}" for number in (*numbers, size.ram_budget))
        lines.append(f"| {name} | {cells} | {_format_cycles(size.cycles)} |")
    return lines


def format_page(sizes: dict[str, Size], compiler: str, part: str = "psoc4200") -> str:
    """Return the text of the page on the sizes of all images of a microcontroller.

    sizes: by image name. compiler: sentence that names the compiler. part: "psoc4200" or "psoc4100s".
    """
    chains = [
        f"- Deepest call chain of the image {name}: {', '.join(size.chain)}"
        for name, size in sizes.items()
        if not name.endswith("-b")
    ]
    return PAGE.format(
        part=PART_TEXTS[part], compiler=compiler, table="\n".join(format_table(sizes)), chains="\n".join(chains)
    )


def format_json(sizes: dict[str, Size], compiler: str) -> str:
    """Return the sizes of all images as a JSON text, for a later comparison.

    compiler: sentence that names the compiler.
    """
    document = {"compiler": compiler, "images": {name: asdict(size) for name, size in sizes.items()}}
    return json.dumps(document, indent=1) + "\n"


def compare_sizes(sizes: dict[str, Size], before: Path) -> list[str]:
    """Return one line for each image that has changed since the JSON file `before`, or a line that none has.

    Raises FirmwareFileError, OSError.
    """
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
            str(before), "file", "JSON of an earlier run", "other content", "write it again with --json"
        ) from None
    return lines or ["no image changed its size"]


def describe_compiler(objdump: str) -> str:
    """Return the sentence that names the compiler to which this objdump belongs."""
    run = subprocess.run(
        [objdump.replace("objdump", "gcc"), "-dumpversion"], capture_output=True, text=True, check=True
    )
    return f"Compiler: arm-none-eabi-gcc {run.stdout.strip()}."


def main() -> int:
    """Measure the sizes of the images, print, write and compare them.

    The exit status is 1 if a budget is exceeded or a file is unusable.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--part", choices=sorted(IMAGES), default="psoc4200")
    parser.add_argument("--build", type=Path, required=True, help="folder of the cross build")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--page", type=Path)
    parser.add_argument("--compare", type=Path, help="JSON of an earlier run")
    parser.add_argument("--calls", type=Path, default=CALLS)
    parser.add_argument("--objdump", default="arm-none-eabi-objdump")
    options = parser.parse_args()
    try:
        counted = measure_cycles(options.build / "images")
        sizes = add_cycles(measure_all(options.build, options.objdump, options.calls, IMAGES[options.part]), counted)
        compiler = describe_compiler(options.objdump)
        compared = compare_sizes(sizes, options.compare) if options.compare else []
        print("\n".join([*format_table(sizes), *compared]))
        if options.json:
            write_whole(options.json, format_json(sizes, compiler))
        if options.page:
            write_whole(options.page, format_page(sizes, compiler, options.part))
    except (TaxelError, OSError, subprocess.CalledProcessError) as error:
        print(f"firmware_size: {error}", file=sys.stderr)
        return 1
    over = {name: size.describe_excess() for name, size in sizes.items() if size.describe_excess()}
    for name, excess in over.items():
        print(f"firmware_size: {name}: over budget: {excess}", file=sys.stderr)
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
