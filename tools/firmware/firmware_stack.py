"""Worst-case stack of a linked image, from its machine code, the compiler's .su files and a table of pointer calls.

The frame of a function is the sum of its pushes and subtractions from the stack pointer, or the size in the compiler's
.su file if that is larger. Calls and jumps to other functions are read from the disassembly. A table
(firmware/boards/psoc4/calls.toml) lists the targets of calls through pointers and the interrupts that preempt each
other. An exception takes 32 bytes and up to 4 bytes of alignment (ARMv6-M Architecture Reference Manual, B1.5.6).
"""

import re
import subprocess
import tomllib
from bisect import bisect_right
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final, NoReturn

from firmware_elf import LinkedImage

from taxel_tools.errors import FirmwareFileError

EXCEPTION_FRAME: Final = 32 + 4
ENTRY: Final = "reset_handler"
UNEXPECTED: Final = "unexpected_handler"
LABEL: Final = re.compile(r"^([0-9a-f]{8}) <(.+)>:$")
INSTRUCTION: Final = re.compile(r"^\s+([0-9a-f]+):\t(\S+)(?:\t(.*))?$")
SUFFIX: Final = re.compile(r"\.(lto_priv|constprop|isra|part|cold)\.\d+")


@dataclass
class Routine:
    """A function of the disassembly. calls: addresses of other functions that it calls or jumps to."""

    name: str
    frame: int = 0
    calls: set[int] = field(default_factory=set)
    uses_pointer: bool = False


@dataclass(frozen=True)
class CallTable:
    """Content of calls.toml, at `path`.

    pointers: (names of functions that call through a pointer, names of the functions that they may call). levels:
    (names of images, names of the interrupt handlers of each priority level). never_pointed: functions that no pointer
    reaches, although a constant of an image equals their address.
    """

    path: str
    pointers: tuple[tuple[list[str], list[str]], ...]
    levels: tuple[tuple[list[str], list[list[str]]], ...]
    never_pointed: frozenset[str] = frozenset()


@dataclass(frozen=True)
class StackUse:
    """Worst-case stack of an image in bytes.

    start: deepest call chain from the reset handler. interrupts: all interrupts that can nest on top of it. chain:
    names of the functions, interrupts last.
    """

    start: int
    interrupts: int
    chain: tuple[str, ...]

    @property
    def total(self) -> int:
        """Total stack in bytes."""
        return self.start + self.interrupts


def _fail(path: str, name: str, expected: str, found: str, remedy: str) -> NoReturn:
    """Raise `FirmwareFileError` for an image whose stack depth cannot be computed."""
    raise FirmwareFileError(path, name, expected, found, remedy)


def read_call_table(path: Path) -> CallTable:
    """Read calls.toml. Raises FirmwareFileError, OSError."""
    try:
        document = tomllib.loads(path.read_text())
        pointers = tuple((list(row["callers"]), list(row["targets"])) for row in document["pointer"])
        levels = tuple((list(row["images"]), [list(level) for level in row["handlers"]]) for row in document["levels"])
        never_pointed = frozenset(document.get("never_pointed", []))
    except (ValueError, KeyError, TypeError) as error:
        _fail(str(path), "table", "[[pointer]] and [[levels]]", str(error).splitlines()[0], "correct it")
    return CallTable(str(path), pointers, levels, never_pointed)


def disassemble(path: str, objdump: str) -> dict[int, Routine]:
    """Disassemble an ELF file with objdump and return its functions, by address.

    Raises OSError if the tool is missing, CalledProcessError if it fails.
    """
    run = subprocess.run([objdump, "-d", "--no-show-raw-insn", path], capture_output=True, text=True, check=True)
    return read_disassembly(run.stdout)


def read_disassembly(text: str) -> dict[int, Routine]:
    """Return the functions in the output of objdump, by address.

    A jump into the middle of another function is treated as a call of that function.
    """
    routines: dict[int, Routine] = {}
    begin, previous = -1, ""
    for line in text.splitlines():
        label = LABEL.match(line)
        if label:
            begin = int(label[1], 16)
            routines[begin] = Routine(SUFFIX.sub("", label[2]))
            continue
        instruction = INSTRUCTION.match(line)
        if instruction and begin >= 0:
            _read_instruction(routines[begin], begin, instruction[2], instruction[3] or "", previous)
            previous = line
    starts = sorted(routines)
    for address, routine in routines.items():  # a jump into the middle of a routine counts as a call
        # A jump inside the routine itself is no call, but a target at its start is recursion and stays.
        owners = {starts[bisect_right(starts, target) - 1] for target in routine.calls if target >= starts[0]}
        routine.calls = owners - {address} | routine.calls & {address}
    return routines


def _read_instruction(routine: Routine, begin: int, mnemonic: str, operands: str, previous: str) -> None:
    """Add one instruction's effect on the stack and the calls to its function.

    begin: address of the function. previous: line of the preceding instruction.
    """
    if mnemonic == "push":
        routine.frame += 4 * _count_registers(operands)
    elif mnemonic == "sub" and operands.startswith("sp, #"):
        routine.frame += int(operands[5:].split()[0])
    elif (mnemonic == "add" and operands.startswith("sp, r")) or (mnemonic == "mov" and operands.startswith("sp, ")):
        # Dynamic: the size is in the compiler's .su file. Without it the frame stays negative, which means unknown.
        routine.frame = -(1 << 20)
    # A bx after a pop returns from the function: the pop has loaded the return address.
    elif mnemonic == "blx" or (mnemonic == "bx" and operands != "lr" and "pop" not in previous):
        routine.uses_pointer = True
    elif mnemonic[0] == "b" and "<" in operands:
        target = int(operands.split()[0], 16)
        # A branch without link to the function's own start is a loop; bl to the start is recursion.
        if target != begin or mnemonic == "bl":
            routine.calls.add(target)


def _count_registers(operands: str) -> int:
    """Return the number of registers in an ARM instruction's operand list; "{r4-r7, lr}" has 5."""
    count = 0
    for part in operands.strip("{}").split(","):
        first, _, last = part.strip().partition("-")
        count += int(last[1:]) - int(first[1:]) + 1 if last else 1
    return count


def read_frame_sizes(paths: list[Path]) -> dict[str, int]:
    """Return the frame size of each function in bytes, from the compiler's .su files.

    Raises FirmwareFileError for an unbounded frame.
    """
    frames: dict[str, int] = {}
    for path in paths:
        for line in path.read_text().splitlines():
            place, size, kind = line.split("\t")
            name = SUFFIX.sub("", place.rsplit(":", 1)[1])
            if "dynamic" in kind and "bounded" not in kind:
                _fail(str(path), name, "a frame of a known size", kind, "use no arrays of variable length")
            frames[name] = max(frames.get(name, 0), int(size))
    return frames


class CallGraph:
    """Call graph of one image, from which its largest stack depth is computed."""

    def __init__(
        self, image: LinkedImage, routines: dict[int, Routine], frame_sizes: dict[str, int], table: CallTable
    ) -> None:
        """Complete the frame sizes of the functions and find the functions that can be called through pointers.

        routines: disassembled functions by address. frame_sizes: frame sizes in bytes by function name, from the
        compiler. Raises FirmwareFileError for a frame of unknown size, or for a function that calls.toml must list.
        """
        self._path = image.path
        self._routines = routines
        self._table = table
        self._depths: dict[int, tuple[int, tuple[str, ...]]] = {}
        for routine in routines.values():
            routine.frame = max(routine.frame, frame_sizes.get(routine.name, routine.frame))
            if routine.frame < 0:
                _fail(image.path, routine.name, "a frame of a known size", "none", "build with -fstack-usage")
        self._pointer_targets = self._find_pointer_targets(image)

    def _find_pointer_targets(self, image: LinkedImage) -> dict[int, str]:
        """Return the names of the functions whose address is stored as a word of the image, by address.

        These functions can be called through pointers. Raises FirmwareFileError for a function that is not among the
        pointer targets of calls.toml. The entry point, interrupt handlers and `never_pointed` functions are omitted.
        """
        words = {int.from_bytes(image.content[at : at + 4], "little") for at in range(0, len(image.content) - 3, 4)}
        known = {name for _, levels in self._table.levels for level in levels for name in level}
        known |= {ENTRY, UNEXPECTED, *self._table.never_pointed}
        functions = {function.address for function in image.functions}
        names = {}
        for address, routine in self._routines.items():
            # A function pointer is the address with bit 0 set, which selects Thumb code.
            if address not in functions or address | 1 not in words or routine.name in known:
                continue
            if not any(_matches_patterns(routine.name, targets) for _, targets in self._table.pointers):
                _fail(image.path, routine.name, f"an entry in {self._table.path}", "none", "add its callers")
            names[address] = routine.name
        return names

    def _list_callees(self, address: int) -> set[int]:
        """Return the addresses of the functions that a function may call, directly or through a pointer."""
        routine = self._routines[address]
        callees = set(routine.calls)
        if routine.uses_pointer:
            targets = next(
                (targets for callers, targets in self._table.pointers if _matches_patterns(routine.name, callers)), []
            )
            callees |= {target for target, name in self._pointer_targets.items() if _matches_patterns(name, targets)}
        return callees

    def compute_depth(self, address: int, ancestors: tuple[int, ...] = ()) -> tuple[int, tuple[str, ...]]:
        """Return the stack in bytes of the deepest call chain that begins with a function, and the names in this chain.

        address: address of the function. ancestors: its callers. Raises FirmwareFileError for recursion.
        """
        if address in self._depths:
            return self._depths[address]
        name = self._routines[address].name
        if address in ancestors:
            _fail(self._path, name, "no recursion", "a direct or indirect call of itself", "see calls.toml")
        deepest: tuple[int, tuple[str, ...]] = (0, ())
        for callee in sorted(self._list_callees(address)):
            deepest = max(deepest, self.compute_depth(callee, (*ancestors, address)))
        self._depths[address] = deepest[0] + self._routines[address].frame, (name, *deepest[1])
        return self._depths[address]

    def compute_stack_use(self, image: str) -> StackUse:
        """Compute the image's worst-case stack: deepest call chain from the start, and the interrupts that can nest.

        image: name of the image.
        """
        by_name = {routine.name: address for address, routine in self._routines.items()}
        if ENTRY not in by_name:
            _fail(self._path, "symbols", ENTRY, "none", "is it an image of this port?")
        levels = next((levels for images, levels in self._table.levels if _matches_patterns(image, images)), None)
        if levels is None:
            _fail(self._table.path, "levels", f"a row for {image}", "none", "add one")
        interrupts, chain = 0, self.compute_depth(by_name[ENTRY])
        names = chain[1]
        for level in levels:
            deepest = max((self.compute_depth(by_name[name]) for name in level if name in by_name), default=(0, ()))
            interrupts += EXCEPTION_FRAME + deepest[0]
            names = (*names, *deepest[1])
        return StackUse(chain[0], interrupts, names)


def _matches_patterns(name: str, patterns: list[str]) -> bool:
    """Return whether a function name matches one of the shell patterns and none of the patterns that begin with "!"."""
    if any(fnmatchcase(name, pattern[1:]) for pattern in patterns if pattern.startswith("!")):
        return False
    return any(fnmatchcase(name, pattern) for pattern in patterns)
