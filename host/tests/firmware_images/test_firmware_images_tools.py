"""The build tools without a compiler: pins, stack analysis, invalid files."""

import pickle
import re
import struct
from types import SimpleNamespace

import pytest

from host.tests.firmware_images.conftest import PORT
from taxel.hand import load_hand

VALID_PINS = (PORT / "pins.toml").read_text()


def read_pins_error(tools, tmp_path, text: str) -> str:
    """Return the one-line message of the error for the content of a pins.toml, from which no file is written."""
    pins = tmp_path / "pins.toml"
    pins.write_text(text)
    with pytest.raises(ValueError) as error:
        tools.board_header.write_all(pins, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    assert str(pickle.loads(pickle.dumps(error.value))) == str(error.value)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_kinds_source_contains_every_kind_of_the_hands(tools, tmp_path):
    tools.board_header.write_all(PORT / "pins.toml", tmp_path)
    source = (tmp_path / "kinds.c").read_text()
    for board in load_hand("allegro").boards:
        kind = board.kind
        row = rf"/\* {kind.name} \*/\n\s+\{{{kind.code}, {kind.tx_count}, {kind.rx_count}, {kind.taxel_count},"
        assert re.search(row, source)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('scl = "P4.0"', 'scl = "P4.1"', "pins.toml: sensor.scl: expected P4.0, found 'P4.1'"),
        ('scl = "P4.0"\n', "", "pins.toml: sensor.scl: expected P4.0, found None"),
        ('"P2.0"', '"P5.0"', "expected a pin from P0.0 to P4.3, found 'P5.0'"),
        ('"P2.0"', '"P4.7"', "expected a pin from P0.0 to P4.3, found 'P4.7'"),
        ('"P2.0"', '"P3.2"', "expected a pin other than the debugger's, found P3.2"),
        ('"P2.0"', '"P2.1"', "expected each pin once, found P2.1, which sensor.tx uses already"),
        ('"P2.0", ', "", "sensor.tx: expected 13 pins or more, for fingertip, found 12"),
        ("hands = [", "hands = [] #", "hands: expected a packaged hand or more, found []"),
        ("[sensor]", "[sensor", "file: expected TOML"),
    ],
)
def test_invalid_pins_are_reported_in_one_line(tools, tmp_path, old, new, message):
    assert old in VALID_PINS
    assert message in read_pins_error(tools, tmp_path, VALID_PINS.replace(old, new, 1))


def test_an_unknown_hand_is_reported_in_one_line(tools, tmp_path):
    assert "nohand" in read_pins_error(tools, tmp_path, VALID_PINS.replace('"flat8"', '"nohand"'))


LISTING = """
00000100 <reset_handler>:
 100:\tpush\t{r4, r5, lr}
 102:\tsub\tsp, #20
 104:\tbl\t200 <deep>
 108:\tblx\tr3
 10a:\tb.n\t10a <reset_handler+0xa>

00000200 <deep>:
 200:\tpush\t{r0, r1, r4-r7, lr}
 202:\tbl\t300 <leaf.constprop.0>
 206:\tpop\t{r0, r1, r4-r7, pc}

00000300 <leaf.constprop.0>:
 300:\tpop\t{r3}
 302:\tbx\tr3

00000400 <on_call>:
 400:\tpush\t{r4, lr}
 402:\tb.n\t300 <leaf.constprop.0>

00000500 <systick_handler>:
 500:\tpush\t{r4, lr}
 502:\tpop\t{r4, pc}
"""


def build_graph(
    tools, listing: str, frame_sizes: dict[str, int] | None = None, pointer_targets: tuple[int, ...] = (0x400,)
):
    """Build the call graph of a listing as by objdump, in which "on_*" may be called through pointers.

    frame_sizes: frame sizes from the compiler by function. pointer_targets: addresses that the image stores as words.
    """
    stack, elf = tools.firmware_stack, tools.firmware_elf
    routines = stack.read_disassembly(listing)
    functions = tuple(elf.Function(routine.name, address, 4) for address, routine in routines.items())
    content = b"".join(struct.pack("<I", address | 1) for address in pointer_targets)
    build_linked_image = elf.LinkedImage("some.elf", 0, content, (), {}, functions)
    table = stack.CallTable("calls.toml", ((["*"], ["on_*"]),), ((["some"], [["systick_handler"]]),))
    return stack.CallGraph(build_linked_image, routines, frame_sizes or {}, table)


def test_the_stack_is_the_deepest_chain_and_the_interrupts(tools):
    use = build_graph(tools, LISTING).compute_stack_use("some")
    assert (use.start, use.interrupts) == (32 + 28, 36 + 8)  # frames of reset_handler + deep, exception + handler
    assert use.chain == ("reset_handler", "deep", "leaf", "systick_handler")


def test_the_larger_frame_of_code_and_compiler_is_used(tools):
    use = build_graph(tools, LISTING, {"on_call": 100}).compute_stack_use("some")
    assert use.start == 32 + 100  # frames of reset_handler + on_call
    assert use.chain[1] == "on_call"


def test_recursion_is_an_error(tools):
    listing = LISTING.replace("bl\t300 <leaf.constprop.0>", "bl\t200 <deep>")
    with pytest.raises(ValueError, match=r"some.elf: deep: expected no recursion"):
        build_graph(tools, listing).compute_stack_use("some")


def test_a_pointer_target_must_be_listed_in_the_table(tools):
    with pytest.raises(ValueError, match=r"some.elf: deep: expected an entry in calls.toml, found none"):
        build_graph(tools, LISTING, pointer_targets=(0x200,))


def test_a_dynamic_frame_requires_the_size_from_the_compiler(tools):
    listing = LISTING.replace("sub\tsp, #20", "add\tsp, r4")
    with pytest.raises(ValueError, match="build with -fstack-usage"):
        build_graph(tools, listing)
    use = build_graph(tools, listing, {"reset_handler": 600}).compute_stack_use("some")
    assert use.start == 600 + 28  # frames of reset_handler + deep


def test_an_array_of_variable_length_is_an_error(tools, tmp_path):
    notes = tmp_path / "image.su"
    notes.write_text("a.c:1:1:fixed\t16\tstatic\nb.c:2:2:open\t24\tdynamic\n")
    with pytest.raises(ValueError, match=r"image.su: open: expected a frame of a known size"):
        tools.firmware_stack.read_frame_sizes([notes])


@pytest.mark.parametrize("text", ["", "pointer = 1", "[[pointer]]\ncallers = ['*']", "["])
def test_an_invalid_call_table_is_reported_in_one_line(tools, tmp_path, text):
    table = tmp_path / "calls.toml"
    table.write_text(text)
    with pytest.raises(ValueError, match=r"calls.toml: table: expected \[\[pointer\]\] and \[\[levels\]\]") as error:
        tools.firmware_stack.read_call_table(table)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('VERSION = "1.2.0rc1"', "three numbers to 255, such as 1.2.0, found '1.2.0rc1'"),
        ('VERSION = "1.2.300"', "three numbers to 255"),
        ("", "VERSION: expected a version, found none"),
    ],
)
def test_a_version_beyond_the_header_format_is_reported_in_one_line(tools, tmp_path, text, message):
    version_file = tmp_path / "version.py"
    version_file.write_text(text)
    with pytest.raises(ValueError, match=re.escape(message)):
        tools.firmware_image.read_project_version(version_file)


def build_linked_image(tools, content: bytes, address: int = 0x1000, **symbols: int) -> SimpleNamespace:
    values = {"image_device": 1, "image_slot": 0} | symbols
    return tools.firmware_elf.LinkedImage("some.elf", address, content, (), values, ())


def build_content(stack: int, reset: int, header: bytes = bytes(32), size: int = 16) -> bytes:
    return header + struct.pack("<II", stack, reset) + bytes(size)


def test_the_header_of_an_image_is_completed(tools):
    """The content has 32 bytes for the header, 8 bytes of vectors, and 16 bytes of code: 56 bytes."""
    image = tools.firmware_image.build_slot_image(
        build_linked_image(tools, build_content(0x20001000, 0x1029)), 0, (1, 2, 3)
    )
    assert (image.version, image.slot, image.kind, len(image.data)) == ((1, 2, 3), 0, 0, 56)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (build_content(0x20001000, 0x1029, bytes(31) + b"\1"), "header: expected 32 zeros"),
        (build_content(0x20001008, 0x1029), "stack pointer: expected a multiple of 8 in RAM"),
        (build_content(0x20000FFC, 0x1029), "stack pointer: expected a multiple of 8 in RAM"),
        (build_content(0x20001000, 0x1028), "reset vector: expected Thumb code from 0x1028"),
        (build_content(0x20001000, 0x4029), "reset vector: expected Thumb code from 0x1028"),
        (build_content(0x20001000, 0x1029, size=14100), "size: expected at most 14080 bytes"),
    ],
)
def test_an_image_with_invalid_vectors_or_size_is_rejected(tools, content, message):
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        tools.firmware_image.build_slot_image(build_linked_image(tools, content), 0, (1, 2, 3))
    assert "\n" not in str(error.value)
