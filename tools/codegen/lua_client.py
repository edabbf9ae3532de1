"""The Lua client: a generated module of the protocol, and the dissector for Wireshark as one file of all modules."""

from pathlib import Path

from client_model import (
    CLIENTS,
    ORIGIN,
    format_rows,
    get_struct_size,
    list_constants,
    list_enumerations,
    list_messages,
    list_struct_fields,
    list_structs,
    list_tables,
)

FOLDER = CLIENTS / "lua"
FILE = FOLDER / "taxel" / "protocol.lua"
BUNDLE = FOLDER / "taxel_wireshark.lua"

MODULES = ("bits", "protocol", "fields", "crc32", "framing", "compact", "decoder")
"""Modules of the dissector; `dissector.lua` uses them and comes last."""


def _format_struct(name: str) -> list[str]:
    """Return the Lua lines that describe a struct: its size, and name, offset, size and kind of each field."""
    lines = [f"    {name} = {{", f"        size = {get_struct_size(name)},"]
    for field in list_struct_fields(name):
        kind = ", is_bytes = true" if field.is_bytes else ""
        lines.append(f'        {{ name = "{field.name}", offset = {field.offset}, size = {field.size}{kind} }},')
    return [*lines, "    },"]


def _format_messages() -> list[str]:
    """Return the Lua lines of the table of frame types, which is indexed by the type's code."""
    lines = ["-- Frame types by code. parts: structs at the front of the payload; tail: name of the bytes behind them."]
    lines.append("protocol.frames = {")
    for m in list_messages():
        parts = ", ".join(f'{{ struct = "{part.struct}", prefix = "{part.prefix}" }}' for part in m.parts)
        tail = f'"{m.tail}"' if m.tail else "nil"
        lines += [
            f'    [0x{m.frame_type:02X}] = {{ name = "{m.frame_type.name}",',
            f"        minimum = {m.minimum}, maximum = {m.maximum},",
            f"        has_address = {str(m.has_address).lower()}, parts = {{ {parts} }}, tail = {tail} }},",
        ]
    return [*lines, "}", ""]


def format_protocol() -> str:
    """Return the source text of the generated Lua module protocol.lua."""
    lines = [
        f"-- {ORIGIN}",
        "-- Constants, named codes, structs and frame types of the protocol.",
        "local protocol = {}",
        "",
    ]
    lines += [f"protocol.{name} = {value}" for name, value in list_constants().items()]
    for name, values in list_tables().items():
        lines += [f"protocol.{name} = {{", *format_rows(values, "    "), "}"]
    lines += ["", "-- Names of codes.", "protocol.names = {"]
    for name, members in list_enumerations().items():
        pairs = ", ".join(f'[{code}] = "{member}"' for member, code in members.items())
        lines.append(f"    {name} = {{ {pairs} }},")
    lines += ["}", "", "-- Structs: size in bytes, and the fields in order.", "protocol.structs = {"]
    for name in list_structs():
        lines += _format_struct(name)
    return "\n".join([*lines, "}", "", *_format_messages(), "return protocol", ""])


def _read_module(path: Path) -> str:
    """Read the source of a hand-written Lua module without the final line feed."""
    return path.read_text().rstrip("\n")


def format_bundle() -> str:
    """Return the dissector's source text as one file: `require` finds every module in `package.preload`."""
    lines = [
        "-- Dissector of the taxel protocol for Wireshark and tshark, as one file.",
        "-- Generated from protocol/clients/lua/taxel by tools/codegen/clients.py (make generate). Do not edit.",
    ]
    for name in MODULES:
        source = (
            format_protocol().rstrip("\n") if name == "protocol" else _read_module(FOLDER / "taxel" / f"{name}.lua")
        )
        lines += ["", f'package.preload["taxel.{name}"] = function(...)', source, "end"]
    return "\n".join([*lines, "", _read_module(FOLDER / "taxel" / "dissector.lua"), ""])


def format_files() -> dict[Path, str]:
    """Return the text of each generated file of the Lua client, by path."""
    return {FILE: format_protocol(), BUNDLE: format_bundle()}
