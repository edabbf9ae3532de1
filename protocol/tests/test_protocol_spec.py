"""The tables of SPEC.md equal the definitions."""

import re
from pathlib import Path

import pytest
from construct import Struct

from taxel_protocol import frames, names, registers
from taxel_protocol.framing import crc32, encode_frame, whiten
from taxel_protocol.layout import list_fields

SPEC = (Path(__file__).resolve().parents[1] / "SPEC.md").read_text()
MODULES = {"frames": frames, "registers": registers}
TAXELS_AS_TEXT = {"Taxels"}  # a header and a snapshot, which have separate tables
NAMED_IN_TEXT = {"FrameType", "LogLevel"}


def read_table(mark: str) -> list[list[str]]:
    """Return the cells of the rows of the table that follows `<!-- mark -->`."""
    _, separator, tail = SPEC.partition(f"<!-- {mark} -->")
    assert separator, f"SPEC.md has no table marked {mark}"
    lines = tail.lstrip().splitlines()
    rows = lines[: next(i for i, line in enumerate(lines) if not line.startswith("|"))]
    return [[cell.strip().strip("`") for cell in row.strip("|").split("|")] for row in rows[2:]]


def list_structs() -> dict[str, Struct]:
    """Return the struct definitions of the modules that have a table in SPEC.md, by `module.name`."""
    definitions = {}
    for module_name, module in MODULES.items():
        for name, value in vars(module).items():
            is_own = f"\n{name} = Struct(" in Path(str(module.__file__)).read_text()
            if isinstance(value, Struct) and is_own and name not in TAXELS_AS_TEXT:
                definitions[f"{module_name}.{name}"] = value
    return definitions


def expand_rows(definition: Struct, rows: list[list[str]]) -> list[tuple[int, int, str]]:
    """Return (offset, size, field) of the rows, with the fields of a nested struct in place of its one row."""
    nested = {renamed.name: renamed.subcon for renamed in definition.subcons if isinstance(renamed.subcon, Struct)}
    fields: list[tuple[int, int, str]] = []
    for offset, size, name, *_ in rows:
        if name in nested:
            inner = list_fields(nested[name])
            assert sum(field.size for field in inner) == int(size), name
            fields += [(int(offset) + field.offset, field.size, f"{name}_{field.name}") for field in inner]
        else:
            fields.append((int(offset), int(size), name))
    return fields


@pytest.mark.parametrize("name", list_structs())
def test_layout_tables_of_the_spec_equal_the_definitions(name: str) -> None:
    definition = list_structs()[name]
    expected = [(field.offset, field.size, field.name) for field in list_fields(definition)]
    assert expand_rows(definition, read_table(f"layout: {name}")) == expected


@pytest.mark.parametrize(
    "name",
    [name for name, value in vars(names).items() if isinstance(value, type) and value.__module__ == names.__name__],
)
def test_name_tables_of_the_spec_equal_the_definitions(name: str) -> None:
    if name in NAMED_IN_TEXT:
        return
    rows = read_table(f"names: {name}")
    assert {row[1]: int(row[0], 16) for row in rows} == {member.name: member.value for member in getattr(names, name)}


def test_the_frame_table_of_the_spec_equals_the_definitions() -> None:
    rows = {int(row[0], 16): (row[1], row[2]) for row in read_table("frames")}
    for frame_type, spec in frames.FRAMES.items():
        sizes = f"{spec.minimum}" if spec.minimum == spec.maximum else f"{spec.minimum} to {spec.maximum}"
        assert rows.pop(frame_type) == (frame_type.name, sizes)
    assert not rows


def test_the_example_frame_of_the_spec_is_encoded_correctly() -> None:
    lines = {
        word: bytes.fromhex(text)
        for word, text in re.findall(
            r"^ (body|whitened|wire) +((?:[0-9A-F]{2} ?)+)$", SPEC.partition("## Receiver")[0], re.M
        )
    }
    # The frame of the example: tag 7, oldest and newest supported protocol version 1.
    assert encode_frame(names.FrameType.HOST_HANDSHAKE, 0, bytes([7, 1, 1])) == lines["wire"]
    assert whiten(lines["body"]) == lines["whitened"]


def test_the_spec_states_the_check_value_of_the_crc() -> None:
    assert f"0x{crc32(b'123456789'):08X}" in SPEC
