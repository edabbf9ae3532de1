"""Outputs of `make firmware`: the images are loadable, lie at their addresses, contain no library code, meet their
budgets and are reproducible.
"""

import dataclasses
import hashlib

import pytest

from host.tests.firmware_images.conftest import DEVICES
from taxel.version import VERSION
from taxel_protocol.bootloader import BOOT_CONFIGURATION_ROW, BOOT_ROW_SIZE, LAYOUTS
from taxel_tools.files import load_firmware

SLOTS = ("a", "b")
APPLICATIONS = [f"{device}-{slot}" for device in DEVICES for slot in SLOTS]
HEADER_BYTES = 32
VECTORS_BYTES = 8  # stack pointer and reset vector: the start-up code fills in the other vectors in RAM
RAM_END = 0x20001000
SLOT_A_ADDRESS = 0x1000
FLOAT_PREFIXES = ("__aeabi_f", "__aeabi_d", "__aeabi_i2", "__aeabi_ui2", "__aeabi_l2", "__aeabi_ul2")
LIBRARY_FUNCTIONS = {"malloc", "calloc", "free", "printf", "snprintf", "exit", "abort", "_sbrk", "__libc_init_array"}
DIVISION_PREFIXES = (
    "__aeabi_i",
    "__aeabi_u",
    "__aeabi_l",
    "__divsi3",
    "__udivsi3",
    "__udivmoddi4",
    "__divdi3",
    "__udivdi3",
)


def read_version() -> tuple[int, ...]:
    """Read the major, minor and patch number of the project."""
    return tuple(map(int, VERSION.split(".")))


@pytest.mark.parametrize("device", DEVICES)
def test_the_manifest_names_both_slots(build_folder, device):
    firmware = load_firmware([build_folder / "images" / f"{device}.toml"])
    loaded_images = [(image.device, image.slot, image.kind, image.version) for image in firmware.images]
    assert loaded_images == [(DEVICES[device], slot, 0, read_version()) for slot in (0, 1)]


@pytest.mark.parametrize("suffix", ["bin", "hex", "cyacd"])
@pytest.mark.parametrize("device", DEVICES)
def test_every_file_format_contains_the_same_image(build_folder, device, suffix):
    folder = build_folder / "images"
    expected = load_firmware([folder / f"{device}.toml"])
    loaded_images = load_firmware([folder / f"{device}-{slot}.{suffix}" for slot in SLOTS])
    assert [image.data for image in loaded_images.images] == [image.data for image in expected.images]


@pytest.mark.parametrize("name", APPLICATIONS)
def test_vectors_lie_in_their_own_slot(build_folder, name):
    device, slot = name.split("-")
    layout = LAYOUTS[DEVICES[device]]
    slot_address = layout.slot_address(SLOTS.index(slot))
    data = (build_folder / "images" / f"{name}.bin").read_bytes()
    vectors = [
        int.from_bytes(data[offset : offset + 4], "little")
        for offset in range(HEADER_BYTES, HEADER_BYTES + VECTORS_BYTES, 4)
    ]
    # bytes 16 to 19 of the header: address of the vectors
    assert int.from_bytes(data[16:20], "little") == slot_address + HEADER_BYTES
    assert vectors[0] == RAM_END  # initial stack pointer
    # The other vectors are addresses in the code of the slot; bit 0 is set for Thumb code.
    assert all(
        slot_address + HEADER_BYTES + VECTORS_BYTES <= vector < slot_address + len(data) and vector & 1
        for vector in vectors[1:]
    )


def test_images_of_both_slots_have_equal_length(build_folder):
    for device in DEVICES:
        slot_a, slot_b = ((build_folder / "images" / f"{device}-{slot}.bin").read_bytes() for slot in SLOTS)
        assert len(slot_a) == len(slot_b)


@pytest.mark.parametrize("device", DEVICES)
def test_a_factory_file_contains_the_bootloader_and_slot_a(build_folder, tools, device):
    flash: dict[int, int] = {}
    for line in (build_folder / "images" / f"{device}-factory.hex").read_text().splitlines():
        record = bytes.fromhex(line[1:])
        assert sum(record) % 256 == 0  # checksum of an Intel HEX record
        if record[3] == 0:  # a data record
            address = int.from_bytes(record[1:3], "big")
            flash |= {address + offset: byte for offset, byte in enumerate(record[4:-1])}
    boot = tools.firmware_elf.read_linked_image(build_folder / f"bootloader-{device}.elf").content
    image = (build_folder / "images" / f"{device}-a.bin").read_bytes()
    assert bytes(flash[offset] for offset in range(len(boot))) == boot
    assert bytes(flash[SLOT_A_ADDRESS + offset] for offset in range(len(image))) == image
    assert len(flash) == len(boot) + len(image)
    assert max(flash) < BOOT_CONFIGURATION_ROW * BOOT_ROW_SIZE


@pytest.mark.parametrize("name", [*(f"bootloader-{device}" for device in DEVICES), *APPLICATIONS])
def test_no_image_contains_floating_point_or_library_code(build_folder, tools, name):
    names = {function.name for function in tools.firmware_elf.read_linked_image(build_folder / f"{name}.elf").functions}
    assert not {symbol for symbol in names if symbol.startswith(FLOAT_PREFIXES)}
    assert not names & LIBRARY_FUNCTIONS
    assert not (name.startswith("bootloader") and {symbol for symbol in names if symbol.startswith(DIVISION_PREFIXES)})


@pytest.fixture(scope="module")
def sizes(build_folder, tools):
    """Flash, RAM, stack and processor cycles of each image."""
    return tools.firmware_size.measure_all(build_folder, "arm-none-eabi-objdump", tools.firmware_size.CALLS)


def test_every_image_is_within_its_budgets(sizes):
    assert {name: size.describe_excess() for name, size in sizes.items() if size.describe_excess()} == {}
    assert all(size.flash_budget == 4096 for name, size in sizes.items() if name.startswith("bootloader"))
    assert sizes["board-a"].ram_budget == 3584


def test_a_second_build_in_another_folder_gives_the_same_bytes(build_folder, build_images, tmp_path):
    second_build = build_images(tmp_path / "elsewhere", "board-b")
    digests = [
        hashlib.sha256((folder / "board-b.elf").read_bytes()).hexdigest() for folder in (build_folder, second_build)
    ]
    assert digests[0] == digests[1]


def test_writing_the_images_again_gives_the_same_bytes(build_folder, tools, tmp_path):
    for device in DEVICES:
        slots = (build_folder / f"{device}-a.elf", build_folder / f"{device}-b.elf")
        tools.firmware_image.write_images(build_folder / f"bootloader-{device}.elf", slots, device, tmp_path)
    written = sorted(tmp_path.iterdir())
    assert len(written) == 22  # eleven files for each device
    assert all(file.read_bytes() == (build_folder / "images" / file.name).read_bytes() for file in written)


def test_images_of_the_wrong_slot_or_device_are_rejected_with_one_line(build_folder, tools, tmp_path):
    boot, board, hub = (build_folder / name for name in ("bootloader-board.elf", "board-a.elf", "hub-b.elf"))
    for slots, message in (
        ((board, board), "expected slot B of a board, 0x4700, found 0x1000"),
        ((board, hub), "device: expected board, as slot A, found hub"),
        ((boot, board), "symbol image_slot: expected one, found none"),
    ):
        with pytest.raises(ValueError, match=message) as error:
            tools.firmware_image.write_images(boot, slots, "board", tmp_path)
        assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match="pass the bootloader's ELF"):
        tools.firmware_image.write_images(board, (board, board), "board", tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_linked_image_is_reported_in_one_line(build_folder, tools, tmp_path):
    content = (build_folder / "board-a.elf").read_bytes()
    damaged = tmp_path / "damaged.elf"
    # truncated files, an empty file, and a file whose header states 64 bits
    for data in (content[:40], content[:300], content[: len(content) // 2], b"", b"\x7fELF\x02\x01" + content[6:]):
        damaged.write_bytes(data)
        with pytest.raises(ValueError, match=r"damaged\.elf") as error:
            tools.firmware_elf.read_linked_image(damaged)
        assert "\n" not in str(error.value)


def test_exceeded_budgets_of_flash_ram_and_cycles_are_reported(sizes):
    size = sizes["hub-a"]
    over_budget = dataclasses.replace(size, flash_budget=size.flash - 1, ram_budget=size.ram - 1)
    assert (
        over_budget.describe_excess()
        == f"flash {size.flash} of {size.flash - 1} bytes, RAM {size.ram} of {size.ram - 1} bytes"
    )
    over_cycles = dataclasses.replace(size, cycles={"poll": 30, "frame": 80, "of": 100})  # "of": the budget
    assert over_cycles.describe_excess() == "awake 110 of 100 cycles"  # 30 for the poll and 80 for the frame


def test_changes_of_size_and_cycles_since_an_earlier_run_are_listed(sizes, tools, tmp_path):
    earlier_sizes = tmp_path / "earlier.json"
    earlier_sizes.write_text(tools.firmware_size.format_json(sizes, "Compiler: any."))
    assert tools.firmware_size.compare_sizes(sizes, earlier_sizes) == ["no image changed its size"]
    size = sizes["hub-a"]
    grown = sizes | {"hub-a": dataclasses.replace(size, flash=size.flash + 4)}
    assert tools.firmware_size.compare_sizes(grown, earlier_sizes) == ["hub-a: flash +4"]
    slower = {"hub-a": dataclasses.replace(size, cycles={"poll": 30, "frame": 80, "of": 100})}
    changes = tools.firmware_size.compare_sizes(slower, earlier_sizes)
    assert changes == ["hub-a: cycles of a poll +30, cycles of a frame +80"]


def test_a_file_that_contains_no_earlier_sizes_is_rejected(sizes, tools, tmp_path):
    (tmp_path / "earlier.json").write_text("{}")
    with pytest.raises(ValueError, match="expected JSON of an earlier run"):
        tools.firmware_size.compare_sizes(sizes, tmp_path / "earlier.json")
