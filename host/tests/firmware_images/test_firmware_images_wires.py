"""The images on their wires, executed in Unicorn: packets, snapshots, frames."""

import tomllib
from collections.abc import Callable

import numpy as np
import pytest

from taxel.hand import BoardKind, load_hand
from taxel_protocol.bootloader import BOOT_PACKET_OVERHEAD, BootCommand, BootDevice, BootStatus, Info
from taxel_protocol.bootloader_packets import build_packet, parse_packet
from taxel_protocol.framing import ReferenceDecoder, crc32, encode_frame
from taxel_protocol.layout import unpack
from taxel_protocol.limits import BOOTLOADER_KEY
from taxel_protocol.names import BoardCommand, BoardErrorFlag, Command, FrameType, ResetCause
from taxel_protocol.registers import Identity, Status

pytest.importorskip("unicorn", reason="unicorn is not installed: pip install unicorn==2.1.4")

from host.tests.firmware_images.conftest import NONE, PORT, make_metadata
from host.tests.firmware_images.psoc_front_end import FrontEnd, simulate_count
from host.tests.firmware_images.psoc_part import POWER_ON, SLICE, SOFTWARE, SYSREQ, Part, read_metadata
from host.tests.firmware_images.psoc_wires import (
    BUS_ERROR,
    INTR_S,
    MasterBus,
    SlaveBus,
    Uart,
)

DEFAULT_ADDRESS, ADDRESS = 0x77, 0x2A
"""I2C addresses of a board without and with a configuration."""
HANDOVER = 0x80
"""Offset in RAM of the word that requests to stay in the bootloader after a reset."""
PORT_4_FUNCTIONS = 0x40010010
"""Register HSIOM_PORT_SEL4: four bits for the function of each pin of port 4."""
I2C_PINS = 0xEE
"""Functions of P4.0 (SCL) and P4.1 (SDA): the I2C block."""
CAPACITOR_PIN = 6 << 8
"""Function of P4.2, the integration capacitor: analog bus A of the converter."""
SCL_LEVEL, SDA_LEVEL = 1 << 0, 1 << 1
"""Bits of the two bus lines in the data registers of port 4."""
LOAD_LATCH, WRITE_ROW, PROGRAM_ROW = 4, 5, 6
"""System calls of the flash controller."""
RTS_PORT, BUS_PORT = 0x40040000, 0x40040400
CONFIRMED_A = make_metadata(confirmed=0, pending=NONE, tries=(3, 3))
ON_TRIAL_A = make_metadata(confirmed=NONE, pending=0, tries=(3, 3))
IDAC = bytes([0, 40, 0, 50]) + bytes(12)
"""Currents of the 16 RX lines; 0 selects IDAC_DEFAULT."""
IDAC_DEFAULT, PERIOD = 16, 160 * 40
CYCLES_PER_US = 48
INFO_PACKET_SIZE = BOOT_PACKET_OVERHEAD + Info.sizeof()
"""Bytes of the reply to GET_INFO."""
SNAPSHOT_OVERHEAD = 10
"""Bytes of a snapshot besides the counts: a header of 6 bytes and a CRC of 4 bytes."""
STATUS, COMMAND, SNAPSHOT = 0x40, 0x70, 0x80
FINGERTIP = next(board.kind for board in load_hand("allegro").boards if board.kind.name == "fingertip")
CONVERSIONS_BEFORE_CONFIRMATION = 12 * FINGERTIP.taxel_count
"""Conversions of twelve scans; an image on trial confirms itself after ten scans and a read."""
CONFIGURATION = bytes([1, ADDRESS, FINGERTIP.code, 0]) + b"0007".ljust(16, b"\0") + IDAC


def create_front_end(part: Part) -> FrontEnd:
    """Create a front end at the pins of pins.toml."""
    pins = tomllib.loads((PORT / "pins.toml").read_text())["sensor"]
    tx, rx = ([(int(name[1]), int(name[3])) for name in pins[key]] for key in ("tx", "rx"))
    return FrontEnd(part, tx, rx)


def compute_expected_counts(kind: BoardKind) -> list[int]:
    """Compute the raw counts of a snapshot of the simulated front end."""
    return [PERIOD - simulate_count(int(tx), int(rx)) for tx, rx in zip(kind.tx, kind.rx, strict=True)]


def send_request(part: Part, bus: SlaveBus, command: BootCommand, data: bytes = b"") -> bytes:
    """Send a packet and return the data of the response, whose status must be OK."""
    packet = build_packet(command, data)
    assert bus.write(DEFAULT_ADDRESS, packet) == 1 + len(packet)
    part.run()
    response = bus.read(DEFAULT_ADDRESS, 64)
    while response == b"\xff" * 64 or response is None:
        part.run()
        response = bus.read(DEFAULT_ADDRESS, 64)
    status, reply = parse_packet(response)
    assert status == BootStatus.OK
    return reply


def run_until_enabled(part: Part, wires: SlaveBus | Uart) -> None:
    """Run until the firmware has enabled the serial block of the wires and at least one interrupt, and can receive."""
    part.run_until(lambda: wires.is_enabled and part.enabled != 0)


@pytest.fixture
def listening_board(flash_with) -> tuple[Part, SlaveBus]:
    """A board without an image, running its bootloader."""
    part = Part(POWER_ON, flash_with("board", ""))
    bus = SlaveBus(part)
    run_until_enabled(part, bus)
    return part, bus


@pytest.fixture
def scanning_board(flash_with) -> Callable[..., tuple[Part, SlaveBus, FrontEnd]]:
    """Function that starts a scanning fingertip board."""

    def start(metadata: bytes = CONFIRMED_A, configuration: bytes = CONFIGURATION):
        """Start a board with images in both slots, and let it begin its first scan."""
        part = Part(SOFTWARE, flash_with("board", "ab", metadata, configuration))
        part.speed = 20
        bus, front_end = SlaveBus(part), create_front_end(part)
        part.run_until(lambda: front_end.conversions > 0)
        return part, bus, front_end

    return start


def write_image(part: Part, bus: SlaveBus, first_row: int, image: bytes) -> None:
    """Write an image row by row, as a host does."""
    for offset in range(0, len(image), 128):
        row = image[offset : offset + 128].ljust(128, b"\0")
        send_request(part, bus, BootCommand.SEND_DATA, row[:57])
        send_request(part, bus, BootCommand.SEND_DATA, row[57:114])
        send_request(
            part, bus, BootCommand.PROGRAM_ROW, b"\0" + (first_row + offset // 128).to_bytes(2, "little") + row[114:]
        )


def run_to_reset(part: Part) -> None:
    """Run until the firmware resets the processor."""
    with pytest.raises(AssertionError, match="reset the processor"):
        part.run_until(lambda: False)


def test_an_update_over_the_bus_starts_the_new_image(build_folder, listening_board):
    part, bus = listening_board
    image = (build_folder / "images" / "board-a.bin").read_bytes()
    send_request(part, bus, BootCommand.ENTER)
    first_row = int.from_bytes(send_request(part, bus, BootCommand.GET_FLASH_SIZE, b"\0")[:2], "little")
    write_image(part, bus, first_row, image)
    assert part.flash(first_row * 128, len(image)) == image
    assert send_request(part, bus, BootCommand.VERIFY_APPLICATION) == b"\x01"
    bus.write(DEFAULT_ADDRESS, build_packet(BootCommand.EXIT))
    run_to_reset(part)
    restarted_part = Part(SOFTWARE, part.flash(0, 0x8000), part.ram())
    restarted_part.run_until(lambda: restarted_part.pc >= first_row * 128)


def test_a_row_with_word_sum_zero_is_written_in_two_steps(listening_board):
    """The flash does not write such a row reliably in a single step, unless the row contains only zeros."""
    part, bus = listening_board
    row = bytes([1, 0, 0, 0] + [0xFF] * 4 + [0] * 120)  # the words 1 and 0xFFFFFFFF add up to 0 modulo 2^32
    send_request(part, bus, BootCommand.ENTER)
    part.calls.clear()
    write_image(part, bus, 32, row)
    assert part.flash(32 * 128, 128) == row
    assert part.calls == [(LOAD_LATCH, 0), (WRITE_ROW, 32), (LOAD_LATCH, 0), (PROGRAM_ROW, 32)]


def test_the_slave_is_disabled_while_a_row_is_written(listening_board):
    part, bus = listening_board
    system_call = part.on_write[SYSREQ]
    enabled = []

    def call(value: int) -> None:
        """Record whether the slave is enabled, and execute the system call."""
        enabled.append(bus.is_enabled)
        system_call(value)

    part.on_write[SYSREQ] = call
    send_request(part, bus, BootCommand.ENTER)
    write_image(part, bus, 40, bytes(range(128)))
    assert enabled == [False, False]  # the two system calls of a write: load the latch, write the row
    assert bus.is_enabled


def test_a_bootloader_responds_after_a_bus_error(listening_board):
    part, bus = listening_board
    bus.start(DEFAULT_ADDRESS, reading=False)
    bus.raise_event(INTR_S, BUS_ERROR)
    part.run()
    bus.raise_event(INTR_S, 0)
    assert send_request(part, bus, BootCommand.GET_INFO)[0] == 1


@pytest.mark.parametrize(
    "kind",
    {board.kind.code: board.kind for board in load_hand("allegro").boards}.values(),
)
def test_a_snapshot_contains_the_crossings_of_the_configured_kind(scanning_board, kind):
    configuration = CONFIGURATION[:2] + bytes([kind.code]) + CONFIGURATION[3:]  # byte 2 is the code of the kind
    part, bus, front_end = scanning_board(CONFIRMED_A, configuration)
    part.run_until(lambda: front_end.conversions > 2 * kind.taxel_count)
    snapshot = bus.read(ADDRESS, SNAPSHOT_OVERHEAD + 2 * kind.taxel_count, bytes([SNAPSHOT]))
    assert int.from_bytes(snapshot[-4:], "little") == crc32(bytes([ADDRESS]) + snapshot[:-4])
    assert np.frombuffer(snapshot[6:-4], "<u2").tolist() == compute_expected_counts(kind)


def test_each_rx_line_uses_its_configured_current(scanning_board):
    part, _, front_end = scanning_board()
    part.run_until(lambda: front_end.conversions > FINGERTIP.taxel_count)
    expected = {line: IDAC[line] or IDAC_DEFAULT for line in range(FINGERTIP.rx_count)}
    assert front_end.codes == expected


def test_an_unconfigured_board_responds_at_the_default_address(scanning_board):
    _, bus, _ = scanning_board(CONFIRMED_A, b"")
    identity, _ = unpack(Identity, bus.read(DEFAULT_ADDRESS, 58, b"\0"))
    assert (identity["kind"], identity["taxel_count"]) == (0, 1)


@pytest.mark.parametrize(
    ("reset_bits", "cause"),  # bits of the register RES_CAUSE
    [
        (0, ResetCause.POWER_ON),
        (1 << 0, ResetCause.WATCHDOG),
        (1 << 1, ResetCause.BROWN_OUT),
        (1 << 2, ResetCause.WATCHDOG),
        (1 << 4, ResetCause.COMMAND),
        (1 << 5, ResetCause.BROWN_OUT),
        (1 << 7, ResetCause.POWER_ON),
    ],
)
def test_an_image_reports_the_reset_cause(flash_with, reset_bits, cause):
    part = Part(reset_bits, flash_with("board", "a", CONFIRMED_A, CONFIGURATION))
    part.speed = 20  # cycles per instruction: time passes faster
    bus, front_end = SlaveBus(part), create_front_end(part)
    part.run_until(lambda: front_end.conversions > 0)
    status, _ = unpack(Status, bus.read(ADDRESS, 28, bytes([STATUS])))  # the 28 bytes of the status register
    assert status["reset_cause"] == cause


def test_a_trial_image_confirms_itself_after_ten_scans_and_a_read_and_continues_to_scan(scanning_board):
    part, bus, front_end = scanning_board(ON_TRIAL_A)
    part.run_until(lambda: front_end.conversions > CONVERSIONS_BEFORE_CONFIRMATION)
    assert read_metadata(part) == make_metadata(confirmed=NONE, pending=0, tries=(2, 3))
    bus.read(ADDRESS, SNAPSHOT_OVERHEAD + 2 * FINGERTIP.taxel_count, bytes([SNAPSHOT]))
    part.run_until(lambda: read_metadata(part)[0] == 0)  # the first field is `confirmed`; 0: slot A
    part.run(slices=10)
    identity, _ = unpack(Identity, bus.read(ADDRESS, 58, b"\0"))  # 58 bytes of register 0, the identity
    assert identity["kind"] == FINGERTIP.code
    conversion_count = front_end.conversions
    part.run(slices=200)
    assert front_end.conversions > conversion_count


def test_the_confirmation_does_not_delay_the_clock(scanning_board):
    part, bus, front_end = scanning_board(ON_TRIAL_A)

    def read_offset_us() -> float:
        """Return the elapsed time of the processor minus the clock of the board, in us."""
        status, _ = unpack(Status, bus.read(ADDRESS, 28, bytes([STATUS])))
        return part.cycles / CYCLES_PER_US - status["clock_us"]

    part.run_until(lambda: front_end.conversions > CONVERSIONS_BEFORE_CONFIRMATION)
    initial_offset_us = read_offset_us()
    bus.read(ADDRESS, SNAPSHOT_OVERHEAD + 2 * FINGERTIP.taxel_count, bytes([SNAPSHOT]))
    part.run_until(lambda: read_metadata(part)[0] == 0)
    part.run(100)
    assert abs(read_offset_us() - initial_offset_us) < 2 * SLICE * part.speed / CYCLES_PER_US


@pytest.mark.parametrize(
    ("command", "key", "stay_request"),
    [(BoardCommand.RESTART, b"", bytes(4)), (BoardCommand.ENTER_BOOTLOADER, b"BOOT", b"STAY")],
)
def test_a_commanded_restart_passes_the_stay_request_to_the_bootloader(scanning_board, command, key, stay_request):
    part, bus, _ = scanning_board()
    bus.write(ADDRESS, bytes([COMMAND, command, ~command & 0xFF]) + key)
    assert part.was_reset
    assert part.ram(HANDOVER, 4) == stay_request


@pytest.mark.parametrize("key", [b"", b"BOOU", b"BOO", b"BOOT\0", bytes(4)])
def test_an_image_stays_in_its_application_without_the_key_of_the_bootloader(scanning_board, key):
    part, bus, _ = scanning_board()
    bus.write(ADDRESS, bytes([COMMAND, BoardCommand.ENTER_BOOTLOADER, ~BoardCommand.ENTER_BOOTLOADER & 0xFF]) + key)
    part.run(10)
    assert not part.was_reset
    status, _ = unpack(Status, bus.read(ADDRESS, 28, bytes([STATUS])))
    assert (status["rejected_writes"], status["error_flags"]) == (1, BoardErrorFlag.COMMAND_REJECTED)


def test_the_pins_of_port_4_are_connected_to_the_i2c_block_and_the_capacitor(scanning_board):
    part, _, _ = scanning_board()
    assert part.words[PORT_4_FUNCTIONS] == CAPACITOR_PIN | I2C_PINS


class Host:
    """The PC at the UART of a hub with the given devices on its bus."""

    def __init__(self, flash: bytes, devices: dict[int, Callable[[bytes, bool], bytes | None]]) -> None:
        self.part = Part(SOFTWARE, flash)
        self.part.speed = 10
        self.uart, self.bus = Uart(self.part), MasterBus(self.part, devices)
        self._decoder = ReferenceDecoder()
        self.frames: list[tuple[int, int, bytes]] = []

    def run_until(self, ready: Callable[[], bool], slices: int = 20_000) -> None:
        """Execute the hub until `ready()` is true, and decode the frames that it sends meanwhile."""

        def is_ready() -> bool:
            self.frames += self._decoder.push(self.uart.take())
            return ready()

        self.part.run_until(is_ready, slices)

    def select_payloads(self, kind: FrameType) -> list[bytes]:
        """Return the payloads of the received frames of one type."""
        return [payload for frame_type, _, payload in self.frames if frame_type == kind]

    def send_frame(self, kind: FrameType, payload: bytes) -> None:
        self.uart.send(encode_frame(kind, 0, payload))


def test_a_hub_sends_its_handshake_and_searches_for_boards(flash_with):
    host = Host(flash_with("hub", "a", CONFIRMED_A), {})
    host.run_until(lambda: bool(host.select_payloads(FrameType.HUB_HANDSHAKE)) and len(set(host.bus.probed)) > 100)
    assert host.select_payloads(FrameType.HUB_HANDSHAKE)[0][4] == ResetCause.COMMAND  # byte 4: reset cause
    assert not host.part.was_reset


def test_a_hub_streams_snapshots_and_stops_the_host_while_it_confirms_itself(flash_with, scanning_board):
    sensor, bus, _ = scanning_board()

    def respond_as_board(written: bytes, reading: bool) -> bytes | None:
        """Pass a transfer of the hub to the executed board; return the bytes that it reads."""
        sensor.run(30)
        if reading:
            return bus.read(ADDRESS, SNAPSHOT_OVERHEAD + 2 * FINGERTIP.taxel_count, written)
        if written:
            assert bus.write(ADDRESS, written) == 1 + len(written)
        return b""

    host = Host(flash_with("hub", "a", ON_TRIAL_A), {ADDRESS: respond_as_board})
    levels: list[int] = []
    host.part.on_write[RTS_PORT] = levels.append
    host.run_until(lambda: bool(host.select_payloads(FrameType.HUB_HANDSHAKE)))
    host.send_frame(FrameType.HOST_HANDSHAKE, bytes([1, 1, 1]))
    host.run_until(lambda: len(host.select_payloads(FrameType.HUB_HANDSHAKE)) == 2)
    host.send_frame(FrameType.COMMAND, bytes([2, Command.START]))  # 2: tag, which the reply repeats
    host.run_until(lambda: len(host.select_payloads(FrameType.TAXELS)) == 5)
    payload = host.select_payloads(FrameType.TAXELS)[-1]  # headers of 8 and 6 bytes, counts, CRC
    assert payload[0] == ADDRESS
    assert np.frombuffer(payload[14:-4], "<u2").tolist() == compute_expected_counts(FINGERTIP)
    host.run_until(lambda: read_metadata(host.part) == CONFIRMED_A)
    host.part.run()
    rts_levels = [level >> 6 & 1 for level in levels]
    assert rts_levels[-2:] == [1, 0]  # RTS is inactive during the write of the row
    assert not any(rts_levels[:-2])  # and active during the start


def test_a_hub_releases_a_bus_whose_sda_is_held_low(flash_with):
    host = Host(flash_with("hub", "a", CONFIRMED_A), {})
    host.run_until(lambda: bool(host.select_payloads(FrameType.HUB_HANDSHAKE)))
    clocks_to_release = 5  # a device that holds SDA low releases it after the remaining bits of its byte
    rising_scl_edges: list[int] = []
    driven = {"levels": SCL_LEVEL | SDA_LEVEL}

    def drive_lines(levels: int) -> None:
        """Store the levels that the hub drives, and count the rising edges of SCL."""
        if not driven["levels"] & SCL_LEVEL and levels & SCL_LEVEL:
            rising_scl_edges.append(levels)
        driven["levels"] = levels

    def read_lines() -> int:
        """Return the levels of the lines; SDA is low until the device has received its clocks."""
        return driven["levels"] & ~(SDA_LEVEL if len(rising_scl_edges) < clocks_to_release else 0)

    host.part.on_write[BUS_PORT] = drive_lines
    host.part.on_read[BUS_PORT + 4] = read_lines
    host.send_frame(FrameType.HOST_HANDSHAKE, bytes([1, 1, 1]))
    host.run_until(lambda: len(rising_scl_edges) >= clocks_to_release)
    host.part.run(100)
    assert host.part.words[PORT_4_FUNCTIONS] == I2C_PINS, "the pins are connected to the I2C block again"
    probed = len(host.bus.probed)
    host.run_until(lambda: len(host.bus.probed) > probed + 10)


def test_a_hub_without_an_image_responds_on_its_uart(flash_with):
    part = Part(POWER_ON, flash_with("hub", ""))
    uart = Uart(part)
    run_until_enabled(part, uart)
    uart.send(build_packet(BootCommand.GET_INFO))
    received = b""
    while len(received) < INFO_PACKET_SIZE:
        part.run()
        received += uart.take()
    status, data = parse_packet(received)
    info, _ = unpack(Info, data)
    assert (status, info["device"]) == (BootStatus.OK, BootDevice.HUB)


def test_a_hub_enters_its_bootloader_on_command(flash_with):
    host = Host(flash_with("hub", "a", CONFIRMED_A), {})
    host.run_until(lambda: bool(host.select_payloads(FrameType.HUB_HANDSHAKE)))
    host.send_frame(FrameType.HOST_HANDSHAKE, bytes([1, 1, 1]))
    host.run_until(lambda: len(host.select_payloads(FrameType.HUB_HANDSHAKE)) == 2)
    host.send_frame(FrameType.COMMAND, bytes([2, Command.ENTER_BOOTLOADER]) + BOOTLOADER_KEY.to_bytes(4, "little"))
    # The model of the processor raises this error when the firmware resets it.
    with pytest.raises(AssertionError, match="reset the processor"):
        host.run_until(lambda: False)
    assert host.part.ram(HANDOVER, 4) == b"STAY"
