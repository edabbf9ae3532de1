"""Test programs for a Cortex-M0: compiled, then run in the emulator, in Unicorn and in QEMU. Their output is one text.

A program calls its host through BKPT 0xAB (semihosting) to write a text or to end.
"""

import importlib
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from bare_cpu import RAM_BASE, BareCpu, Reason
from unicorn_oracle import FLASH_SIZE, INTERRUPT_BREAKPOINT, RAM_SIZE, UnicornMissingError

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = Path(__file__).parent / "programs"
FIRMWARE = ROOT / "firmware"
COMPILER, OBJCOPY, QEMU = "arm-none-eabi-gcc", "arm-none-eabi-objcopy", "qemu-system-arm"
SYS_WRITE0, SYS_EXIT = 4, 0x18
TIMEOUT_S = 60.0
CYCLES_MAX = 1 << 34
"""Number of cycles after which a program counts as hung."""

SOURCES: dict[str, tuple[str, ...]] = {
    "firmware": (
        *(f"codec/{name}.c" for name in ("crc32_small", "whitening_small", "encoder", "deframer")),
        *(f"codec/{name}.c" for name in ("compact_model", "compact_encode")),
        *(f"sensor/{name}.c" for name in ("sensor", "scan", "slave", "compact")),
    ),
    "bootloader": (
        "codec/crc32_small.c",
        *(f"bootloader/{name}.c" for name in ("bootloader", "choose", "config_rows", "confirm", "image")),
        *(f"bootloader/{name}.c" for name in ("metadata", "packet", "record")),
    ),
    "ticks": ("boards/psoc4/ticks.c",),
}
"""Firmware sources that a program is linked with."""
OPTIONS: dict[str, tuple[str, ...]] = {"ticks": ("-DIMAGE_APPLICATION", f"-I{FIRMWARE / 'boards/psoc4200'}")}
"""Compiler options of a program. ticks: the headers `part/` are those of a PSoC 4200."""


class ToolMissingError(Exception):
    """A missing tool; the message is one line."""


class ImageError(Exception):
    """A program that cannot be compiled or does not end; the message is one line."""


class Image(NamedTuple):
    """A compiled program. binary: flash contents from address 0. elf: the file that QEMU loads."""

    name: str
    binary: bytes
    elf: Path


class Run(NamedTuple):
    """Output of a program, and the number of cycles after which it ended (0: unknown)."""

    text: str
    cycles: int


@cache
def _get_folder() -> tempfile.TemporaryDirectory[str]:
    """Return the temporary folder of the compiled programs, which is removed when the process ends."""
    return tempfile.TemporaryDirectory(prefix="taxel-cortex-")


@cache
def build_image(name: str, optimisation: str = "-Os") -> Image:
    """Compile programs/`name`.c for a Cortex-M0. Raises `ToolMissingError`, `ImageError`."""
    if not shutil.which(COMPILER):
        raise ToolMissingError(f"{COMPILER} is missing: apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi")
    elf = Path(_get_folder().name) / f"{name}{optimisation}.elf"
    sources = [PROGRAMS / "image.c", PROGRAMS / f"{name}.c", *(FIRMWARE / source for source in SOURCES.get(name, ()))]
    options = ["-mcpu=cortex-m0", "-mthumb", optimisation, "-std=gnu11", "-Wall", "-Wextra", "-Werror", "-nostartfiles"]
    options += [
        *OPTIONS.get(name, ()),
        f"-I{FIRMWARE}",
        "--specs=nosys.specs",
        f"-T{PROGRAMS / 'image.ld'}",
        "-o",
        str(elf),
    ]
    _run([COMPILER, *options, *map(str, sources)])
    _run([OBJCOPY, "-O", "binary", str(elf), str(elf.with_suffix(".bin"))])
    return Image(name, elf.with_suffix(".bin").read_bytes(), elf)


def _run(command: list[str]) -> None:
    """Run a compiler command. Raises `ImageError` with the first error message of the command if the command fails."""
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode:
        lines = result.stderr.strip().splitlines()
        reason = next(
            (line for line in lines if "error: " in line), lines[0] if lines else "no message on standard error"
        )
        raise ImageError(f"{command[0]} failed: {reason}")


def _decode_text(memory: bytes) -> str:
    """Return the zero-terminated ASCII string at the start of `memory`."""
    return memory.split(b"\0", 1)[0].decode("ascii")


def run_emulator(image: Image, cpu: BareCpu | None = None) -> Run:
    """Run a compiled program in the emulator of this project, without wait states unless `cpu` is given. Raises
    `ImageError`.
    """
    if cpu is None:
        with BareCpu() as default_cpu:
            return run_emulator(image, default_cpu)
    cpu.write_memory(0, image.binary)
    cpu.reset()
    begin = cpu.cycle
    outputs: list[str] = []
    # A breakpoint is a call of the host: r0 is SYS_WRITE0 for the text at address r1, another value ends the program.
    while (reason := cpu.run(begin + CYCLES_MAX)) == Reason.BREAKPOINT:
        state = cpu.state["r"][0]
        if state[0] != SYS_WRITE0:
            return Run("".join(outputs), cpu.cycle - begin)
        address = int(state[1])
        end = FLASH_SIZE if address < FLASH_SIZE else RAM_BASE + RAM_SIZE
        outputs.append(_decode_text(cpu.read_memory(address, min(64, end - address))))
        cpu.skip_breakpoint()
    raise ImageError(f"{image.name} did not end: {reason.name}, {cpu.describe_fault()}")


class UnicornRun:
    """One run of a compiled program in Unicorn."""

    def __init__(self, image: Image) -> None:
        """Load a compiled program into the processor emulator Unicorn. Raises `UnicornMissingError` if it is not
        installed.
        """
        try:
            self._u: Any = importlib.import_module("unicorn")
            self._arm: Any = importlib.import_module("unicorn.arm_const")
        except ImportError:
            raise UnicornMissingError("unicorn is not installed: pip install unicorn==2.1.4") from None
        u, arm = self._u, self._arm
        self._engine = u.Uc(u.UC_ARCH_ARM, u.UC_MODE_THUMB, arm.UC_CPU_ARM_CORTEX_M0)
        self._engine.mem_map(0, FLASH_SIZE, u.UC_PROT_READ | u.UC_PROT_EXEC)
        self._engine.mem_map(RAM_BASE, RAM_SIZE)
        self._engine.mem_write(0, image.binary)
        self._engine.reg_write(arm.UC_ARM_REG_SP, int.from_bytes(image.binary[:4], "little"))
        self._entry = int.from_bytes(image.binary[4:8], "little")
        self._engine.hook_add(u.UC_HOOK_INTR, self._on_interrupt)
        self._outputs: list[str] = []
        self._ended = False

    def _on_interrupt(self, engine: Any, number: int, _: object) -> None:
        """Handle an exception of the emulated program.

        A breakpoint that requests output appends its string to the output; any other exception ends the run.
        """
        if number != INTERRUPT_BREAKPOINT or engine.reg_read(self._arm.UC_ARM_REG_R0) != SYS_WRITE0:
            self._ended = True
            engine.emu_stop()
            return
        address = engine.reg_read(self._arm.UC_ARM_REG_R1)
        self._outputs.append(_decode_text(bytes(engine.mem_read(address, 64))))
        # Continue after the breakpoint, an instruction of two bytes; bit 0 selects the Thumb state.
        engine.reg_write(self._arm.UC_ARM_REG_PC, (engine.reg_read(self._arm.UC_ARM_REG_PC) + 2) | 1)

    def run(self, instructions_per_call: int = 0) -> str:
        """Run the program to its end and return its output.

        instructions_per_call: number of instructions per call of Unicorn; 0 runs the whole program in one call.
        """
        address = self._entry
        while not self._ended:
            # Bit 0 of the start address selects the Thumb state; the program never reaches the end address.
            self._engine.emu_start(address | 1, 0xFFFFFFFE, count=instructions_per_call)
            address = self._engine.reg_read(self._arm.UC_ARM_REG_PC)
        return "".join(self._outputs)


def run_unicorn(image: Image) -> Run:
    """Run a compiled program in Unicorn in one call. Raises `UnicornMissingError`."""
    return Run(UnicornRun(image).run(), 0)


def run_qemu(image: Image, *, counted: bool = False) -> Run:
    """Run a compiled program on QEMU's micro:bit, a Cortex-M0. Raises `ToolMissingError`, `ImageError`.

    counted: time advances with the instructions, so that every run gives the same result. The number of cycles in the
    result is 0 (unknown).
    """
    if not shutil.which(QEMU):
        raise ToolMissingError(f"{QEMU} is missing: apt-get install qemu-system-arm")
    command = [QEMU, "-M", "microbit", "-display", "none", "-serial", "none", "-monitor", "none"]
    command += ["-semihosting-config", "enable=on,target=native", "-kernel", str(image.elf)]
    command += ["-icount", "shift=6,sleep=off"] if counted else []  # 64 ns: one clock of its 16 MHz
    try:
        result = subprocess.run(command, capture_output=True, check=False, timeout=TIMEOUT_S, stdin=subprocess.DEVNULL)
    except subprocess.TimeoutExpired:
        raise ImageError(f"{image.name} did not end in QEMU within {TIMEOUT_S:.0f} s") from None
    # QEMU's semihosting writes to standard output or to standard error, depending on its version.
    return Run((result.stdout + result.stderr).decode("ascii", "replace"), 0)
