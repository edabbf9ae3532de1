"""Flow control of the hub: many commands in flight without loss, and flashing at the speed of the bus."""

import itertools
import random

import pytest

from taxel.errors import TaxelError
from taxel.link.virtual import VirtualMemoryLink
from taxel_protocol.limits import REGISTER_SETTINGS, WHO_AM_I
from taxel_tools.application import read_identity
from taxel_tools.errors import LostError, NackError
from taxel_tools.firmware_update import update_board
from taxel_tools.hub_queue import FLOW_CONTROL_WINDOW, RING_WINDOW
from taxel_tools.procedure import Burst, Transfer
from taxel_tools.scheduler import run, run_all
from taxel_tools.wires import HubWire

BOTH_WAYS = ("usb_latency_down_ms 16",)
FLOW_CONTROL = (*BOTH_WAYS, "flow_control 1")
ABSENT = 0x60
"""Address without a board."""
WHO_AM_I_REPLY = bytes([WHO_AM_I])
SECOND_SLOT = 142 * 128
"""Offset of the second image slot in the flash of a board: 142 rows of 128 bytes."""


def make_long_transfer(address: int) -> Transfer:
    """Create a transfer that writes 12 bytes (register number and 11 zeros) and reads the 12 bytes of the settings."""
    return Transfer(address, bytes([REGISTER_SETTINGS]) + bytes(11), 12)


def make_short_transfer(address: int) -> Transfer:
    """Create a transfer that reads the first register, whose value is always WHO_AM_I."""
    return Transfer(address, b"\x00", 1)


def update_all(wire, firmware, addresses, report=lambda progress: None):
    """Update the boards concurrently and return their results by address."""
    return run_all(wire, {address: update_board(address, firmware, wire.now_s, report) for address in addresses})


def read_settings_repeatedly(address: int, times: int):
    for _ in range(times):
        yield make_long_transfer(address)


def run_burst(*transfers: Transfer):
    """Run transfers as one burst of a procedure; return the outcomes."""
    burst = Burst(transfers)
    yield burst
    return burst.outcomes


def test_17_boards_of_12_kib_are_flashed_within_15_s_with_16_ms_latency_each_way(worlds, hub, make_firmware):
    """I2C runs at 400 kHz and the UART at 1 Mbaud.

    An image of 12 KiB has 96 rows of 128 bytes, and each board computes the sum of every row.
    """
    world = worlds(*FLOW_CONTROL, hand="allegro", usb_latency_ms=16.0)
    wire = hub(world)
    start_s = world.now_s
    results = update_all(wire, make_firmware(size=12288), wire.scan())
    print(f"17 boards of 12 KiB through the hub, 16 ms each way, flow control: {world.now_s - start_s:.2f} s")
    assert [(r.rows_written, r.after) for r in results.values()] == [(96, (1, 2, 3))] * 17
    assert world.now_s - start_s < 15.0
    assert not wire.hub.logs


def test_only_a_link_with_flow_control_gets_a_window_larger_than_the_ring_buffer(worlds, hub):
    assert hub(worlds(boards=1)).hub.window == RING_WINDOW
    assert hub(worlds(*FLOW_CONTROL, boards=1)).hub.window == FLOW_CONTROL_WINDOW


@pytest.mark.parametrize("lines", [BOTH_WAYS, FLOW_CONTROL])
def test_no_byte_is_lost_with_many_commands_in_flight(worlds, hub, lines):
    world = worlds(*lines, hand="allegro")
    wire = hub(world)
    results = run_all(wire, {address: read_settings_repeatedly(address, 30) for address in wire.scan()})
    assert not any(isinstance(result, TaxelError) for result in results.values())
    assert not wire.hub.logs


def test_a_hub_whose_processor_stalls_loses_no_command(worlds, hub):
    world = worlds("flow_control 1", hand="allegro")
    wire = hub(world)
    addresses = wire.scan()
    procedures = {address: read_settings_repeatedly(address, 30) for address in addresses}

    def stall():
        for _ in range(5):
            world.inject("hub_stall", 0, 15)  # milliseconds
            yield Transfer(addresses[0], bytes([REGISTER_SETTINGS]), 12)

    results = run_all(wire, procedures | {0: stall()})
    assert not any(isinstance(result, TaxelError) for result in results.values())
    assert not wire.hub.logs


def test_an_unconnected_rts_line_reduces_the_window_and_updates_succeed(worlds, make_firmware):
    """The link was opened with flow control (rtscts=1), but the RTS line of the hub is not connected.

    The receive ring of the hub then overflows, and the hub reports lost bytes in its log. After this report the host
    reduces its window, the limit of command bytes without a reply, from `FLOW_CONTROL_WINDOW` to `RING_WINDOW`.
    """
    world = worlds(*BOTH_WAYS, boards=4)
    link = VirtualMemoryLink(world)
    link.has_flow_control = True
    wire = HubWire(link)
    assert wire.hub.window == FLOW_CONTROL_WINDOW
    run_all(wire, {address: read_settings_repeatedly(address, 30) for address in range(0x50, 0x54)})
    assert wire.hub.window == FLOW_CONTROL_WINDOW, (
        "four boards alone have no more bytes in flight than the ring buffer holds"
    )
    run_all(wire, {i: run_burst(*(Transfer(0x50 + i % 4, b"\x00", 60),) * 3) for i in range(40)})
    assert "bytes lost" in wire.hub.logs
    assert wire.hub.window == RING_WINDOW
    results = update_all(wire, make_firmware(), range(0x50, 0x54))
    assert {result.after for result in results.values()} == {(1, 2, 3)}


def test_a_restarted_hub_needs_one_handshake_for_all_pending_commands(worlds, hub, make_firmware):
    world = worlds(*FLOW_CONTROL, hand="allegro")
    wire = hub(world)
    handshake_times = []
    perform_handshake = wire.hub.handshake
    wire.hub.handshake = lambda: handshake_times.append(world.now_s) or perform_handshake()
    restarts = iter([True])

    def disturb(progress) -> None:
        """Restart the hub once, while the fourth row is written."""
        if progress.stage == "writing" and progress.done == 3 and next(restarts, False):
            world.inject("hub_restart")

    results = update_all(wire, make_firmware(), wire.scan(), disturb)
    assert {result.after for result in results.values()} == {(1, 2, 3)}
    assert len(handshake_times) <= 2


@pytest.mark.parametrize("fault", ["up_flip", "up_drop", "down_flip", "down_drop"])
def test_updates_succeed_despite_damaged_and_lost_bytes_on_the_uart(worlds, hub, make_firmware, fault):
    seed = 60
    print(f"seed {seed}")
    generator = random.Random(seed)
    world = worlds(*FLOW_CONTROL, hand="allegro")
    wire = hub(world)

    def disturb(progress) -> None:
        """Inject a fault at a random one of the next 200 bytes, in every third row."""
        if progress.stage == "writing" and progress.done % 3 == 1:
            world.inject(fault, 0, generator.randrange(200), 1)

    firmware = make_firmware()
    results = update_all(wire, firmware, wire.scan(), disturb)
    assert {result.after for result in results.values()} == {(1, 2, 3)}
    for address in results:
        assert world.read_flash(address).data[SECOND_SLOT:].startswith(firmware.select_image_for(1).data)


def test_a_burst_returns_every_outcome_in_order(worlds, open_wire):
    wire = open_wire(worlds(boards=2))
    reads = (make_short_transfer(0x50), Transfer(0x50, b"\x06", 1), Transfer(0x50, b"\x01", 1))
    assert run(wire, run_burst(*reads)) == [WHO_AM_I_REPLY, b"\x50", b"\x02"]


def test_an_adapter_ends_a_burst_with_the_first_failure(worlds, adapter):
    wire = adapter(worlds(boards=1))
    outcomes = run(wire, run_burst(*(make_short_transfer(address) for address in (0x50, ABSENT, 0x50))))
    assert outcomes[0] == WHO_AM_I_REPLY
    assert [type(outcome) for outcome in outcomes] == [bytes, NackError]


def test_the_hub_runs_every_transfer_of_a_burst(worlds, hub):
    wire = hub(worlds(boards=1))
    outcomes = run(wire, run_burst(*(make_short_transfer(address) for address in (0x50, ABSENT, 0x50))))
    assert [type(outcome) for outcome in outcomes] == [bytes, NackError, bytes]


def test_a_burst_reports_a_lost_command(worlds, hub):
    world = worlds(boards=2)
    wire = hub(world)

    def lose_command(address):
        world.inject("down_drop", 0, 2, 1)  # the third byte from the host to the hub is lost
        return (yield from run_burst(*(make_short_transfer(address) for _ in range(3))))

    outcomes = run_all(wire, {0: lose_command(0x50), 1: read_identity(0x51)})[0]
    assert [type(outcome) for outcome in outcomes].count(LostError) == 1


def test_transfers_with_one_board_are_separated_by_transfers_with_others(worlds, hub):
    """A bootloader does not acknowledge a packet while it processes the previous one."""
    wire = hub(worlds(*FLOW_CONTROL, boards=4))
    sent = []
    send_frame = wire.hub._send_frame

    def record_transfer(number, transfer, *arguments):
        if number:  # FLUSH, which is no transfer, has the number 0
            sent.append((transfer.address, len(wire.hub._sent)))
        send_frame(number, transfer, *arguments)

    wire.hub._send_frame = record_transfer
    transfers = (make_long_transfer(0x50), make_short_transfer(0x50))
    run(wire, run_burst(*transfers))
    assert [address for address, _ in sent] == [0x50, 0x50]  # with one board there is no other transfer to put between
    sent.clear()
    bursts = {address: run_burst(*(make_long_transfer(address),) * 3) for address in range(0x50, 0x54)}
    run_all(wire, bursts)
    addresses = [address for address, _ in sent]
    assert all(first != second for first, second in itertools.pairwise(addresses))
    # More transfers than boards are unanswered: the second and third of each board are sent before the answers.
    assert sent[-1][1] > 4
