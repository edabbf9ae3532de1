"""Faults of boards, I2C bus, hub and UART: steps that inject each fault, and the limits of its consequences.

docs/faults-on-the-wires.md is written from these cases by tools/hil/fault_table.py.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from hil_tests.harness.rig import Rig
from taxel.skin import Skin

BOOT_S = 0.04
"""Time from power to the first acknowledge of an emulated board, seconds."""
STRETCH_LIMIT_US = 5000
"""Clock stretching that the hub permits in a transfer, beyond its nominal duration (firmware/hub/schedule.c)."""


class FaultStep(NamedTuple):
    """One call of the fault injector, `at_s` seconds after the first step.

    fault: name of the fault. is_of_board: the fault applies to the board under test; otherwise to hub, bus or UART.
    `value`, `second_value`: parameters of the fault, see firmware/emulator/README.md.
    """

    at_s: float
    fault: str
    is_of_board: bool
    value: float = 0.0
    second_value: float = 0.0


@dataclass(frozen=True)
class FaultCase:
    """A fault of one board, the bus, the hub or the UART, and the limits of its consequences.

    ends_s: time from the last step, or its effect, until the board acknowledges again. hub, host: text for the page on
    what the hub does and what the host receives. counters: counters of the hub for this board that may increase.
    max_missing: largest number of missing frames of the board. is_bus_wide: frames of other boards may be missing too.
    restarts: the hub sends an unrequested HUB_HANDSHAKE. loses_on_wire: frames are lost between hub and host.
    """

    name: str
    steps: Sequence[FaultStep]
    hub: str
    host: str
    counters: tuple[str, ...] = ()
    max_missing: int = 0
    ends_s: float = 0.0
    is_bus_wide: bool = False
    restarts: bool = False
    loses_on_wire: bool = False

    @property
    def is_of_uart(self) -> bool:
        """Whether the fault damages, delays or loses bytes of the UART."""
        return any(step.fault.startswith(("up_", "down_")) for step in self.steps)

    def inject(self, rig: Rig, skin: Skin, address: int) -> float:
        """Inject all steps of this fault into the board with an I2C address. Returns the rig's clock at the last
        step, in s.
        """
        assert rig.faults is not None
        start_s = rig.clock.now_s()
        for step in self.steps:
            step_s = start_s + step.at_s
            while rig.clock.now_s() < step_s - 1e-9:
                skin.hub.stream.poll(max(step_s - rig.clock.now_s(), 1e-6))
            rig.faults.inject(step.fault, address if step.is_of_board else 0, step.value, step.second_value)
        return rig.clock.now_s()


def _at_byte(fault: str, byte: int, second_value: float = 0.0) -> tuple[FaultStep]:
    """Build the only step of a fault case: a fault at byte number `byte` of the board's next I2C transfer. Byte 0 is
    the address.
    """
    return (FaultStep(0.0, fault, True, float(byte), second_value),)


RETRIES = "repeats the read at once"
COUNTS_RETRY = ("retries",)
ABSENCE = "marks the board absent after three polls; sends its address once per cycle; identifies it on acknowledge"

CASES = (
    FaultCase("address not acknowledged once", _at_byte("nack_at", 0), RETRIES, "nothing", COUNTS_RETRY),
    FaultCase(
        "byte of a snapshot not acknowledged", _at_byte("nack_at", 9), f"CRC error; {RETRIES}", "nothing", COUNTS_RETRY
    ),
    FaultCase(
        "address not acknowledged 12 times",
        (FaultStep(0.0, "nack", True, 12),),
        ABSENCE,
        "BOARD_FAULT nack, then recovered",
        ("nacks", "retries"),
        max_missing=12,
    ),
    FaultCase("clock stretched 4 ms", _at_byte("stretch_at", 9, 4000), "waits", "a delayed frame"),
    FaultCase(
        "clock stretched 50 ms",
        _at_byte("stretch_at", 9, 50000),
        "ends the transfer at its deadline, frees the bus with nine clocks and a stop",
        "BOARD_FAULT timeout, then recovered",
        ("timeouts",),
        max_missing=1,
        is_bus_wide=True,
    ),
    FaultCase(
        "SDA low for 5 clocks",
        (FaultStep(0.0, "hold_sda", True, 5),),
        "frees the bus with clocks, then repeats the read",
        "nothing, or BOARD_FAULT, then recovered",
        ("retries", "bus_errors", "crc_errors"),
        max_missing=1,
        is_bus_wide=True,
    ),
    FaultCase(
        "SDA low for 200 clocks",
        (FaultStep(0.0, "hold_sda", True, 200),),
        "tries to free the bus every 10 ms; reports SDA stuck, then SDA free",
        "LOG and BOARD_FAULT sda_stuck, then recovered",
        ("retries", "bus_errors", "crc_errors", "nacks"),
        max_missing=20,
        is_bus_wide=True,
    ),
    FaultCase(
        "SCL low for 3 ms",
        (FaultStep(0.0, "hold_scl", True, 3000),),
        "waits",
        "a delayed frame",
        ("retries", "bus_errors"),
        max_missing=1,
        is_bus_wide=True,
    ),
    FaultCase(
        "SCL low for 100 ms",
        (FaultStep(0.0, "hold_scl", True, 100000),),
        "cannot send a clock; reports SCL stuck, checks SCL every 10 ms, reports SCL free",
        "LOG and BOARD_FAULT scl_stuck, then recovered",
        ("timeouts", "bus_errors", "retries", "nacks"),
        max_missing=20,
        is_bus_wide=True,
    ),
    FaultCase("arbitration lost", _at_byte("arbitration_at", 6), RETRIES, "nothing", COUNTS_RETRY),
    FaultCase("a stray stop", _at_byte("bus_error_at", 6), f"frees the bus, {RETRIES}", "nothing", COUNTS_RETRY),
    FaultCase(
        "bit of the address flipped",
        _at_byte("flip_at", 0, 2),
        f"another board or no board acknowledges: CRC error or NACK; {RETRIES}",
        "nothing",
        COUNTS_RETRY,
    ),
    FaultCase(
        "read bit of the address flipped",
        _at_byte("flip_at", 0, 0),
        f"reads FF: CRC error; {RETRIES}",
        "nothing",
        COUNTS_RETRY,
    ),
    FaultCase("bit of a count flipped", _at_byte("flip_at", 12, 6), f"CRC error; {RETRIES}", "nothing", COUNTS_RETRY),
    FaultCase(
        "bit flipped in each of 3000 bytes",
        (FaultStep(0.0, "corrupt", True, 3000),),
        "two CRC errors per poll while the fault lasts",
        "BOARD_FAULT crc, then recovered",
        ("crc_errors", "retries"),
        max_missing=60,
    ),
    FaultCase(
        "brown-out of a board during a frame",
        _at_byte("brown_out_at", 20, 5),
        "receives NACK until the board has booted; detects the restart from the board's clock; "
        "identifies the board and writes its settings",
        "BOARD_FAULT nack, restarted, recovered; BOARD_INFO",
        ("nacks", "crc_errors", "retries"),
        max_missing=5,
        ends_s=0.005 + BOOT_S,
    ),
    FaultCase(
        "board unplugged for 0.5 s",
        (FaultStep(0.0, "unplug", True), FaultStep(0.5, "plug", True)),
        ABSENCE,
        "BOARD_FAULT nack, recovered; BOARD_INFO",
        ("nacks", "crc_errors", "retries"),
        max_missing=20,
        ends_s=BOOT_S,
    ),
    FaultCase(
        "bit of a UART byte flipped",
        (FaultStep(0.0, "up_flip", False, 30, 3),),
        "nothing",
        "one lost frame, counted",
        max_missing=1,
        loses_on_wire=True,
        is_bus_wide=True,
    ),
    FaultCase(
        "UART bytes lost",
        (FaultStep(0.0, "up_drop", False, 30, 4),),
        "nothing",
        "one or two lost frames, counted",
        max_missing=1,
        loses_on_wire=True,
        is_bus_wide=True,
    ),
    FaultCase(
        "UART bytes doubled",
        (FaultStep(0.0, "up_double", False, 30, 4),),
        "nothing",
        "one or two lost frames, counted",
        max_missing=1,
        loses_on_wire=True,
        is_bus_wide=True,
    ),
    FaultCase(
        "UART held for 30 ms",
        (FaultStep(0.0, "up_delay", False, 30),),
        "waits until its transmit buffer has space",
        "delayed frames",
    ),
    FaultCase(
        "hub busy for 30 ms",
        (FaultStep(0.0, "hub_stall", False, 30),),
        "continues its cycle",
        "delayed frames",
        is_bus_wide=True,
        max_missing=1,
    ),
    FaultCase(
        "brown-out of the hub",
        (FaultStep(0.0, "hub_restart", False),),
        "restarts: sends HUB_HANDSHAKE, scans the bus",
        "repeats the handshake, sets the rate, sends START",
        is_bus_wide=True,
        restarts=True,
        max_missing=4,
    ),
    FaultCase(
        "hub without power for 0.2 s",
        (FaultStep(0.0, "hub_unplug", False), FaultStep(0.2, "hub_plug", False)),
        "restarts: sends HUB_HANDSHAKE, scans the bus",
        "repeats the handshake, sets the rate, sends START",
        is_bus_wide=True,
        restarts=True,
        max_missing=12,
    ),
    FaultCase(
        "host does not read for 0.5 s",
        (FaultStep(0.0, "mute_host", False, 1), FaultStep(0.5, "mute_host", False)),
        "stops transmitting; after 100 ms discards whole frames and counts them",
        "the buffered frames, then gaps that the hub's counters explain",
        ("dropped",),
        is_bus_wide=True,
        max_missing=20,
    ),
)
