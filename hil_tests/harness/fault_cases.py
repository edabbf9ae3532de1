"""Faults on the wires: how each fault is injected, and the required behaviour (docs/faults-on-the-wires.md)."""

from collections.abc import Sequence
from dataclasses import dataclass

from hil_tests.harness.rig import Rig
from taxel.skin import Skin

BOOT_S = 0.04
"""Time from power-on of an emulated board to its first acknowledge, seconds."""
STRETCH_LIMIT_US = 5000
"""Clock stretching that the hub permits in a transfer, microseconds (firmware/hub/schedule.c)."""


@dataclass(frozen=True)
class FaultCase:
    """A fault of one board, the bus, the hub or the UART.

    steps: (seconds since the first step, fault, whether it acts on the board under test, value, second value). ends_s:
    time from the last step, or from its effect, until the board acknowledges again. counters: counters of the hub for
    this board that rise. costs: largest permitted number of missing frames of the board. is_bus_wide: other boards
    lose frames too. restarts: the hub sends an unrequested HUB_HANDSHAKE. hub, host: their behaviour as text.
    """

    name: str
    steps: Sequence[tuple[float, str, bool, float, float]]
    hub: str
    host: str
    counters: tuple[str, ...] = ()
    costs: int = 0
    ends_s: float = 0.0
    is_bus_wide: bool = False
    restarts: bool = False
    loses_on_wire: bool = False

    def inject(self, rig: Rig, skin: Skin, address: int) -> float:
        """Inject the fault. Returns the time of the last step on the rig's clock."""
        assert rig.faults is not None
        start_s = rig.clock.now_s()
        for at_s, fault, is_of_board, value, second in self.steps:
            while rig.clock.now_s() < start_s + at_s - 1e-9:
                skin.hub.stream.poll(max(start_s + at_s - rig.clock.now_s(), 1e-6))
            rig.faults.inject(fault, address if is_of_board else 0, value, second)
        return rig.clock.now_s()


def _at(fault: str, byte: int, second: float = 0.0) -> tuple[tuple[float, str, bool, float, float], ...]:
    return ((0.0, fault, True, float(byte), second),)


RETRIES = "repeats the read at once"
COUNTS_RETRY = ("retries",)
ABSENT = (
    "marks the board as absent after three polls; sends one address byte per cycle; "
    "identifies the board when it responds"
)

CASES = (
    FaultCase("address not acknowledged once", _at("nack_at", 0), RETRIES, "nothing", COUNTS_RETRY),
    FaultCase(
        "a snapshot's byte not acknowledged", _at("nack_at", 9), f"CRC error; {RETRIES}", "nothing", COUNTS_RETRY
    ),
    FaultCase(
        "address not acknowledged 12 times",
        ((0.0, "nack", True, 12, 0),),
        ABSENT,
        "BOARD_FAULT nack, then recovered",
        ("nacks", "retries"),
        costs=12,
    ),
    FaultCase("clock stretched 4 ms", _at("stretch_at", 9, 4000), "waits", "a delayed frame"),
    FaultCase(
        "clock stretched 50 ms",
        _at("stretch_at", 9, 50000),
        "aborts the transfer at the deadline, frees the bus with nine clocks and a stop condition",
        "BOARD_FAULT timeout, then recovered",
        ("timeouts",),
        costs=1,
        is_bus_wide=True,
    ),
    FaultCase(
        "SDA low for 5 clocks",
        ((0.0, "hold_sda", True, 5, 0),),
        "frees the bus with clocks, then repeats the read",
        "nothing, or BOARD_FAULT, then recovered",
        ("retries", "bus_errors", "crc_errors"),
        costs=1,
        is_bus_wide=True,
    ),
    FaultCase(
        "SDA low for 200 clocks",
        ((0.0, "hold_sda", True, 200, 0),),
        "tries to free the bus every 10 ms; reports SDA stuck, then the free bus",
        "LOG and BOARD_FAULT sda_stuck, then recovered",
        ("retries", "bus_errors", "crc_errors", "nacks"),
        costs=20,
        is_bus_wide=True,
    ),
    FaultCase(
        "SCL low for 3 ms",
        ((0.0, "hold_scl", True, 3000, 0),),
        "waits",
        "a delayed frame",
        ("retries", "bus_errors"),
        costs=1,
        is_bus_wide=True,
    ),
    FaultCase(
        "SCL low for 100 ms",
        ((0.0, "hold_scl", True, 100000, 0),),
        "cannot send clocks; reports SCL stuck, checks SCL every 10 ms, reports the free bus",
        "LOG and BOARD_FAULT scl_stuck, then recovered",
        ("timeouts", "bus_errors", "retries", "nacks"),
        costs=20,
        is_bus_wide=True,
    ),
    FaultCase("arbitration lost", _at("arbitration_at", 6), RETRIES, "nothing", COUNTS_RETRY),
    FaultCase("a stray stop", _at("bus_error_at", 6), f"frees the bus, {RETRIES}", "nothing", COUNTS_RETRY),
    FaultCase(
        "bit of the address flipped",
        _at("flip_at", 0, 2),
        f"receives a CRC error or a NACK, because another board or no board responds; {RETRIES}",
        "nothing",
        COUNTS_RETRY,
    ),
    FaultCase(
        "read bit of the address flipped",
        _at("flip_at", 0, 0),
        f"receives bytes FF, CRC error; {RETRIES}",
        "nothing",
        COUNTS_RETRY,
    ),
    FaultCase("bit of a count flipped", _at("flip_at", 12, 6), f"CRC error; {RETRIES}", "nothing", COUNTS_RETRY),
    FaultCase(
        "3000 bytes with a wrong bit",
        ((0.0, "corrupt", True, 3000, 0),),
        "two CRC errors per poll until the fault ends",
        "BOARD_FAULT crc, then recovered",
        ("crc_errors", "retries"),
        costs=60,
    ),
    FaultCase(
        "brown-out in the middle of a frame",
        _at("brown_out_at", 20, 5),
        "receives NACKs until the board has started; detects the restart of its clock, identifies the board, "
        "writes its settings",
        "BOARD_FAULT nack, restarted, recovered; BOARD_INFO",
        ("nacks", "crc_errors", "retries"),
        costs=5,
        ends_s=0.005 + BOOT_S,
    ),
    FaultCase(
        "unplugged, plugged in after 0.5 s",
        ((0.0, "unplug", True, 0, 0), (0.5, "plug", True, 0, 0)),
        ABSENT,
        "BOARD_FAULT nack, recovered; BOARD_INFO",
        ("nacks", "crc_errors", "retries"),
        costs=20,
        ends_s=BOOT_S,
    ),
    FaultCase(
        "a UART bit flipped",
        ((0.0, "up_flip", False, 30, 3),),
        "nothing",
        "one frame is lost and counted",
        costs=1,
        loses_on_wire=True,
        is_bus_wide=True,
    ),
    FaultCase(
        "UART bytes lost",
        ((0.0, "up_drop", False, 30, 4),),
        "nothing",
        "one or two frames are lost and counted",
        costs=1,
        loses_on_wire=True,
        is_bus_wide=True,
    ),
    FaultCase(
        "UART bytes doubled",
        ((0.0, "up_double", False, 30, 4),),
        "nothing",
        "one or two frames are lost and counted",
        costs=1,
        loses_on_wire=True,
        is_bus_wide=True,
    ),
    FaultCase(
        "UART blocked for 30 ms",
        ((0.0, "up_delay", False, 30, 0),),
        "waits if its transmit ring is full",
        "delayed frames",
    ),
    FaultCase(
        "hub busy for 30 ms",
        ((0.0, "hub_stall", False, 30, 0),),
        "continues after the interruption",
        "delayed frames",
        is_bus_wide=True,
        costs=1,
    ),
    FaultCase(
        "brown-out of the hub",
        ((0.0, "hub_restart", False, 0, 0),),
        "restarts: sends HUB_HANDSHAKE, searches for its boards",
        "repeats the handshake, sets the rate, sends START",
        is_bus_wide=True,
        restarts=True,
        costs=4,
    ),
    FaultCase(
        "hub without power for 0.2 s",
        ((0.0, "hub_unplug", False, 0, 0), (0.2, "hub_plug", False, 0, 0)),
        "restarts: sends HUB_HANDSHAKE, searches for its boards",
        "repeats the handshake, sets the rate, sends START",
        is_bus_wide=True,
        restarts=True,
        costs=12,
    ),
    FaultCase(
        "host does not read for 0.5 s",
        ((0.0, "mute_host", False, 1, 0), (0.5, "mute_host", False, 0, 0)),
        "waits; after 100 ms discards whole frames and counts them",
        "the frames of the transmit ring, then gaps that the counters explain",
        ("dropped",),
        is_bus_wide=True,
        costs=20,
    ),
)
