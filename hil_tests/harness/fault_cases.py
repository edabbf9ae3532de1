"""Every fault on the wires: how it is made, and what must come of it (docs/faults-on-the-wires.md is made of this)."""

from collections.abc import Sequence
from dataclasses import dataclass

from hil_tests.harness.rig import Rig
from taxel.skin import Skin

BOOT_S = 0.04
"""From power to the first acknowledge, of the emulated boards."""
STRETCH_LIMIT_US = 5000
"""What the hub lets a slave stretch the clock beside a transfer's nominal time (firmware/hub/schedule.c)."""


@dataclass(frozen=True)
class FaultCase:
    """A fault of one board, the bus, the hub or the UART.

    steps: (seconds since the first, fault, whether it strikes the board under test, value, second value). ends_s: when,
    after the last step (or what that struck), the board acknowledges again. counters: of the hub's counters of that
    board, those that rise. costs: frames of the board that may be missing, at most. is_bus_wide: other boards lose
    frames too. restarts: the hub sends an unrequested HUB_HANDSHAKE. hub, host: what they do and see, in words.
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
        """Make it happen; the time of the last step on the rig's clock."""
        assert rig.faults is not None
        begun = rig.clock.now_s()
        for at_s, fault, is_of_board, value, second in self.steps:
            while rig.clock.now_s() < begun + at_s - 1e-9:
                skin.hub.stream.poll(max(begun + at_s - rig.clock.now_s(), 1e-6))
            rig.faults.inject(fault, address if is_of_board else 0, value, second)
        return rig.clock.now_s()


def _at(fault: str, byte: int, second: float = 0.0) -> tuple[tuple[float, str, bool, float, float], ...]:
    return ((0.0, fault, True, float(byte), second),)


RETRIES = "reads again at once"
COUNTS_RETRY = ("retries",)

CASES = (
    FaultCase("address not acknowledged once", _at("nack_at", 0), RETRIES, "nothing", COUNTS_RETRY),
    FaultCase(
        "a snapshot's byte not acknowledged", _at("nack_at", 9), f"CRC fails; {RETRIES}", "nothing", COUNTS_RETRY
    ),
    FaultCase(
        "address not acknowledged 12 times",
        ((0.0, "nack", True, 12, 0),),
        "after three polls the board is absent; one address byte a cycle; identifies it when it answers",
        "BOARD_FAULT nack, then recovered",
        ("nacks", "retries"),
        costs=12,
    ),
    FaultCase("clock stretched 4 ms", _at("stretch_at", 9, 4000), "waits", "a later frame"),
    FaultCase(
        "clock stretched 50 ms",
        _at("stretch_at", 9, 50000),
        "gives up at its deadline, frees the bus with nine clocks and a stop",
        "BOARD_FAULT timeout, then recovered",
        ("timeouts",),
        costs=1,
        is_bus_wide=True,
    ),
    FaultCase(
        "SDA low for 5 clocks",
        ((0.0, "hold_sda", True, 5, 0),),
        "frees the bus with clocks, then reads again",
        "nothing, or BOARD_FAULT and recovered",
        ("retries", "bus_errors", "crc_errors"),
        costs=1,
        is_bus_wide=True,
    ),
    FaultCase(
        "SDA low for 200 clocks",
        ((0.0, "hold_sda", True, 200, 0),),
        "tries to free the bus every 10 ms, tells SDA stuck, then that it is free",
        "LOG and BOARD_FAULT sda_stuck, then recovered",
        ("retries", "bus_errors", "crc_errors", "nacks"),
        costs=20,
        is_bus_wide=True,
    ),
    FaultCase(
        "SCL low for 3 ms",
        ((0.0, "hold_scl", True, 3000, 0),),
        "waits",
        "a later frame",
        ("retries", "bus_errors"),
        costs=1,
        is_bus_wide=True,
    ),
    FaultCase(
        "SCL low for 100 ms",
        ((0.0, "hold_scl", True, 100000, 0),),
        "no clock can be given: tells SCL stuck, looks every 10 ms, tells that it is free",
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
        f"another board, or none, answers: CRC or NACK; {RETRIES}",
        "nothing",
        COUNTS_RETRY,
    ),
    FaultCase(
        "read bit of the address flipped",
        _at("flip_at", 0, 0),
        f"reads FF: CRC fails; {RETRIES}",
        "nothing",
        COUNTS_RETRY,
    ),
    FaultCase("bit of a count flipped", _at("flip_at", 12, 6), f"CRC fails; {RETRIES}", "nothing", COUNTS_RETRY),
    FaultCase(
        "3000 bytes with a wrong bit",
        ((0.0, "corrupt", True, 3000, 0),),
        "CRC fails twice a poll, for as long as it lasts",
        "BOARD_FAULT crc, then recovered",
        ("crc_errors", "retries"),
        costs=60,
    ),
    FaultCase(
        "brown-out in the middle of a frame",
        _at("brown_out_at", 20, 5),
        "NACK until the board has booted; sees that its clock began anew, identifies it, writes its settings",
        "BOARD_FAULT nack, restarted, recovered; BOARD_INFO",
        ("nacks", "crc_errors", "retries"),
        costs=5,
        ends_s=0.005 + BOOT_S,
    ),
    FaultCase(
        "unplugged, plugged half a second later",
        ((0.0, "unplug", True, 0, 0), (0.5, "plug", True, 0, 0)),
        "absent after three polls; one address byte a cycle; identifies it when it answers",
        "BOARD_FAULT nack, recovered; BOARD_INFO",
        ("nacks", "crc_errors", "retries"),
        costs=20,
        ends_s=BOOT_S,
    ),
    FaultCase(
        "a UART bit flipped",
        ((0.0, "up_flip", False, 30, 3),),
        "nothing",
        "one frame lost, counted",
        costs=1,
        loses_on_wire=True,
        is_bus_wide=True,
    ),
    FaultCase(
        "UART bytes lost",
        ((0.0, "up_drop", False, 30, 4),),
        "nothing",
        "one or two frames lost, counted",
        costs=1,
        loses_on_wire=True,
        is_bus_wide=True,
    ),
    FaultCase(
        "UART bytes doubled",
        ((0.0, "up_double", False, 30, 4),),
        "nothing",
        "one or two frames lost, counted",
        costs=1,
        loses_on_wire=True,
        is_bus_wide=True,
    ),
    FaultCase("UART held for 30 ms", ((0.0, "up_delay", False, 30, 0),), "waits for room if it must", "late frames"),
    FaultCase(
        "hub busy for 30 ms",
        ((0.0, "hub_stall", False, 30, 0),),
        "goes on where it was",
        "late frames",
        is_bus_wide=True,
        costs=1,
    ),
    FaultCase(
        "hub browns out",
        ((0.0, "hub_restart", False, 0, 0),),
        "starts anew: HUB_HANDSHAKE, finds its boards",
        "repeats the handshake, sets the rate, sends START",
        is_bus_wide=True,
        restarts=True,
        costs=4,
    ),
    FaultCase(
        "hub without power for 0.2 s",
        ((0.0, "hub_unplug", False, 0, 0), (0.2, "hub_plug", False, 0, 0)),
        "starts anew: HUB_HANDSHAKE, finds its boards",
        "repeats the handshake, sets the rate, sends START",
        is_bus_wide=True,
        restarts=True,
        costs=12,
    ),
    FaultCase(
        "host does not read for half a second",
        ((0.0, "mute_host", False, 1, 0), (0.5, "mute_host", False, 0, 0)),
        "holds back, after 100 ms drops whole frames and counts them",
        "what was kept, then gaps that its counters explain",
        ("dropped",),
        is_bus_wide=True,
        costs=20,
    ),
)
