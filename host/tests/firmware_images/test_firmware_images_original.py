"""Images for the original boards (CY8C4244AZI-443), executed in Unicorn.

Counts, capacitors, addresses, the entry behind the original bootloader, and the files for programmer and bootloader.
"""

import struct
import tomllib
from collections.abc import Callable
from contextlib import nullcontext

import pytest

from taxel.hand import load_hand
from taxel.version import VERSION
from taxel_protocol.bootloader import BOOT_ROW_SIZE, StockMetadata
from taxel_protocol.framing import crc32
from taxel_protocol.layout import unpack
from taxel_protocol.registers import Identity
from taxel_tools.wires import SmbusWire

pytest.importorskip("unicorn", reason="unicorn is not installed: pip install unicorn==2.1.4")

from host.tests.firmware_images.conftest import PORT, ROOT
from host.tests.firmware_images.psoc_front_end import HSIOM, FrontEnd
from host.tests.firmware_images.psoc_part import POWER_ON, RAM, Part
from host.tests.firmware_images.psoc_wires import SlaveBus
from host.tests.tools.original_bootloader_model import METADATA_OFFSET, OriginalBootloader

KINDS = ("palm", "back_of_hand", "finger_tip", "finger_big", "finger_small")
FLASH_SIZE = 128 * BOOT_ROW_SIZE
PERIOD = 100 * 40
"""Sample clocks of a conversion with the original settings: 4,000 counts."""
SNAPSHOT, SNAPSHOT_OVERHEAD = 0x80, 10
AT_REST = sum(1 << bit for bit in (31, 24, 23, 22, 19, 18, 13, 11))
CONVERTING = AT_REST | sum(1 << bit for bit in (3, 4, 12, 21))
LINES_MAX = 16
SILICON_ID = 0x04FA1193
FIRST_ROW = 48
"""Flash row behind an assumed original bootloader of 6 KiB; the real bootloader reports its own."""


def simulate_count(tx: int, rx: int) -> int:
    """Return the simulated number of sample clocks in which the current source was on; it differs for each line."""
    return 500 + 37 * tx + 101 * rx


def parse_pin(name: str) -> tuple[int, int]:
    """Parse the port and number of a pin such as "P2.7"."""
    return int(name[1]), int(name[3])


def read_pins(kind: str) -> dict:
    """Read the table [sensor] of the pins file of an original board."""
    return tomllib.loads((PORT / "original" / f"{kind}.toml").read_text())["sensor"]


class TwoCapacitors(FrontEnd):
    """CapSense block of an original board: checks both capacitors and the bits of CONFIG at each conversion."""

    def __init__(self, part: Part, kind: str) -> None:
        pins = read_pins(kind)
        super().__init__(part, [parse_pin(pins["tx"][0])], [parse_pin(pin) for pin in pins["rx"]], simulate_count)
        self._capacitors = {parse_pin(pins["cint_a"]), parse_pin(pins["cint_b"])}
        self.configs: set[int] = set()

    def _set_config(self, value: int) -> None:
        self.configs.add(value)
        super()._set_config(value)

    def _connected(self, function: int) -> list[tuple[int, int]]:
        """Return the pins with a function; the two integration capacitors of this board become CMOD, as the base class
        expects.
        """
        pins = super()._connected(function)
        if function != 6:
            return pins
        assert self._capacitors <= set(pins), "both integration capacitors are on analog bus A"
        return [pin for pin in pins if pin not in self._capacitors] + [(4, 2)]


@pytest.fixture
def start_board(build_folder, tools) -> Callable[..., tuple[Part, SlaveBus, TwoCapacitors]]:
    """Function that starts the image of an original board, and returns it with its bus and its front end."""

    def start(kind: str, address: int | None = None) -> tuple[Part, SlaveBus, TwoCapacitors]:
        """Start the image of a board kind and let it complete two scans.

        address: I2C address that is written into the image; None for that of the pins file.
        """
        linked = tools.firmware_elf.read_linked_image(build_folder / f"original-{kind}.elf")
        image = tools.original_image.read_original_image(linked, address)
        part = Part(POWER_ON, image.content)
        part.speed = 20
        bus, front_end = SlaveBus(part), TwoCapacitors(part, kind)
        part.run_until(lambda: front_end.conversions > 2 * len(read_pins(kind)["rx"]))
        return part, bus, front_end

    return start


@pytest.mark.parametrize("kind", KINDS)
def test_a_snapshot_contains_the_taxels_in_the_order_of_the_rx_lines(start_board, kind):
    _, bus, _ = start_board(kind)
    count, address = len(read_pins(kind)["rx"]), read_pins(kind)["address"]
    snapshot = bus.read(address, SNAPSHOT_OVERHEAD + 2 * count, bytes([SNAPSHOT]))
    assert int.from_bytes(snapshot[-4:], "little") == crc32(bytes([address]) + snapshot[:-4])
    expected = [PERIOD - simulate_count(0, line) for line in range(count)]
    assert list(struct.unpack(f"<{count}H", snapshot[6:-4])) == expected


@pytest.mark.parametrize("kind", KINDS)
def test_the_identity_states_kind_version_and_a_crossing_map_of_at_most_16_columns(start_board, kind):
    _, bus, _ = start_board(kind)
    identity, _ = unpack(Identity, bus.read(read_pins(kind)["address"], 58, b"\0"))  # 58 bytes of register 0
    described = next(board.kind for board in load_hand("first_generation").boards if board.kind.name == kind)
    assert (identity["kind"], identity["taxel_count"]) == (described.code, described.taxel_count)
    version = tuple(identity[f"firmware_{part}"] for part in ("major", "minor", "patch"))
    assert version == tuple(map(int, VERSION.split(".")))
    assert identity["rows"] == (described.taxel_count + LINES_MAX - 1) // LINES_MAX
    assert identity["columns"] <= LINES_MAX
    assert int.from_bytes(identity["crossing_map"], "little") == (1 << described.taxel_count) - 1


@pytest.mark.parametrize("kind", KINDS)
def test_conversions_use_both_capacitors_and_the_bits_of_the_original_driver(start_board, kind):
    part, _, front_end = start_board(kind)
    assert front_end.configs == {AT_REST, CONVERTING}
    assert part.words[HSIOM + 12] >> 8 & 0xFF == 0, "the debugger's pins P3.2 and P3.3 keep their function"


def test_the_address_of_a_physical_board_is_written_into_its_image(start_board):
    _, bus, _ = start_board("finger_small", address=0x1A)
    assert bus.read(read_pins("finger_small")["address"], 1, b"\0") is None
    identity, _ = unpack(Identity, bus.read(0x1A, 58, b"\0"))  # 58 bytes of register 0
    assert identity["address"] == 0x1A


@pytest.fixture(scope="module")
def build_behind_bootloader(build_images, tools):
    """Linked image of the board FingerSmall behind an original bootloader that ends with row FIRST_ROW - 1."""
    folder = build_images(
        ROOT / "build" / "psoc4200-behind",
        "original-finger_small",
        options=(f"-DTAXEL_ORIGINAL_FIRST_ROW={FIRST_ROW}",),
    )
    return folder / "original-finger_small.elf"


def test_an_image_behind_the_original_bootloader_starts_with_any_stack_pointer(build_behind_bootloader, tools):
    image = tools.original_image.read_original_image(tools.firmware_elf.read_linked_image(build_behind_bootloader))
    flash = bytearray(FLASH_SIZE)
    for row, data in image.list_rows():
        flash[row * BOOT_ROW_SIZE : (row + 1) * BOOT_ROW_SIZE] = data
    struct.pack_into("<II", flash, 0, 0x20000400, image.entry)  # a bootloader that jumps with its own stack pointer
    part = Part(POWER_ON, bytes(flash))
    part.speed = 20  # cycles per instruction: time passes faster
    bus, front_end = SlaveBus(part), TwoCapacitors(part, "finger_small")
    part.run_until(lambda: front_end.conversions > 12)
    assert bus.read(read_pins("finger_small")["address"], 1, b"\0") is not None
    assert part.sp > RAM + 0x800  # the image has set its own, higher stack pointer
    assert part.pc >= FIRST_ROW * BOOT_ROW_SIZE


def test_an_image_that_the_writer_sends_to_the_original_bootloader_starts(
    build_behind_bootloader, tools, tmp_path, monkeypatch, capsys
):
    """All steps of an update: linked image, .cyacd, `original_flash.py`, model of the bootloader, executed image."""
    pytest.importorskip("smbus2")
    tools.original_image.write_files(build_behind_bootloader, "board", tmp_path, 0x1A, SILICON_ID)
    model = OriginalBootloader(0x18, SILICON_ID, FIRST_ROW, on_s=(3.0,))
    wire = SmbusWire(model, "model", model.now_s, model.wait)
    monkeypatch.setattr(tools.original_flash, "open_wire", lambda url: nullcontext(wire))
    assert tools.original_flash.main(["/dev/i2c-1", "--address", "0x18", str(tmp_path / "board.cyacd")]) == 0
    assert f"written: silicon id {SILICON_ID:08X}" in capsys.readouterr().out
    assert model.has_started
    metadata = StockMetadata.parse(bytes(model.flash[-METADATA_OFFSET:]))
    struct.pack_into("<II", model.flash, 0, 0x20000400, metadata.entry)  # instead of the bootloader's own vectors
    part = Part(POWER_ON, bytes(model.flash))
    part.speed = 20  # cycles per instruction: time passes faster
    bus, front_end = SlaveBus(part), TwoCapacitors(part, "finger_small")
    part.run_until(lambda: front_end.conversions > 12)
    identity, _ = unpack(Identity, bus.read(0x1A, 58, b"\0"))
    assert (identity["address"], identity["taxel_count"]) == (0x1A, 6)


def test_the_metadata_describe_the_image_to_the_original_bootloader(build_behind_bootloader, tools):
    image = tools.original_image.read_original_image(tools.firmware_elf.read_linked_image(build_behind_bootloader))
    rows = dict(image.list_rows())
    metadata = StockMetadata.parse(rows[127][64:])  # second half of the last row of the flash
    data = b"".join(rows[row] for row in sorted(rows) if row != 127)
    assert list(rows) == [*range(FIRST_ROW, FIRST_ROW + len(rows) - 1), 127]
    assert {len(row) for row in rows.values()} == {BOOT_ROW_SIZE}
    assert metadata.last_bootloader_row == FIRST_ROW - 1
    assert sum(data[: metadata.length]) + metadata.checksum & 0xFF == 0
    assert FIRST_ROW * BOOT_ROW_SIZE < metadata.entry < FIRST_ROW * BOOT_ROW_SIZE + metadata.length


def test_an_image_that_does_not_fit_behind_the_bootloader_is_not_linked(build_images, tmp_path):
    with pytest.raises(AssertionError, match="the image does not fit"):
        build_images(tmp_path, "original-finger_small", options=("-DTAXEL_ORIGINAL_FIRST_ROW=100",))


def test_the_files_contain_the_rows_of_the_image(build_folder, build_behind_bootloader, tools, tmp_path):
    tools.original_image.write_files(build_behind_bootloader, "finger_small", tmp_path, 0x1A, SILICON_ID)
    lines = (tmp_path / "finger_small.cyacd").read_text().splitlines()
    assert lines[0] == "04FA11930000"  # silicon id, revision 0, type 0 of the checksum
    # Hexadecimal digits of a line after the colon: 2 array, 4 row, 4 length, then the data, and 2 checksum.
    rows = {int(line[3:7], 16): bytes.fromhex(line[11:-2]) for line in lines[1:]}
    image = tools.original_image.read_original_image(
        tools.firmware_elf.read_linked_image(build_behind_bootloader), 0x1A
    )
    assert rows == dict(image.list_rows())
    for line in lines[1:]:
        assert sum(bytes.fromhex(line[1:])) & 0xFF == 0
    assert (tmp_path / "finger_small.hex").read_text().endswith(":00000001FF\n")


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("board-a", (None, None), "symbol image_first_row: expected one, found none"),
        ("original-hub", (0x10, None), "address: expected an image of a board, found one of the hub"),
        ("original-palm", (0x78, None), "expected an I2C address from 0x08 to 0x77, found 0x78"),
        ("original-palm", (None, 1), "expected an image behind the original bootloader"),
    ],
)
def test_wrong_images_and_options_are_reported_in_one_line(build_folder, tools, tmp_path, name, arguments, message):
    with pytest.raises(ValueError, match=message) as error:
        tools.original_image.write_files(build_folder / f"{name}.elf", "x", tmp_path, *arguments)
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("kind", "old", "new", "message"),
    [
        ("palm", 'cint_a = "P3.6"', 'cint_a = "P2.7"', "sensor.rx: expected each pin once, found P2.7"),
        ("palm", 'cint_b = "P3.7"\n', "", "sensor.cint_b: expected a pin, found None"),
        ("palm", '"P2.7", ', "", "sensor.rx: expected 20 pins, for palm, found 19"),
        ("palm", 'tx = ["P2.1"]', 'tx = ["P2.1", "P4.3"]', "sensor.tx: expected one pin"),
        ("palm", "address = 0x15", "address = 0x78", "sensor.address: expected a whole number from 8 to 119"),
        ("palm", "48-TQFP", "28-SSOP", "part.package: expected 44-TQFP or 48-TQFP, found '28-SSOP'"),
        ("palm", 'kind = "palm"', 'kind = "thumb"', "sensor.kind: expected a kind of the hands, found 'thumb'"),
        ("palm", "idac_code = 14", "idac_code = 0", "scan.idac_code: expected a whole number from 1 to 255"),
        ("hub", 'scl = "P3.0"', 'scl = "P4.0"', "hub.scl: expected P3.0, found 'P4.0'"),
        ("hub", "bus_hz = 100000", "bus_hz = 200000", "hub.bus_hz: expected one of"),
        ("hub", "slots = 22", "slots = 23", "hub.slots: expected a whole number from 1 to 22"),
    ],
)
def test_invalid_pins_of_original_boards_are_reported_in_one_line(tools, tmp_path, kind, old, new, message):
    text = (PORT / "original" / f"{kind}.toml").read_text()
    assert old in text
    pins = tmp_path / "pins.toml"
    pins.write_text(text.replace(old, new, 1))
    with pytest.raises(ValueError, match=r"^pins\.toml: ") as error:
        tools.board_header.write_all(pins, tmp_path / "out")
    assert message in str(error.value)
    assert "\n" not in str(error.value)
