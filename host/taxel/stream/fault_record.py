"""Fault records of boards and hub: the last fault of a firmware since power-on (protocol/SPEC.md, register 0x90)."""

from dataclasses import dataclass

from taxel_protocol.framing import crc32
from taxel_protocol.layout import get_packer, unpack
from taxel_protocol.names import FaultCode
from taxel_protocol.registers import FaultRecord as RecordLayout
from taxel_protocol.registers import FaultRegister as RegisterLayout

REGISTER_SIZE = get_packer(RegisterLayout).size
"""Bytes of the fault register of a board."""

FAULT_REVISION = 1
"""First revision of the register map with a fault record."""

FAULT_VERSION = 3
"""First version of the protocol with the command GET_FAULT of the hub."""

HARD_FAULT = 3
_FIRST_INTERRUPT = 16


@dataclass(frozen=True)
class FaultRecord:
    """The last fault of a firmware since power-on.

    code: `taxel_protocol.names.FaultCode`. exception: number of the exception, 0 without one. count: faults since
    power-on, modulo 65536. program_counter, link_register: registers of the interrupted code, 0 without an exception.
    """

    code: int
    exception: int
    count: int
    program_counter: int
    link_register: int

    def describe(self) -> str:
        """Describe the fault in a few words, with PC and LR of an exception."""
        times = "" if self.count == 1 else f", {self.count} faults since power-on"
        if self.code == FaultCode.NOT_SCANNING:
            return f"stopped scanning and was reset by its watchdog{times}"
        if self.code != FaultCode.EXCEPTION:
            return f"fault {self.code}{times}"
        if self.exception == HARD_FAULT:
            name = "HardFault"
        elif self.exception >= _FIRST_INTERRUPT:
            name = f"interrupt {self.exception - _FIRST_INTERRUPT} without a handler"
        else:
            name = f"exception {self.exception}"
        return f"{name} at PC 0x{self.program_counter:08X}, LR 0x{self.link_register:08X}{times}"


def parse_fault_record(data: bytes) -> FaultRecord | None:
    """Parse the 12 bytes of a fault record; None if the record contains no fault, or for fewer bytes."""
    if len(data) < get_packer(RecordLayout).size:
        return None
    record = FaultRecord(**unpack(RecordLayout, data)[0])
    return None if record.code == FaultCode.NONE else record


def parse_fault_register(address: int, data: bytes) -> FaultRecord | None:
    """Parse the content of a board's fault register; None without a fault, for a wrong CRC, or for too few bytes.

    address: I2C address of the board, which is part of the CRC.
    """
    if len(data) < REGISTER_SIZE:
        return None
    content, crc = data[: REGISTER_SIZE - 4], data[REGISTER_SIZE - 4 : REGISTER_SIZE]
    if crc32(content, crc32(bytes([address]))) != int.from_bytes(crc, "little"):
        return None
    return parse_fault_record(content)
