"""State and counters of an emulated processor that executes a firmware image (firmware/emulator/psoc4)."""

import ctypes
from typing import Final, NamedTuple

EXCEPTIONS: Final = {"SVCall": 11, "PendSV": 14, "SysTick": 15}
"""Exception numbers of ARMv6-M by name."""
FIRST_INTERRUPT: Final = 16
"""Exception number of interrupt 0."""
FAULTS: Final = (
    "none",
    "undefined instruction",
    "unaligned access",
    "nothing at that address",
    "nothing executable at that address",
    "branch to an even address",
    "breakpoint",
    "SVC that its priority forbids",
    "bad exception return",
    "no stack for an exception",
    "no vector",
)
"""Texts of `enum cortex_m0_fault_kind`, in the order of its values."""


class Fault(NamedTuple):
    """A fault of an emulated processor.

    kind: one of `FAULTS`. pc: address of the faulting instruction. address: address of its memory access.
    """

    kind: str
    pc: int
    address: int


class Processor(NamedTuple):
    """State of the emulated processor of a board or of the hub; numbers are counted since its first power-up.

    resets: number of resets. cycles: clock cycles, including sleep. sleep_cycles: cycles in sleep. stack: largest stack
    size, bytes. faults: number of faults. fault: the latest fault, or None. is_broken: whether the processor has
    stopped, because its program used a feature that the emulator does not model. is_application: whether the
    application runs and not the bootloader. pc: program counter.
    """

    resets: int
    cycles: int
    sleep_cycles: int
    stack: int
    faults: int
    fault: Fault | None
    is_broken: bool
    is_application: bool
    pc: int


class HandlerCost(NamedTuple):
    """Clock cycles of an exception handler, including entry and return, summed over `count` calls.

    own: cycles without the handlers that preempt this handler. inclusive: cycles with the handlers that preempt it.
    latency: cycles from the request of the exception to the first cycle of its entry. The names with _min and _max are
    the smallest and largest values of a single call.
    """

    count: int  # type: ignore[assignment]  # replaces the method tuple.count
    own: int
    own_min: int
    own_max: int
    inclusive: int
    inclusive_max: int
    latency: int
    latency_max: int


class ProcessorStruct(ctypes.Structure):
    """C structure `struct taxel_bench_processor` of firmware/emulator/bench.h, the state of an emulated processor."""

    _fields_ = (
        *((name, ctypes.c_uint64) for name in ("resets", "cycles", "slept", "faults")),
        *((name, ctypes.c_uint32) for name in ("fault_kind", "fault_pc", "fault_address", "lowest_stack", "pc")),
        *((name, ctypes.c_uint32) for name in ("broken", "asleep", "is_application", "ram_end")),
        *((name, ctypes.c_uint32) for name in ("irq_scb0", "irq_scb1", "irq_csd")),
    )

    def list_exceptions(self) -> dict[str, int]:
        """Return the numbers of the exceptions and interrupts that the firmware can use, by name."""
        interrupts = {"SCB0": self.irq_scb0, "SCB1": self.irq_scb1, "CSD": self.irq_csd}
        return EXCEPTIONS | {name: FIRST_INTERRUPT + int(number) for name, number in interrupts.items()}

    def read(self) -> Processor:
        """Convert this C structure to a `Processor`: resets, cycles, stack use and faults of an emulated processor."""
        fault = Fault(FAULTS[self.fault_kind], self.fault_pc, self.fault_address) if self.faults else None
        return Processor(
            int(self.resets),
            int(self.cycles),
            int(self.slept),
            int(self.ram_end) - int(self.lowest_stack),
            int(self.faults),
            fault,
            bool(self.broken),
            bool(self.is_application),
            int(self.pc),
        )


class CostStruct(ctypes.Structure):
    """C structure `struct taxel_bench_cost` of firmware/emulator/bench.h, the cost of an exception handler."""

    _fields_ = tuple((name, ctypes.c_uint64) for name in HandlerCost._fields)

    def read(self) -> HandlerCost:
        """Convert this C structure to a `HandlerCost`: clock cycles used by an exception handler."""
        return HandlerCost(*(int(getattr(self, name)) for name in HandlerCost._fields))
