"""Test model of a CY8C4245AXI-483: Unicorn executes the image, Python models the registers that the firmware uses.

Interrupts are taken between slices of instructions, and time is proportional to instructions. A register without a
model returns the last written value. firmware/boards/psoc4200/PERIPHERALS.md specifies the expected behaviour of each
register.
"""

import struct
from collections import defaultdict
from collections.abc import Callable

from unicorn import UC_ARCH_ARM, UC_MODE_MCLASS, UC_MODE_THUMB, Uc
from unicorn.arm_const import (
    UC_ARM_REG_LR,
    UC_ARM_REG_PC,
    UC_ARM_REG_PRIMASK,
    UC_ARM_REG_SP,
    UC_CPU_ARM_CORTEX_M0,
)

METADATA_ROWS = (254, 255)
FLASH_SIZE, RAM, RAM_SIZE = 0x8000, 0x20000000, 0x1000
SFLASH, SYSTEM = 0x0FFFF000, 0xE000E000
ROW = 128
SLICE = 1000
"""Instructions between two checks for interrupts."""

UNMASKED_WITHIN = 40
"""Instructions after a slice within which interrupts must be unmasked."""

ROW_CYCLES = 400_000
"""Duration of a ROM call: 8 ms at 48 MHz, several wraps of SysTick."""

RETURN_ADDRESS = 0x1FFF0000
"""Return address of handlers: an empty page."""

SYSREQ, SYSARG = 0x40000004, 0x40000008
SYST_CONTROL, SYST_RELOAD, SYST_VALUE = 0xE000E010, 0xE000E014, 0xE000E018
NVIC_SET, NVIC_CLEAR, ICSR, AIRCR = 0xE000E100, 0xE000E180, 0xE000ED04, 0xE000ED0C
RES_CAUSE, WDT_CONTROL = 0x400B0300, 0x400B0210
POWER_ON, SOFTWARE = 0, 1 << 4
SYSTICK_VECTOR = 15


class Part:
    """A part under test.

    on_write[address](value) and on_read[address]() model registers; levels[irq]() returns the level of an interrupt
    line.
    """

    def __init__(self, cause: int = POWER_ON, flash: bytes = b"", ram: bytes = bytes(RAM_SIZE)) -> None:
        self._engine = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        self._engine.ctl_set_cpu_model(UC_CPU_ARM_CORTEX_M0)
        for address, size in ((0, FLASH_SIZE), (RAM, RAM_SIZE), (SFLASH, 0x1000), (RETURN_ADDRESS, 0x1000)):
            self._engine.mem_map(address, size)
        self._engine.mem_write(0, flash)
        self._engine.mem_write(RAM, ram)
        self._engine.mem_write(SFLASH, bytes(address & 0xFF for address in range(0x1000)))
        for base, size in ((0x40000000, 0x100000), (SYSTEM, 0x1000)):
            self._engine.mmio_map(base, size, self._read, base, self._write, base)
        self.words: dict[int, int] = defaultdict(int)
        self.words[RES_CAUSE] = cause
        self.on_write: dict[int, Callable[[int], None]] = {
            SYSREQ: self._system_call,
            SYST_VALUE: self._clear_tick,
            NVIC_SET: self._enable,
            NVIC_CLEAR: self._disable,
            ICSR: self._set_icsr,
            AIRCR: self._reset,
            RES_CAUSE: lambda value: self.words.__setitem__(RES_CAUSE, self.words[RES_CAUSE] & ~value),
        }
        self.on_read: dict[int, Callable[[], int]] = {SYST_VALUE: self._tick, ICSR: lambda: self._tick_pending << 26}
        self.levels: dict[int, Callable[[], bool]] = {}
        self.enabled = 0
        """Enabled interrupts: bit n for interrupt n."""
        self.calls: list[tuple[int, int]] = []
        self.was_reset = False
        self.cycles = 0
        self.speed = 1
        """Cycles per instruction; larger values make time pass faster."""
        self._latch = bytes(ROW)
        self._ticks_remaining, self._tick_pending = 0, False
        stack, reset = struct.unpack("<II", self.flash(0, 8))
        self._engine.reg_write(UC_ARM_REG_SP, stack)
        self._engine.reg_write(UC_ARM_REG_PC, reset)

    def flash(self, address: int, size: int) -> bytes:
        """Read bytes of flash."""
        return bytes(self._engine.mem_read(address, size))

    def write_flash(self, address: int, data: bytes) -> None:
        """Write flash directly, as a programmer does."""
        self._engine.mem_write(address, data)

    def ram(self, offset: int = 0, size: int = RAM_SIZE) -> bytes:
        """Read bytes of RAM."""
        return bytes(self._engine.mem_read(RAM + offset, size))

    @property
    def pc(self) -> int:
        """Address of the next instruction."""
        return int(self._engine.reg_read(UC_ARM_REG_PC))

    @property
    def sp(self) -> int:
        """Stack pointer."""
        return int(self._engine.reg_read(UC_ARM_REG_SP))

    @property
    def is_masked(self) -> bool:
        """PRIMASK."""
        return bool(self._engine.reg_read(UC_ARM_REG_PRIMASK))

    @property
    def vectors(self) -> tuple[int, ...]:
        """The 32 vectors currently in use."""
        data = self.ram(0, 128) if self.words[0x40000000] & 1 else self.flash(0, 128)
        return struct.unpack("<32I", data)

    def run_until(self, ready: Callable[[], bool], slices: int = 20_000) -> None:
        """Execute until `ready()` is true. Fails after `slices` slices, or if the processor is reset."""
        for _ in range(slices):
            if ready():
                return
            if self.was_reset:
                raise AssertionError("the firmware reset the processor")
            self.run()
        raise AssertionError(f"the condition is not met after {slices} slices, at 0x{self.pc:X}")

    def run(self, slices: int = 1) -> None:
        """Execute slices of instructions, and the interrupts that are due after each."""
        for _ in range(slices):
            self._engine.emu_start(self.pc | 1, RETURN_ADDRESS, count=SLICE)
            self._advance_time(SLICE)
            for _ in range(UNMASKED_WITHIN):  # a loop that unmasks interrupts briefly may be as long as a slice
                if not self.is_masked or not self._pending_exceptions():
                    break
                self._engine.emu_start(self.pc | 1, RETURN_ADDRESS, count=1)
            self._take_interrupts()

    def call_handler(self, number: int) -> None:
        """Execute the handler of an exception to its end."""
        state = self._engine.context_save()
        self._engine.reg_write(UC_ARM_REG_SP, (int(self._engine.reg_read(UC_ARM_REG_SP)) - 32) & ~7)
        self._engine.reg_write(UC_ARM_REG_LR, RETURN_ADDRESS | 1)
        self._engine.emu_start(self.vectors[number] | 1, RETURN_ADDRESS, count=1_000_000)
        if self.was_reset:
            return
        if self.pc != RETURN_ADDRESS:
            raise AssertionError(f"handler {number} does not return, it is at 0x{self.pc:X}")
        self._engine.context_restore(state)

    def _pending_exceptions(self) -> list[int]:
        """Return the numbers of the pending exceptions, SysTick first."""
        lines = [16 + irq for irq, level in self.levels.items() if self.enabled >> irq & 1 and level()]
        return [SYSTICK_VECTOR] * self._tick_pending + lines

    def _take_interrupts(self) -> None:
        """Execute the handlers of all pending exceptions, unless interrupts are masked.

        Fails if an interrupt repeats endlessly.
        """
        for _ in range(1000):
            if self.is_masked:
                return
            due = self._pending_exceptions()
            if not due or self.was_reset:
                return
            if due[0] == SYSTICK_VECTOR:
                self._tick_pending = False
            self.call_handler(due[0])
        raise AssertionError("an interrupt repeats endlessly: its cause is not cleared")

    def _advance_time(self, instructions: int) -> None:
        """Advance the cycle counter and SysTick by a number of executed instructions."""
        self.cycles += instructions * self.speed
        if self.words[SYST_CONTROL] & 1:
            self._ticks_remaining -= instructions * self.speed
            period = self.words[SYST_RELOAD] + 1
            self._tick_pending |= self._ticks_remaining <= 0
            self._ticks_remaining = (
                self._ticks_remaining if self._ticks_remaining > 0 else period - -self._ticks_remaining % period
            )

    def _tick(self) -> int:
        """Return the value of the SysTick counter; the read itself takes some time."""
        self._advance_time(10)
        return self._ticks_remaining if self._ticks_remaining <= self.words[SYST_RELOAD] else 0

    def _clear_tick(self, _: int) -> None:
        self._ticks_remaining = self.words[SYST_RELOAD] + 1

    def _set_icsr(self, value: int) -> None:
        """Clear the pending SysTick exception if bit 25 is written."""
        if value >> 25 & 1:
            self._tick_pending = False

    def _enable(self, value: int) -> None:
        self.enabled |= value

    def _disable(self, value: int) -> None:
        self.enabled &= ~value

    def _reset(self, value: int) -> None:
        """Stop the execution, because the firmware has requested a reset of the processor."""
        assert value == 0x05FA0004
        self.was_reset = True
        self._engine.emu_stop()

    def _read(self, _: Uc, offset: int, size: int, base: int) -> int:
        """Return the value of a register, by its model or as last written. Only 32-bit reads are allowed."""
        address = base + offset
        assert size == 4, f"{size} bytes of register 0x{address:08X}"
        return self.on_read[address]() if address in self.on_read else self.words[address]

    def _write(self, _: Uc, offset: int, size: int, value: int, base: int) -> None:
        """Write a register by its model, or store the value. Only 32-bit writes are allowed."""
        address = base + offset
        assert size == 4, f"{size} bytes of register 0x{address:08X}"
        if address in self.on_write:
            self.on_write[address](value)
        else:
            self.words[address] = value

    def _system_call(self, value: int) -> None:
        """Execute a system call of the supervisory ROM.

        Opcodes 4 (load latch), 5 (write row) and 6 (program row) need their keys; interrupts must be masked.
        """
        opcode = value & 0xFFFF
        address = self.words[SYSARG]
        parameters = struct.unpack("<II", self._engine.mem_read(address, 8))
        assert value == 0x80000000 | opcode
        assert self.is_masked
        assert parameters[0] & 0xFFFF == 0xB6 | (0xD3 + opcode) << 8
        high = parameters[0] >> 16
        self.calls.append((opcode, high))
        if opcode == 4:
            assert (high, parameters[1]) == (0, ROW - 1)
            self._latch = bytes(self._engine.mem_read(address + 8, ROW))
        elif opcode == 5:
            assert sum(struct.unpack("<32I", self._latch)) % 2**32 or not any(self._latch), (
                "a row with word sum zero cannot be written by opcode 5"
            )
            self.write_flash(high * ROW, self._latch)
        else:
            assert opcode == 6
            old = self.flash(high * ROW, ROW)
            self.write_flash(high * ROW, bytes(a | b for a, b in zip(old, self._latch, strict=True)))
        self._advance_time(ROW_CYCLES // self.speed)
        self.words[SYSARG] = 0xA0000000


def read_metadata(part: Part) -> bytes:
    """Read the fields of the newest metadata record: confirmed, pending, tries of A and B."""
    rows = [part.flash(row * ROW, ROW) for row in METADATA_ROWS]
    valid = [row for row in rows if row[:4] == b"TXLM"]
    return max(valid, key=lambda row: int.from_bytes(row[4:8], "little"))[8:12]
