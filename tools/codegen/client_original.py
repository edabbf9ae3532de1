"""The generated tables of the original hub for the clients in C++, Rust and Lua: constants and message formats."""

from collections.abc import Iterable
from pathlib import Path

from client_model import CLIENTS, ORIGIN

from taxel_protocol import original

CONSTANTS = {
    "ORIGINAL_START": original.START,
    "ORIGINAL_END": original.END,
    "ORIGINAL_HEADER_SIZE": original.HEADER_SIZE,
    "ORIGINAL_TIMESTAMP_SIZE": original.TIMESTAMP_SIZE,
    "ORIGINAL_ACCELERATIONS": original.ACCELERATIONS,
    "ORIGINAL_RECORD_ADDRESS": original.RECORD_ADDRESS,
    "ORIGINAL_REFERENCE_TIMES": original.REFERENCE_TIMES,
    "ORIGINAL_TIME_STEP_MAX_MS": original.TIME_STEP_MAX_MS,
}
_PER_ROW = 16


def _list_by_address(values: dict[int, int]) -> list[int]:
    """Return a value for each of the 128 addresses; 0 for an address without a value."""
    return [values.get(address, 0) for address in range(original.ADDRESSES)]


def _format_rows(values: list[int], indent: str) -> list[str]:
    """Format the values of all addresses as lines, 16 values per line."""
    return [indent + ", ".join(map(str, values[i : i + _PER_ROW])) + "," for i in range(0, len(values), _PER_ROW)]


def _list_formats() -> Iterable[tuple[original.OriginalFormat, list[int], list[int]]]:
    """Yield each message format with its numbers of taxels and of accelerations, both by address (128 values)."""
    for layout in original.FORMATS.values():
        accelerated = dict.fromkeys(layout.accelerated, original.ACCELERATIONS)
        yield layout, _list_by_address(dict(layout.taxels)), _list_by_address(accelerated)


def _format_cpp() -> str:
    """Format the C++ header with constants and message formats."""
    lines = [f"/* {ORIGIN} */", "// clang-format off", "#ifndef TAXEL_CLIENT_ORIGINAL_FORMATS_HPP"]
    lines += ["#define TAXEL_CLIENT_ORIGINAL_FORMATS_HPP", "", "#include <cstddef>", "#include <cstdint>", ""]
    lines += ["namespace taxel", "{", ""]
    lines += [f"inline constexpr std::uint32_t {name} = {value};" for name, value in CONSTANTS.items()]
    lines += [
        "",
        "/* A variant of the message: taxels and accelerations by address (0: no such board); record_size: bytes of",
    ]
    lines += [" * a record without a frame, 0 for framed messages. */", "struct OriginalFormat {"]
    lines += ["    const char *name;", "    bool has_timestamp, is_big_endian;", "    std::size_t record_size;"]
    lines += [f"    std::uint8_t taxels[{original.ADDRESSES}], accelerations[{original.ADDRESSES}];", "};", ""]
    lines.append("inline constexpr OriginalFormat original_formats[] = {")
    for layout, taxels, accelerations in _list_formats():
        flags = f"{str(layout.has_timestamp).lower()}, {str(layout.is_big_endian).lower()}"
        lines += [f'    {{"{layout.name}", {flags}, {layout.record_size},', "     {"]
        lines += [
            *_format_rows(taxels, "      "),
            "     },",
            "     {",
            *_format_rows(accelerations, "      "),
            "     }},",
        ]
    return "\n".join([*lines, "};", "", "} // namespace taxel", "", "#endif", ""])


def _format_rust() -> str:
    """Format the Rust module with constants and message formats."""
    lines = [f"// {ORIGIN}", "//! Constants and message formats of the original hub.", ""]
    lines += [f"pub const {name}: u32 = {value};" for name, value in CONSTANTS.items()]
    lines += [
        "",
        "/// A variant of the message: taxels and accelerations by address (0: no such board). `record_size`:",
    ]
    lines += ["/// bytes of a record without a frame, 0 for framed messages.", "#[derive(Clone, Copy, Debug)]"]
    lines += ["pub struct OriginalFormat {", "    pub name: &'static str,", "    pub has_timestamp: bool,"]
    lines += ["    pub is_big_endian: bool,", "    pub record_size: usize,"]
    lines += [f"    pub {name}: [u8; {original.ADDRESSES}]," for name in ("taxels", "accelerations")]
    lines += [
        "}",
        "",
        "/// Every variant.",
        f"pub static ORIGINAL_FORMATS: [OriginalFormat; {len(original.FORMATS)}] = [",
    ]
    for layout, taxels, accelerations in _list_formats():
        lines += ["    OriginalFormat {", f'        name: "{layout.name}",']
        lines += [f"        has_timestamp: {str(layout.has_timestamp).lower()},"]
        lines += [f"        is_big_endian: {str(layout.is_big_endian).lower()},"]
        lines += [f"        record_size: {layout.record_size},", "        taxels: [", *_format_rows(taxels, " " * 12)]
        lines += [
            "        ],",
            "        accelerations: [",
            *_format_rows(accelerations, " " * 12),
            "        ],",
            "    },",
        ]
    return "\n".join([*lines, "];", ""])


def _format_lua() -> str:
    """Format the Lua module with constants and message formats."""
    lines = [f"-- {ORIGIN}", "-- Constants and message formats of the original hub.", "local original = {}", ""]
    lines += [f"original.{name.removeprefix('ORIGINAL_')} = {value}" for name, value in CONSTANTS.items()]
    lines += [
        "",
        "-- Variants of the message by name: taxels and accelerations by address. record_size: bytes of a record",
    ]
    lines += ["-- without a frame, 0 for framed messages.", "original.formats = {"]
    for layout, taxels, accelerations in _list_formats():
        flags = f"has_timestamp = {str(layout.has_timestamp).lower()}"
        flags += f", is_big_endian = {str(layout.is_big_endian).lower()}, record_size = {layout.record_size}"
        lines.append(f'    {layout.name} = {{ name = "{layout.name}", {flags},')
        for name, values in (("taxels", taxels), ("accelerations", accelerations)):
            pairs = ", ".join(f"[{address}] = {value}" for address, value in enumerate(values) if value)
            lines.append(f"        {name} = {{ {pairs} }}," if pairs else f"        {name} = {{}},")
        lines.append("    },")
    return "\n".join([*lines, "}", "", "return original", ""])


def format_files() -> dict[Path, str]:
    """Return the text of each generated file of the original hub, by path."""
    return {
        CLIENTS / "cpp" / "include" / "taxel" / "original_formats.hpp": _format_cpp(),
        CLIENTS / "rust" / "src" / "original_formats.rs": _format_rust(),
        CLIENTS / "lua" / "taxel" / "original_formats.lua": _format_lua(),
    }
