"""The emulated world of a virtual rig."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hil_tests.harness.rig_file import HUB, RigDescription
from hil_tests.harness.virtual.images import build_images
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualMasterWorld, VirtualWorld

BOARD_KEYWORDS = ("board ", "surface ", "margin ")
"""Beginnings of the lines of a world file that describe one board, whose address follows."""

BRANCH_WORDS = 5
"""Number of words of a branch line before its addresses."""


I2C_DEV = "i2c-dev"
"""Port of a virtual UART without a hub: a Linux hub polls the boards through an emulated I2C adapter."""


@dataclass(frozen=True)
class WorldBuild:
    """Emulated world for one test.

    `settings`: fields of `taxel.hand.world.WorldSettings`, which override those of the rig file. `lines`: additional
    lines of the world file. `board_indices`: the boards of the hand that are present (None: all).
    `has_known_counts`: the test sets the raw counts. `may_fault`: a processor may fault during the test.
    """

    settings: Mapping[str, Any] = field(default_factory=dict)
    lines: Sequence[str] = ()
    board_indices: Sequence[int] | None = None
    has_known_counts: bool = False
    may_fault: bool = False


def open_world(description: RigDescription, build: WorldBuild, exit_stack: ExitStack) -> VirtualWorld:
    """Start an emulated world of the rig's hand. exit_stack: checks the executed processors and closes the world."""
    settings = WorldSettings(**{**description.world, **build.settings})
    text = format_world(description.hand, settings)
    text = _select_boards(text, build.board_indices) + "".join(f"{line}\n" for line in build.lines)
    port = description.devices["uart"].options.get("port", "pty")
    image_lines, files = _find_images(description, text)
    options: dict[str, Any] = {"counts": build.has_known_counts, "files": files}
    world = exit_stack.enter_context(
        VirtualMasterWorld(text + image_lines, scl_hz=settings.scl_hz, **options)
        if has_linux_hub(description)
        else VirtualWorld(text + image_lines, port, **options)
    )
    exit_stack.callback(_check_processors, world, _find_executed(description, text), build.may_fault)
    return world


def has_linux_hub(description: RigDescription) -> bool:
    """Whether a Linux hub polls the emulated boards of a virtual rig, which has no hub board."""
    return description.devices["uart"].options.get("port") == I2C_DEV


def _find_images(description: RigDescription, text: str) -> tuple[str, dict[str, Path]]:
    """Find the firmware images of the processors that a virtual rig executes instead of emulating them natively.

    text: world file. Returns a tuple of additional lines of the world file, and the paths of the images by their names
    in these lines.
    """
    if not description.executed:
        return "", {}
    images = build_images(description.part)
    files = {name: images / name for name in ("board-factory.hex", "hub-factory.hex")}
    addresses = (address for address in _find_executed(description, text) if address != HUB)
    lines = "".join(f"image 0x{address:02X} board-factory.hex\n" for address in addresses)
    return lines + ("hub_image hub-factory.hex\n" if HUB in description.executed else ""), files


def _find_executed(description: RigDescription, text: str) -> list[int]:
    """Return the I2C addresses of the boards in a world file whose firmware is executed; 0 for an executed hub."""
    return [address for address in description.executed if address == HUB or f"board 0x{address:02X} " in text]


def _check_processors(world: VirtualWorld, executed: list[int], may_fault: bool) -> None:
    """Fail if a processor used a feature that the emulator does not model, or faulted without permission."""
    for address in executed:
        processor = world.read_processor(address)
        assert not processor.is_broken, f"the processor of 0x{address:02X} has stopped at 0x{processor.pc:04X}"
        assert may_fault or not processor.faults, (
            f"the processor of 0x{address:02X} has faulted {processor.faults} times"
        )


def _select_boards(text: str, board_indices: Sequence[int] | None) -> str:
    """Remove from the text of a world file all boards except those with the given indices; None keeps all boards."""
    if board_indices is None:
        return text
    lines = text.splitlines()
    board_lines = [line for line in lines if line.startswith("board ")]
    selected = [board_lines[index] for index in board_indices]
    present = {line.split()[1] for line in selected}
    kept = [line for line in lines if not line.startswith(BOARD_KEYWORDS) or line.split()[1] in present]
    return "\n".join(_select_addresses(line, present) if line.startswith("branch ") else line for line in kept) + "\n"


def _select_addresses(branch_line: str, present: set[str]) -> str:
    """Remove absent boards from a branch line of a world file; a branch without boards gives an empty line."""
    words = branch_line.split()
    addresses = [address for address in words[BRANCH_WORDS:] if address in present]
    return " ".join([*words[:BRANCH_WORDS], *addresses]) if addresses else ""
