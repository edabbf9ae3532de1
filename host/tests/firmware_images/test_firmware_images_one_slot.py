"""Images for boards with 16 KiB of flash, with this project's bootloader and one slot, on the emulated part.

The host's update procedure writes them over I2C. A power cut during an update leaves a board without an application,
which waits in its bootloader for the repeated update.
"""

import random
from contextlib import suppress

import pytest

from host.tests.firmware_images.test_firmware_images_original import KINDS, read_pins
from host.tests.firmware_images.test_firmware_images_original_emulated import (
    STACK_BYTES,
    format_board_world,
    make_hand,
    press_taxels,
    read_counts,
)
from taxel.errors import TaxelError
from taxel.link.virtual import VirtualSMBus, VirtualWorld
from taxel.version import VERSION
from taxel_protocol.bootloader import (
    BOOT_CONFIGURATION_MAGIC,
    BOOT_DEFAULT_ADDRESS,
    BOOT_ROW_SIZE,
    LAYOUTS,
    BootDevice,
    Configuration,
)
from taxel_protocol.bootloader_images import build_image, build_record
from taxel_protocol.layout import pack
from taxel_tools.application import get_firmware_version, wait_for_application
from taxel_tools.errors import BoardError
from taxel_tools.files import Firmware, load_firmware
from taxel_tools.files.firmware import HEADER_SIZE, parse_image
from taxel_tools.files.intel_hex import write_intel_hex
from taxel_tools.firmware_update import update_board
from taxel_tools.provision import provision
from taxel_tools.provisioning_plan import Entry
from taxel_tools.scheduler import run
from taxel_tools.wires import SmbusWire

LAYOUT = LAYOUTS[BootDevice.BOARD_16K]
HEX_END = ":00000001FF\n"
CHANGED_ROWS = 4
POWER_OFF_S = 0.03
SEED = 45


class OneSlotBoard:
    """A board that executes the image of one kind, and a host on its I2C bus."""

    def __init__(self, world: VirtualWorld, kind: str) -> None:
        """Connect to the board through an I2C adapter; the hub is unplugged."""
        self.world, self.address = world, read_pins(kind)["address"]
        world.inject("hub_unplug")
        self.wire = SmbusWire(VirtualSMBus(world), "virtual", lambda: world.now_s, world.run)

    def read_version(self) -> tuple[int, int, int] | None:
        """Return the version of the running application; None if none starts within 2 s."""
        identity = run(self.wire, wait_for_application(self.address, self.wire.now_s, 2.0))
        return None if identity is None else get_firmware_version(identity)

    def update(self, firmware: Firmware, **options: bool) -> None:
        """Write firmware as `taxel flash` does. Raises `BoardError`."""
        run(self.wire, update_board(self.address, firmware, self.wire.now_s, lambda _: None, **options))


@pytest.fixture
def open_board(build_folder, tmp_path):
    """Function that opens the world of one provisioned board of a kind."""

    def open_world(kind: str) -> VirtualWorld:
        """Open a world in which the board has the factory image and a configuration record in row 124."""
        board = make_hand((kind,)).boards[0]
        values = {"version": 1, "address": board.address, "kind": board.kind.code, "reserved": 0}
        configuration = pack(Configuration, values | {"serial_number": bytes(16), "idac_codes": bytes(16)})
        record = build_record(BOOT_CONFIGURATION_MAGIC, 0, configuration)
        factory = (build_folder / "images" / "one-slot" / f"{kind}-factory.hex").read_text()
        row = write_intel_hex(record, LAYOUT.configuration_row * BOOT_ROW_SIZE)
        (tmp_path / "board.hex").write_text(factory.removesuffix(HEX_END) + row)
        text = format_board_world(kind, f"original-{kind}") + "boot_listens 1\n"
        return VirtualWorld(text, "none", files={"board.hex": tmp_path / "board.hex"})

    return open_world


def make_version(build_folder, kind: str, version: tuple[int, int, int]) -> Firmware:
    """Return the image of a kind under another version, with rows that differ from those of other versions."""
    built = load_firmware([build_folder / "images" / "one-slot" / f"{kind}.toml"])
    content = built.images[0].data[HEADER_SIZE:] + random.Random(str(version)).randbytes(CHANGED_ROWS * BOOT_ROW_SIZE)
    data = build_image(BootDevice.BOARD_16K, 0, built.kind, version, content)
    return Firmware((parse_image(data, f"{kind} {version}"),))


@pytest.mark.parametrize("kind", KINDS)
def test_the_image_is_for_one_kind_and_fits_its_slot(build_folder, kind):
    firmware = load_firmware([build_folder / "images" / "one-slot" / f"{kind}.toml"])
    (image,) = firmware.images
    assert (image.device, image.slot) == (BootDevice.BOARD_16K, 0)
    assert firmware.kind == make_hand((kind,)).boards[0].kind.code
    assert ".".join(map(str, image.version)) == VERSION
    assert len(image.data) <= LAYOUT.slot_size


@pytest.mark.parametrize("kind", ["palm", "finger_small"])
def test_the_image_measures_the_counts_of_a_board_with_native_firmware(open_board, kind):
    count = len(read_pins(kind)["rx"])
    with VirtualWorld(format_board_world(kind, None), "none") as world:
        press_taxels(world, count)
        native = read_counts(world, kind)
    with open_board(kind) as world:
        press_taxels(world, count)
        executed = read_counts(world, kind)
        processor = world.read_processor(read_pins(kind)["address"])
    assert executed == native
    assert (processor.faults, processor.is_broken, processor.is_application) == (0, False, True)
    assert 0 < processor.stack <= STACK_BYTES


def test_an_update_overwrites_the_only_image_and_confirms_the_new_one(build_folder, open_board):
    with open_board("finger_small") as world:
        board = OneSlotBoard(world, "finger_small")
        assert board.read_version() == tuple(map(int, VERSION.split(".")))
        firmware = make_version(build_folder, "finger_small", (1, 2, 3))
        board.update(firmware)
        assert board.read_version() == (1, 2, 3)
        flash = world.read_flash(board.address).data
        assert flash[LAYOUT.slot_address(0) :].startswith(firmware.images[0].data)
        with pytest.raises(BoardError, match="newer than version"):
            board.update(make_version(build_folder, "finger_small", (1, 2, 2)))
        board.update(make_version(build_folder, "finger_small", (1, 2, 2)), downgrade=True)
        assert board.read_version() == (1, 2, 2)


def test_firmware_for_32_kib_or_another_kind_is_refused_and_the_board_runs_on(build_folder, open_board):
    large = load_firmware([build_folder / "images" / "board.toml"])
    other = make_version(build_folder, "palm", (1, 2, 3))
    with open_board("finger_small") as world:
        board = OneSlotBoard(world, "finger_small")
        version = board.read_version()
        with pytest.raises(BoardError, match=r"16 KiB of flash, but .* is for a sensor board with 32 KiB"):
            board.update(large)
        with pytest.raises(BoardError, match="the board is of kind"):
            board.update(other)
        assert board.read_version() == version


def test_after_a_power_cut_the_board_waits_for_the_repeated_update(build_folder, open_board):
    """The power is cut during the write to the flash with the number `operation`, counted from 1.

    Write 1 is the metadata before the first row, writes 2 and 4 are rows, and the last three numbers are writes of the
    records of trial and confirmation.
    """
    generator = random.Random(SEED)
    print("seed", SEED)
    with open_board("finger_small") as world:
        board = OneSlotBoard(world, "finger_small")
        running = board.read_version()
        outcomes = []
        for number, operation in enumerate((1, 2, 4, CHANGED_ROWS + 3, CHANGED_ROWS + 4, CHANGED_ROWS + 5)):
            firmware = make_version(build_folder, "finger_small", (2, 0, number))
            world.plan_power_cut(board.address, operation, generator.uniform(1e-3, 9e-3), POWER_OFF_S)
            with suppress(TaxelError):  # a cut while a record is written may end before the host waits for the board
                board.update(firmware)
            world.run(POWER_OFF_S + 0.01)
            found = board.read_version()
            assert found in (None, running, (2, 0, number))
            outcomes.append(found)
            board.update(firmware)
            running = board.read_version()
            assert running == (2, 0, number)
        assert world.count_power_cuts(board.address) == len(outcomes)
    assert outcomes[1:3] == [None, None], "an image of which a row is missing does not start"


def test_a_blank_board_receives_address_and_kind_and_then_measures(build_folder):
    """A board in the state of the factory file answers at the default address until it is provisioned."""
    files = {"board.hex": build_folder / "images" / "one-slot" / "finger_small-factory.hex"}
    text = format_board_world("finger_small", "original-finger_small") + "boot_listens 1\n"
    kind = make_hand(("finger_small",)).boards[0].kind
    with VirtualWorld(text, "none", files=files) as world:
        board = OneSlotBoard(world, "finger_small")
        assert board.read_version() is None
        entry = Entry(None, address=board.address, kind=kind.code)
        found, changes = provision(board.wire, [BOOT_DEFAULT_ADDRESS], [entry])
        assert (len(found), [change.address for change in changes]) == (1, [board.address])
        assert board.read_version() == tuple(map(int, VERSION.split(".")))
        executed = read_counts(world, "finger_small")
    with VirtualWorld(format_board_world("finger_small", None), "none") as world:
        assert executed == read_counts(world, "finger_small")
