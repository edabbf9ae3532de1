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
HEADER = 32
FLOAT = ("__aeabi_f", "__aeabi_d", "__aeabi_i2", "__aeabi_ui2", "__aeabi_l2", "__aeabi_ul2")
LIBC = {"malloc", "calloc", "free", "printf", "snprintf", "exit", "abort", "_sbrk", "__libc_init_array"}
DIVISION = ("__aeabi_i", "__aeabi_u", "__aeabi_l", "__divsi3", "__udivsi3", "__udivmoddi4", "__divdi3", "__udivdi3")


def version() -> tuple[int, ...]:
    return tuple(map(int, VERSION.split(".")))


@pytest.mark.parametrize("device", DEVICES)
def test_the_manifest_names_both_slots(build_folder, device):
    firmware = load_firmware([build_folder / "images" / f"{device}.toml"])
    loaded = [(image.device, image.slot, image.kind, image.version) for image in firmware.images]
    assert loaded == [(DEVICES[device], slot, 0, version()) for slot in (0, 1)]


@pytest.mark.parametrize("suffix", ["bin", "hex", "cyacd"])
@pytest.mark.parametrize("device", DEVICES)
def test_every_file_format_contains_the_same_image(build_folder, device, suffix):
    folder = build_folder / "images"
    expected = load_firmware([folder / f"{device}.toml"])
    loaded = load_firmware([folder / f"{device}-{slot}.{suffix}" for slot in SLOTS])
    assert [image.data for image in loaded.images] == [image.data for image in expected.images]


@pytest.mark.parametrize("name", APPLICATIONS)
def test_vectors_lie_in_their_own_slot(build_folder, name):
    device, slot = name.split("-")
    layout = LAYOUTS[DEVICES[device]]
    begin = layout.slot_address(SLOTS.index(slot))
    data = (build_folder / "images" / f"{name}.bin").read_bytes()
    vectors = [int.from_bytes(data[at : at + 4], "little") for at in range(HEADER, HEADER + 128, 4)]
    assert int.from_bytes(data[16:20], "little") == begin + HEADER
    assert vectors[0] == 0x20001000
    assert all(begin + HEADER + 128 <= vector < begin + len(data) and vector & 1 for vector in vectors[1:])


def test_images_of_both_slots_have_equal_length(build_folder):
    for device in DEVICES:
        first, second = ((build_folder / "images" / f"{device}-{slot}.bin").read_bytes() for slot in SLOTS)
        assert len(first) == len(second)


@pytest.mark.parametrize("device", DEVICES)
def test_a_factory_file_contains_the_bootloader_and_slot_a(build_folder, tools, device):
    flash: dict[int, int] = {}
    for line in (build_folder / "images" / f"{device}-factory.hex").read_text().splitlines():
        record = bytes.fromhex(line[1:])
        assert sum(record) % 256 == 0
        if record[3] == 0:
            address = int.from_bytes(record[1:3], "big")
            flash |= {address + place: byte for place, byte in enumerate(record[4:-1])}
    boot = tools.firmware_elf.read_linked_image(build_folder / f"bootloader-{device}.elf").content
    image = (build_folder / "images" / f"{device}-a.bin").read_bytes()
    assert bytes(flash[place] for place in range(len(boot))) == boot
    assert bytes(flash[0x1000 + place] for place in range(len(image))) == image
    assert len(flash) == len(boot) + len(image)
    assert max(flash) < BOOT_CONFIGURATION_ROW * BOOT_ROW_SIZE


@pytest.mark.parametrize("name", [*(f"bootloader-{device}" for device in DEVICES), *APPLICATIONS])
def test_no_image_contains_floating_point_or_library_code(build_folder, tools, name):
    names = {function.name for function in tools.firmware_elf.read_linked_image(build_folder / f"{name}.elf").functions}
    assert not {loaded for loaded in names if loaded.startswith(FLOAT)}
    assert not names & LIBC
    assert not (name.startswith("bootloader") and {loaded for loaded in names if loaded.startswith(DIVISION)})


def test_every_image_is_within_its_budgets(build_folder, tools):
    sizes = tools.firmware_size.measure_all(
        build_folder, "arm-none-eabi-objdump", tools.firmware_size.PORT / "calls.toml"
    )
    assert {name: size.describe_excess() for name, size in sizes.items() if size.describe_excess()} == {}
    assert all(size.flash_budget == 4096 for name, size in sizes.items() if name.startswith("bootloader"))
    assert sizes["board-a"].ram_budget == 3072


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
    assert len(written) == 16
    assert all(file.read_bytes() == (build_folder / "images" / file.name).read_bytes() for file in written)


def test_images_of_the_wrong_slot_or_device_are_rejected_with_one_line(build_folder, tools, tmp_path):
    boot, board, hub = (build_folder / name for name in ("bootloader-board.elf", "board-a.elf", "hub-b.elf"))
    for slots, message in (
        ((board, board), "expected slot B of a board, 0x4000, found 0x1000"),
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
    whole = (build_folder / "board-a.elf").read_bytes()
    damaged = tmp_path / "damaged.elf"
    for data in (whole[:40], whole[:300], whole[: len(whole) // 2], b"", b"\x7fELF\x02\x01" + whole[6:]):
        damaged.write_bytes(data)
        with pytest.raises(ValueError, match=r"damaged\.elf") as error:
            tools.firmware_elf.read_linked_image(damaged)
        assert "\n" not in str(error.value)


def test_exceeded_budgets_and_size_changes_are_reported(build_folder, tools, tmp_path):
    sizes = tools.firmware_size.measure_all(
        build_folder, "arm-none-eabi-objdump", tools.firmware_size.PORT / "calls.toml"
    )
    size = sizes["hub-a"]
    tight = dataclasses.replace(size, flash_budget=size.flash - 1, ram_budget=size.ram - 1)
    assert (
        tight.describe_excess()
        == f"flash {size.flash} of {size.flash - 1} bytes, RAM {size.ram} of {size.ram - 1} bytes"
    )
    busy = dataclasses.replace(size, cycles={"poll": 30, "frame": 80, "of": 100})
    assert busy.describe_excess() == "awake 110 of 100 cycles"
    before = tmp_path / "before.json"
    before.write_text(tools.firmware_size.format_json(sizes, "Compiler: any."))
    assert tools.firmware_size.compare_sizes(sizes, before) == ["no image changed its size"]
    grown = sizes | {"hub-a": dataclasses.replace(size, flash=size.flash + 4)}
    assert tools.firmware_size.compare_sizes(grown, before) == ["hub-a: flash +4"]
    assert tools.firmware_size.compare_sizes({"hub-a": busy}, before) == [
        "hub-a: cycles of a poll +30, cycles of a frame +80"
    ]
    before.write_text("{}")
    with pytest.raises(ValueError, match="expected JSON of an earlier run"):
        tools.firmware_size.compare_sizes(sizes, before)
