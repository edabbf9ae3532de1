"""Commands, faults and time in any order, on an emulated skin with known counts: what must hold after every step."""

from typing import Final

import numpy as np
from hypothesis import note
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from hil_tests.harness.free_host import FreeHost
from hil_tests.harness.watching import LARGEST_BASE, OUTCOMES, STEP_COUNTS
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import FaultError, VirtualMemoryLink, VirtualWorld
from taxel.stream import TaxelFrame
from taxel_protocol import Command

HAND: Final = load_hand("rig4")
ADDRESSES: Final = [board.address for board in HAND.boards]
TAXELS: Final = sum(board.kind.taxel_count for board in HAND.boards)

AT_ONCE: Final = ("unplug", "plug", "restart", "hold_sda", "hold_scl", "stretch", "corrupt", "nack")
AT_A_BYTE: Final = ("nack_at", "flip_at", "stretch_at", "brown_out_at", "arbitration_at", "bus_error_at")
ON_THE_UART: Final = ("up_flip", "up_drop", "up_double", "down_flip", "down_drop", "down_double")
OF_THE_HUB: Final = ("hub_restart", "hub_unplug", "hub_plug")
DELAYS: Final = ("up_delay", "down_delay", "hub_stall")

addresses = st.sampled_from(ADDRESSES)
WAITING_BYTES: Final = 1000
SETTLING_S: Final = 1.2
"""All faults over: hold lines are let go, a lost board is found within 28 cycles, delayed bytes arrive."""


class SkinMachine(RuleBasedStateMachine):
    """One skin of four boards. Invariants: no count that was never shown; each poll has one outcome; frames on the wire
    add up; and when all is well again, every board streams.
    """

    def __init__(self) -> None:
        super().__init__()
        self.world: VirtualWorld | None = None

    @initialize(seed=st.integers(0, 2**16), clocks=st.sampled_from((0.0, 2e4)), baud=st.sampled_from((1e6, 1.15e5)))
    def power_up(self, seed: int, clocks: float, baud: float) -> None:
        settings = WorldSettings(seed=seed, clock_spread_ppm=clocks, baud=baud, usb_latency_ms=1.0)
        self.world = VirtualWorld(format_world(HAND, settings), counts=True)
        self.host = FreeHost(VirtualMemoryLink(self.world, baud))
        self.base = np.random.default_rng(seed).integers(1, STEP_COUNTS, TAXELS) + LARGEST_BASE
        self.step = 0
        self.is_wire_hurt = False  # since then frames may be lost between hub and host
        self.streams_anew_s = 0.0
        self.world.press(self.base)
        self.world.run(0.06)
        self.begin()

    def begin(self) -> None:
        assert self.world is not None
        self.host.handshake()
        self.world.run(0.02)
        self.host.command(Command.START)
        self.world.run(0.1)

    @rule(milliseconds=st.sampled_from((0.1, 1.0, 5.0, 13.0, 50.0, 200.0)))
    def let_time_pass(self, milliseconds: float) -> None:
        assert self.world is not None
        self.world.run(milliseconds / 1e3)

    @rule()
    def press(self) -> None:
        assert self.world is not None
        self.step += 1
        self.world.press(self.base + STEP_COUNTS * self.step)

    @rule(
        fault=st.sampled_from(AT_ONCE),
        address=addresses,
        value=st.sampled_from((0.0, 1.0, 2.0, 9.0, 20.0, 300.0, 6000.0, 20000.0)),
    )
    def strike_a_board(self, fault: str, address: int, value: float) -> None:
        self._inject(fault, address, value)

    @rule(
        fault=st.sampled_from(AT_A_BYTE),
        address=st.one_of(addresses, st.just(0)),
        byte=st.integers(0, 130),
        second=st.integers(0, 40),
    )
    def strike_a_byte(self, fault: str, address: int, byte: int, second: int) -> None:
        self._inject(fault, address, byte, second)

    @rule(fault=st.sampled_from(ON_THE_UART), after=st.integers(0, 400), how=st.integers(0, 9))
    def strike_the_uart(self, fault: str, after: int, how: int) -> None:
        self.is_wire_hurt = self.is_wire_hurt or fault.startswith("up")
        self._inject(fault, 0, after, how)

    @rule(fault=st.sampled_from(OF_THE_HUB))
    def strike_the_hub(self, fault: str) -> None:
        self._inject(fault)

    @rule(fault=st.sampled_from(DELAYS), milliseconds=st.integers(1, 150))
    def hold_up(self, fault: str, milliseconds: int) -> None:
        self._inject(fault, 0, milliseconds)

    @rule(muted=st.booleans())
    def stop_reading(self, muted: bool) -> None:
        self._inject("mute_host", 0, float(muted))

    @rule(
        command=st.one_of(st.sampled_from([c for c in Command if c is not Command.REBOOT]), st.integers(0, 255)),
        arguments=st.binary(max_size=66),
        tag=st.integers(1, 255),
    )
    def send_any_command(self, command: int, arguments: bytes, tag: int) -> None:
        if command != Command.I2C_TRANSFER:  # a board told to stop stays stopped: `transfer` does what is harmless
            self.host.command(int(command), arguments, tag)

    @rule(
        address=st.one_of(addresses, st.integers(0, 127)),
        register=st.sampled_from((0, 0x40, 0x60, 0x80, 0xFF)),
        size=st.integers(0, 64),
    )
    def transfer(self, address: int, register: int, size: int) -> None:
        self.host.command(Command.I2C_TRANSFER, bytes([address, size, register]))

    @rule(address=addresses, register=st.integers(0, 255), size=st.integers(1, 80))
    def read_from_the_bench(self, address: int, register: int, size: int) -> None:
        assert self.world is not None
        self.world.transfer(address, bytes([register]), size, 0.05)

    @rule(data=st.binary(min_size=1, max_size=80))
    def send_garbage(self, data: bytes) -> None:
        assert self.world is not None
        self.world.send(b"\x00" + data + b"\x00")

    @rule()
    def handshake_and_start(self) -> None:
        self.begin()

    def _inject(self, fault: str, address: int = 0, value: float = 0.0, second: float = 0.0) -> None:
        assert self.world is not None
        try:
            self.world.inject(fault, address, value, second)
        except FaultError:
            note(f"{fault}: too many wait already")

    @invariant()
    def every_count_was_shown(self) -> None:
        if self.world is not None:
            for frame in self.host.take():
                self._check(frame)

    def _check(self, frame: TaxelFrame) -> None:
        base = self.base[HAND.get_slice(frame.address)]
        difference = frame.raw_counts.astype(int) - base
        assert not (difference % STEP_COUNTS).any(), f"board 0x{frame.address:02X}: counts that were never shown"
        steps = difference // STEP_COUNTS
        assert 0 <= steps.min() <= steps.max() <= self.step, f"board 0x{frame.address:02X}: counts of another time"
        assert not (np.diff(steps) < 0).any(), f"board 0x{frame.address:02X}: a scan that goes back in time"

    @invariant()
    def every_poll_has_one_outcome(self) -> None:
        if self.world is None:
            return
        for address, fields in self.host.board_status.items():
            in_flight = fields["polls"] - sum(fields[name] for name in OUTCOMES)
            assert in_flight in {0, 1}, f"board 0x{address:02X}: {fields}"

    @invariant()
    def nothing_is_lost_on_a_sound_wire(self) -> None:
        if self.world is not None and not self.is_wire_hurt:
            assert self.host.stream.losses.lost_on_wire == 0

    def teardown(self) -> None:
        """All faults end; then every board must stream again."""
        if self.world is None:
            return
        try:
            self._recover()
        finally:
            self.world.close()

    def _recover(self) -> None:
        assert self.world is not None
        for address in ADDRESSES:
            for fault in ("plug", "corrupt", "nack", "hold_sda", "hold_scl", "stretch"):
                self._inject(fault, address)
        self._inject("mute_host", 0, 0)
        self._inject("hub_plug")
        self.world.run(SETTLING_S)
        self.world.send(bytes(WAITING_BYTES))  # what waits for its byte on the way down strikes these
        self.world.run(0.1)
        self.begin()
        self.host.command(Command.SET_RATE, bytes(4))
        self.host.take()
        self.world.run(0.6)  # faults that still wait for their byte strike now
        self.begin()
        self.world.run(1.2)
        self.host.take()
        self.world.run(0.4)
        frames = self.host.take()
        for frame in frames:
            self._check(frame)
        assert {frame.address for frame in frames} == set(ADDRESSES), "not every board streams when all is well again"
