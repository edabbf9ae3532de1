"""The generated part of the C++ client: constants, enumerations, structs, and the table of frame types."""

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
    to_camel_case,
)

from taxel_protocol.layout import Field

FILE = CLIENTS / "cpp" / "include" / "taxel" / "protocol.hpp"
TYPES = {1: "std::uint8_t", 2: "std::uint16_t", 4: "std::uint32_t", 8: "std::uint64_t"}


def _format_type(field: Field) -> str:
    """Format the C++ type of a field: an unsigned integer or an array of bytes."""
    return f"std::array<std::uint8_t, {field.size}>" if field.is_bytes else TYPES[field.size]


def _format_struct(name: str) -> list[str]:
    """Format the C++ lines of a struct with its functions `unpack`, `pack` and `visit`. name: in snake case."""
    fields, cpp_name = list_struct_fields(name), to_camel_case(name)
    lines = [f"struct {cpp_name} {{", f"    static constexpr std::size_t size = {get_struct_size(name)};"]
    lines += [f"    {_format_type(field)} {field.name}{{}};" for field in fields]
    lines += [f"    static {cpp_name} unpack(const std::uint8_t *bytes)", "    {", f"        {cpp_name} value;"]
    lines += [f"        detail::load(bytes + {field.offset}, value.{field.name});" for field in fields]
    lines += ["        return value;", "    }", "    void pack(std::uint8_t *bytes) const", "    {"]
    lines += [f"        detail::store(bytes + {field.offset}, {field.name});" for field in fields]
    lines += ["    }", "    /* Calls visitor(name, value) for each field. */"]
    lines += ["    template <class Visitor> void visit(Visitor &&visitor) const", "    {"]
    lines += [f'        visitor("{field.name}", {field.name});' for field in fields]
    return [*lines, "    }", "};", ""]


def _format_enumeration(name: str, members: dict[str, int]) -> list[str]:
    """Format the C++ lines of an enumeration, and of the function that returns the name of a code."""
    lines = [f"enum class {name} : std::uint8_t {{"]
    lines += [f"    {member} = 0x{code:02X}," for member, code in members.items()]
    lines += ["};", f"inline const char *to_string({name} code)", "{", "    switch (code) {"]
    lines += [f'    case {name}::{member}: return "{member}";' for member in members]
    return [*lines, "    }", '    return "?";', "}", ""]


def _format_rules() -> list[str]:
    """Format the C++ lines of the table of frame types."""
    lines = [
        "/* Payloads that a frame type allows; has_address: the payload begins with the address of a board. */",
        *("struct FrameRule {", "    FrameType type;", "    bool has_address;"),
        *("    std::uint16_t minimum;", "    std::uint16_t maximum;", "};"),
        "inline constexpr FrameRule frame_rules[] = {",
    ]
    for m in list_messages():
        has_address = "true" if m.has_address else "false"
        lines.append(f"    {{FrameType::{m.frame_type.name}, {has_address}, {m.minimum}, {m.maximum}}},")
    return [*lines, "};", ""]


def _format_visits() -> list[str]:
    """Format the C++ lines of the functions that visit, unpack and pack the structs at the front of a payload."""
    lines = [
        "/* Calls visitor(prefix, value) for each struct at the front of a payload, in order, and returns the number",
        " * of bytes of these structs. `payload` has a length that the frame type allows. */",
        "template <class Visitor>",
        "std::size_t visit_payload(FrameType type, const std::uint8_t *payload, Visitor &&visitor)",
        *("{", "    (void)payload;", "    (void)visitor;", "    switch (type) {"),
    ]
    for m in list_messages():
        lines.append(f"    case FrameType::{m.frame_type.name}:")
        offset = 0
        for part in m.parts:
            lines.append(f'        visitor("{part.prefix}", {to_camel_case(part.struct)}::unpack(payload + {offset}));')
            offset += get_struct_size(part.struct)
        lines.append(f"        return {offset};")
    lines += ["    }", "    return 0;", "}", ""]
    lines += [
        "/* Calls visitor(value) for the struct of this name in snake case; returns false for another name or size. */",
        "template <class Visitor>",
        "bool visit_struct(std::string_view name, const std::uint8_t *bytes, std::size_t size, Visitor &&visitor)",
        "{",
    ]
    for name in list_structs():
        cpp_name = to_camel_case(name)
        lines += [f'    if (name == "{name}" && size >= {cpp_name}::size) {{']
        lines += [f"        visitor({cpp_name}::unpack(bytes));", "        return true;", "    }"]
    return [*lines, "    return false;", "}", ""]


HEAD = """\
#ifndef TAXEL_CLIENT_PROTOCOL_HPP
#define TAXEL_CLIENT_PROTOCOL_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace taxel
{

namespace detail
{

inline void load(const std::uint8_t *bytes, std::uint8_t &value)
{
    value = bytes[0];
}
inline void load(const std::uint8_t *bytes, std::uint16_t &value)
{
    value = static_cast<std::uint16_t>(bytes[0] | bytes[1] << 8);
}
inline void load(const std::uint8_t *bytes, std::uint32_t &value)
{
    value = static_cast<std::uint32_t>(bytes[0]) | static_cast<std::uint32_t>(bytes[1]) << 8 |
            static_cast<std::uint32_t>(bytes[2]) << 16 | static_cast<std::uint32_t>(bytes[3]) << 24;
}
inline void load(const std::uint8_t *bytes, std::uint64_t &value)
{
    std::uint32_t low = 0, high = 0;
    load(bytes, low);
    load(bytes + 4, high);
    value = low | static_cast<std::uint64_t>(high) << 32;
}
template <std::size_t N> void load(const std::uint8_t *bytes, std::array<std::uint8_t, N> &value)
{
    std::memcpy(value.data(), bytes, N);
}
template <class Integer> void store(std::uint8_t *bytes, Integer value)
{
    for (std::size_t i = 0; i < sizeof value; i++) {
        bytes[i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> 8 * i);
    }
}
template <std::size_t N> void store(std::uint8_t *bytes, const std::array<std::uint8_t, N> &value)
{
    std::memcpy(bytes, value.data(), N);
}

} // namespace detail
"""


def format_text() -> str:
    """Format the generated C++ header."""
    lines = [f"/* {ORIGIN} */", "// clang-format off", HEAD]
    lines += [f"inline constexpr std::uint32_t {name} = {value};" for name, value in list_constants().items()]
    for name, values in list_tables().items():
        lines += [f"inline constexpr std::uint16_t {name}[] = {{", *format_rows(values, "    "), "};"]
    lines.append("")
    for name, members in list_enumerations().items():
        lines += _format_enumeration(name, members)
    for name in list_structs():
        lines += _format_struct(name)
    lines += [*_format_rules(), *_format_visits(), "} // namespace taxel", "", "#endif", ""]
    return "\n".join(lines)
