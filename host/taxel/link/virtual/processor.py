"""What an emulated processor that executes an image has done (firmware/emulator/psoc4200)."""

import ctypes
from typing import Final, NamedTuple

RAM_END: Final = 0x20001000
EXCEPTIONS: Final = {"SVCall": 11, "PendSV": 14, "SysTick": 15, "SCB0": 26, "SCB1": 27, "CSD": 31}
"""Numbers of those that an image may have: ARMv6-M's, and 16 more than the interrupt's."""
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
"""enum cortex_m0_fault_kind."""


class Fault(NamedTuple):
    """A fault: its kind, the address of the instruction, and that of what it wanted."""

    kind: str
    pc: int
    address: int


class Processor(NamedTuple):
    """An executed board's processor, or the hub's: what has happened since its first power-up.

    `cycles`, `slept`: in all, those asleep among them. `stack`: bytes, the most
    there ever were. `fault`: the latest; None: there was none. `is_broken`: it stands still, because its program asked
    for something that nobody has modelled.
    """

    resets: int
    cycles: int
    slept: int
    stack: int
    faults: int
    fault: Fault | None
    is_broken: bool
    is_application: bool
    pc: int


class HandlerCost(NamedTuple):
    """Cycles of an exception's handler, entry and return included.

    `own`: without what has preempted it; `inclusive`: with it; `latency`: from its request to the first cycle of the
    entry.
    """

    count: int  # type: ignore[assignment]  # a tuple has a method of that name
    own: int
    own_min: int
    own_max: int
    inclusive: int
    inclusive_max: int
    latency: int
    latency_max: int


class ProcessorStruct(ctypes.Structure):
    """struct taxel_bench_processor."""

    _fields_ = (
        *((name, ctypes.c_uint64) for name in ("resets", "cycles", "slept", "faults")),
        *((name, ctypes.c_uint32) for name in ("fault_kind", "fault_pc", "fault_address", "lowest_stack", "pc")),
        *((name, ctypes.c_uint32) for name in ("broken", "asleep", "is_application")),
    )

    def read(self) -> Processor:
        """As a tuple."""
        fault = Fault(FAULTS[self.fault_kind], self.fault_pc, self.fault_address) if self.faults else None
        return Processor(
            int(self.resets),
            int(self.cycles),
            int(self.slept),
            RAM_END - int(self.lowest_stack),
            int(self.faults),
            fault,
            bool(self.broken),
            bool(self.is_application),
            int(self.pc),
        )


class CostStruct(ctypes.Structure):
    """struct taxel_bench_cost."""

    _fields_ = tuple((name, ctypes.c_uint64) for name in HandlerCost._fields)

    def read(self) -> HandlerCost:
        """As a tuple."""
        return HandlerCost(*(int(getattr(self, name)) for name in HandlerCost._fields))
