"""Stateful test: commands, faults and time in random order on an emulated skin with known raw counts.

Invariants are checked after each step.
"""

from typing import Final

import numpy as np
from hypothesis import note
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from hil_tests.harness.frame_checks import OUTCOMES, STEP_COUNTS, sample_base_counts
from hil_tests.harness.non_blocking_host import NonBlockingHost
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import FaultError, VirtualMemoryLink, VirtualWorld
from taxel.stream import TaxelFrame
from taxel_protocol import Command

HAND: Final = load_hand("rig4")
ADDRESSES: Final = [board.address for board in HAND.boards]
TAXELS: Final = sum(board.kind.taxel_count for board in HAND.boards)

BOARD_FAULTS: Final = ("unplug", "plug", "restart", "hold_sda", "hold_scl", "stretch", "corrupt", "nack")
BYTE_FAULTS: Final = ("nack_at", "flip_at", "stretch_at", "brown_out_at", "arbitration_at", "bus_error_at")
UART_FAULTS: Final = ("up_flip", "up_drop", "up_double", "down_flip", "down_drop", "down_double")
HUB_FAULTS: Final = ("hub_restart", "hub_unplug", "hub_plug")
DELAYS: Final = ("up_delay", "down_delay", "hub_stall")
"""Faults that delay the UART, or the hub, for a number of milliseconds."""

addresses = st.sampled_from(ADDRESSES)
FLUSH_BYTES: Final = 1000
"""Bytes to the hub that trigger all armed faults of the UART."""
SETTLING_S: Final = 1.2
"""Time in which all faults end, seconds: held lines are released, a lost board is identified within 28 cycles, delayed
bytes arrive.
"""


class SkinMachine(RuleBasedStateMachine):
    """A skin of four boards.

    Invariants: all received counts were set by the test; each poll has one outcome; no frame is lost on the UART
    without a fault of the UART; after the end of all faults, all boards stream.
    """

    def __init__(self) -> None:
        super().__init__()
        self.world: VirtualWorld | None = None

    @initialize(seed=st.integers(0, 2**16), clocks=st.sampled_from((0.0, 2e4)), baud=st.sampled_from((1e6, 1.15e5)))
    def power_up(self, seed: int, clocks: float, baud: float) -> None:
        """Initial step of the state machine: create the emulated skin, set known raw counts, and start the stream.

        seed: seed of noise and counts. clocks: spread of the clock errors of the boards, in ppm. baud: UART rate, bits
        per second. `world.run` takes seconds of virtual time; the boards start in the first 0.06 s.
        """
        settings = WorldSettings(seed=seed, clock_spread_ppm=clocks, baud=baud, usb_latency_ms=1.0)
        self.world = VirtualWorld(format_world(HAND, settings), counts=True)
        self.host = NonBlockingHost(VirtualMemoryLink(self.world, baud))
        # Each step of `change_counts` adds STEP_COUNTS to the counts of all taxels.
        self.base = sample_base_counts(TAXELS, seed)
        self.step = 0
        self.has_uart_fault = False  # frames may be lost between hub and host
        self.world.set_stimulus(self.base)
        self.world.run(0.06)
        self.start_stream()

    def start_stream(self) -> None:
        """Send a handshake to the emulated hub and the command that starts the stream of frames."""
        assert self.world is not None
        self.host.send_handshake()
        self.world.run(0.02)
        self.host.send_command(Command.START)
        self.world.run(0.1)

    @rule(milliseconds=st.sampled_from((0.1, 1.0, 5.0, 13.0, 50.0, 200.0)))
    def let_time_pass(self, milliseconds: float) -> None:
        """Rule of the state machine: let virtual time pass."""
        assert self.world is not None
        self.world.run(milliseconds / 1e3)

    @rule()
    def change_counts(self) -> None:
        """Rule of the state machine: increase the raw count of every taxel by the same known step."""
        assert self.world is not None
        self.step += 1
        self.world.set_stimulus(self.base + STEP_COUNTS * self.step)

    @rule(
        fault=st.sampled_from(BOARD_FAULTS),
        address=addresses,
        value=st.sampled_from((0.0, 1.0, 2.0, 9.0, 20.0, 300.0, 6000.0, 20000.0)),
    )
    def inject_board_fault(self, fault: str, address: int, value: float) -> None:
        self._inject(fault, address, value)

    @rule(
        fault=st.sampled_from(BYTE_FAULTS),
        address=st.one_of(addresses, st.just(0)),
        byte=st.integers(0, 130),
        second_value=st.integers(0, 40),
    )
    def inject_byte_fault(self, fault: str, address: int, byte: int, second_value: int) -> None:
        self._inject(fault, address, byte, second_value)

    @rule(fault=st.sampled_from(UART_FAULTS), n_bytes=st.integers(0, 400), value=st.integers(0, 9))
    def inject_uart_fault(self, fault: str, n_bytes: int, value: int) -> None:
        """Rule of the state machine: inject a fault of the UART between hub and host.

        fault: name of the fault, which begins with "up" if the fault damages bytes to the host. n_bytes: number of
        bytes before the fault. value: number of the flipped bit, or number of the bytes that are lost or doubled.
        """
        self.has_uart_fault = self.has_uart_fault or fault.startswith("up")
        self._inject(fault, 0, n_bytes, value)

    @rule(fault=st.sampled_from(HUB_FAULTS))
    def inject_hub_fault(self, fault: str) -> None:
        self._inject(fault)

    @rule(fault=st.sampled_from(DELAYS), milliseconds=st.integers(1, 150))
    def inject_delay(self, fault: str, milliseconds: int) -> None:
        self._inject(fault, 0, milliseconds)

    @rule(is_muted=st.booleans())
    def stop_reading(self, is_muted: bool) -> None:
        self._inject("mute_host", 0, float(is_muted))

    @rule(
        command=st.one_of(st.sampled_from([c for c in Command if c is not Command.REBOOT]), st.integers(0, 255)),
        arguments=st.binary(max_size=66),
        tag=st.integers(1, 255),
    )
    def send_any_command(self, command: int, arguments: bytes, tag: int) -> None:
        """Rule of the state machine: send a command with arbitrary arguments to the hub."""
        if command != Command.I2C_TRANSFER:  # an arbitrary write could stop a board for good; see `transfer`
            self.host.send_command(int(command), arguments, tag)

    @rule(
        address=st.one_of(addresses, st.integers(0, 127)),
        register=st.sampled_from((0, 0x40, 0x60, 0x80, 0xFF)),
        size=st.integers(0, 64),
    )
    def transfer(self, address: int, register: int, size: int) -> None:
        self.host.send_command(Command.I2C_TRANSFER, bytes([address, size, register]))

    @rule(address=addresses, register=st.integers(0, 255), size=st.integers(1, 80))
    def read_as_second_master(self, address: int, register: int, size: int) -> None:
        """Rule of the state machine: read a register of a board as another master of the I2C bus, while the hub
        polls.
        """
        assert self.world is not None
        self.world.transfer(address, bytes([register]), size, 0.05)

    @rule(data=st.binary(min_size=1, max_size=80))
    def send_garbage(self, data: bytes) -> None:
        """Rule of the state machine: send random bytes to the hub in place of a frame."""
        assert self.world is not None
        self.world.send(b"\x00" + data + b"\x00")

    @rule()
    def repeat_handshake_and_start(self) -> None:
        self.start_stream()

    def _inject(self, fault: str, address: int = 0, value: float = 0.0, second_value: float = 0.0) -> None:
        """Inject a fault of the emulator by name. A fault beyond the capacity of the emulator's queue is noted and
        ignored.

        address: board with the fault; 0 for faults of the hub. value, second_value: parameters of the fault.
        """
        assert self.world is not None
        try:
            self.world.inject(fault, address, value, second_value)
        except FaultError:
            note(f"{fault}: the queue of armed faults is full")

    @invariant()
    def received_counts_were_set(self) -> None:
        """Invariant of the state machine: received frames contain only raw counts that have been set on the
        emulated taxels.
        """
        if self.world is not None:
            for frame in self.host.read_frames():
                self._check_frame(frame)

    def _check_frame(self, frame: TaxelFrame) -> None:
        """Check that a frame contains raw counts that were set, that are not from the future, and that are scanned
        in order.

        Counts that were set are the base count of the taxel plus a multiple of `STEP_COUNTS`; the multiple is the
        number of the step, from which the time of the count follows.
        """
        base = self.base[HAND.get_slice(frame.address)]
        difference = frame.raw_counts.astype(int) - base
        assert not (difference % STEP_COUNTS).any(), f"board 0x{frame.address:02X}: counts that were never set"
        steps = difference // STEP_COUNTS
        assert 0 <= steps.min() <= steps.max() <= self.step, f"board 0x{frame.address:02X}: counts of another time"
        assert not (np.diff(steps) < 0).any(), f"board 0x{frame.address:02X}: later taxels have older counts"

    @invariant()
    def every_poll_has_one_outcome(self) -> None:
        """Invariant of the state machine: each finished poll of a board has been counted as success or as one kind
        of failure.
        """
        if self.world is None:
            return
        for address, fields in self.host.board_status.items():
            in_progress = fields["polls"] - sum(fields[name] for name in OUTCOMES)
            assert in_progress in {0, 1}, f"board 0x{address:02X}: {fields}"

    @invariant()
    def no_frame_is_lost_on_a_fault_free_uart(self) -> None:
        """Invariant of the state machine: the host misses no frame that the hub has sent, unless a UART fault was
        injected.
        """
        if self.world is not None and not self.has_uart_fault:
            assert self.host.stream.losses.lost_on_wire == 0

    def teardown(self) -> None:
        """End a random sequence: end all faults; then all boards must stream again."""
        if self.world is None:
            return
        try:
            self._recover()
        finally:
            self.world.close()

    def _recover(self) -> None:
        """End all injected faults, and check that all boards stream with correct counts afterwards."""
        assert self.world is not None
        for address in ADDRESSES:  # the parameter 0 (default of `_inject`) ends a fault
            for fault in ("plug", "corrupt", "nack", "hold_sda", "hold_scl", "stretch"):
                self._inject(fault, address)
        self._inject("mute_host", 0, 0)
        self._inject("hub_plug")
        self.world.run(SETTLING_S)
        self.world.send(bytes(FLUSH_BYTES))  # armed faults of bytes to the hub take effect on these bytes
        self.world.run(0.1)
        self.start_stream()
        self.host.send_command(Command.SET_RATE, bytes(4))  # period 0: as fast as the bus allows
        self.host.read_frames()
        self.world.run(0.6)  # armed faults of bytes from the hub take effect on these frames
        self.start_stream()
        self.world.run(1.2)
        self.host.read_frames()
        self.world.run(0.4)
        frames = self.host.read_frames()
        for frame in frames:
            self._check_frame(frame)
        assert {frame.address for frame in frames} == set(ADDRESSES), "not all boards stream after all faults"
