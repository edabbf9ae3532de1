"""The generated part of the Rust client: constants, enumerations, structs, messages, and the table of frame types."""

from client_model import (
    CLIENTS,
    ORIGIN,
    TAXEL_FRAMES,
    Message,
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

FILE = CLIENTS / "rust" / "src" / "protocol.rs"
TYPES = {1: "u8", 2: "u16", 4: "u32", 8: "u64"}

HEAD = f"""\
// {ORIGIN}
//! Constants, named codes, structs and messages of the protocol.

/// Value of a field, for programs that list the fields of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value<'a> {{
    Number(u64),
    Bytes(&'a [u8]),
}}

/// Payloads that a frame type allows; `has_address`: the payload begins with the address of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRule {{
    pub frame_type: FrameType,
    pub has_address: bool,
    pub minimum: usize,
    pub maximum: usize,
}}

fn array<const N: usize>(bytes: &[u8], offset: usize) -> [u8; N] {{
    let mut value = [0; N];
    value.copy_from_slice(&bytes[offset..offset + N]);
    value
}}
"""


def _to_variant(member: str) -> str:
    """Convert a name such as BOARD_STATUS to BoardStatus."""
    return to_camel_case(member.lower())


def _format_enumeration(name: str, members: dict[str, int]) -> list[str]:
    """Return the Rust lines of an enumeration with the conversions from a code, and to the name."""
    lines = ["#[derive(Clone, Copy, Debug, PartialEq, Eq)]", "#[repr(u8)]", f"pub enum {name} {{"]
    lines += [f"    {_to_variant(member)} = 0x{code:02X}," for member, code in members.items()]
    lines += ["}", "", f"impl {name} {{", "    /// The code of this number, or None if it is not defined."]
    lines += ["    pub fn from_code(code: u8) -> Option<Self> {", "        match code {"]
    lines += [f"            0x{code:02X} => Some(Self::{_to_variant(member)})," for member, code in members.items()]
    lines += ["            _ => None,", "        }", "    }", "", "    /// The name in the specification."]
    lines += ["    pub fn name(self) -> &'static str {", "        match self {"]
    lines += [f'            Self::{_to_variant(member)} => "{member}",' for member in members]
    return [*lines, "        }", "    }", "}", ""]


def _format_type(field: Field) -> str:
    """Return the Rust type of a field."""
    return f"[u8; {field.size}]" if field.is_bytes else TYPES[field.size]


def _format_unpack(field: Field) -> str:
    """Return the Rust expression that reads a field from `bytes`."""
    read = f"array(bytes, {field.offset})"
    return read if field.is_bytes else f"{TYPES[field.size]}::from_le_bytes({read})"


def _format_pack(field: Field) -> str:
    """Return the Rust statement that writes a field to `bytes`."""
    value = f"self.{field.name}" if field.is_bytes else f"self.{field.name}.to_le_bytes()"
    return f"        bytes[{field.offset}..{field.offset + field.size}].copy_from_slice(&{value});"


def _format_struct(name: str) -> list[str]:
    """Return the Rust lines of a struct with its functions `unpack`, `pack` and `visit`."""
    fields, rust_name = list_struct_fields(name), to_camel_case(name)
    lines = ["#[derive(Clone, Copy, Debug, PartialEq, Eq)]", f"pub struct {rust_name} {{"]
    lines += [f"    pub {field.name}: {_format_type(field)}," for field in fields]
    lines += ["}", "", f"impl {rust_name} {{", "    /// Bytes of the fields.", "    pub const SIZE: usize ="]
    lines[-1] += f" {get_struct_size(name)};"
    lines += ["", "    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`."]
    lines += ["    pub fn unpack(bytes: &[u8]) -> Option<Self> {", "        if bytes.len() < Self::SIZE {"]
    lines += ["            return None;", "        }", "        Some(Self {"]
    lines += [f"            {field.name}: {_format_unpack(field)}," for field in fields]
    lines += [
        "        })",
        "    }",
        "",
        "    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.",
    ]
    lines += ["    pub fn pack(&self, bytes: &mut [u8]) {", *map(_format_pack, fields), "    }", ""]
    lines += ["    /// Call `visitor` with name and value of each field.", "    pub fn visit(&self, visitor: &mut"]
    lines[-1] += " dyn FnMut(&'static str, Value<'_>)) {"
    for field in fields:
        value = f"Bytes(&self.{field.name})" if field.is_bytes else f"Number(self.{field.name}{_widen(field)})"
        lines.append(f'        visitor("{field.name}", Value::{value});')
    return [*lines, "    }", "}", ""]


def _widen(field: Field) -> str:
    """Return the Rust suffix that converts a field's number to 64 bits; "" if it has 64 bits already."""
    return "" if field.size == 8 else " as u64"


def _has_tail(message: Message) -> bool:
    """Return whether bytes of variable length may follow the structs of a payload."""
    return message.tail is not None or message.frame_type in TAXEL_FRAMES


def _list_members(message: Message) -> list[tuple[str, str]]:
    """Return (name, Rust type) of each member of a message's enumeration variant."""
    members = [(part.prefix.rstrip("_") or "fields", to_camel_case(part.struct)) for part in message.parts]
    return [*members, ("tail", "&'a [u8]")] if _has_tail(message) else members


def _format_messages() -> list[str]:
    """Return the Rust lines of the enumeration `Message`: each variant holds the structs of a payload and its tail."""
    messages = list_messages()
    lines = ["/// A payload: its structs, and the bytes behind these structs (`tail`)."]
    lines += ["#[derive(Clone, Copy, Debug, PartialEq, Eq)]", "pub enum Message<'a> {"]
    for m in messages:
        members = ", ".join(f"{name}: {kind}" for name, kind in _list_members(m))
        lines.append(f"    {_to_variant(m.frame_type.name)} {{ {members} }},")
    lines += ["}", "", "impl<'a> Message<'a> {", "    /// The message in a payload; None for a shorter payload."]
    lines += ["    pub fn parse(frame_type: FrameType, payload: &'a [u8]) -> Option<Self> {"]
    lines += ["        Some(match frame_type {", *(line for m in messages for line in _format_parse(m))]
    lines += ["        })", "    }", "", "    /// Call `visitor` with prefix, name and value of each field, in order."]
    lines += ["    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, &'static str, Value<'_>)) {"]
    lines += ["        match self {", *(line for m in messages for line in _format_visit(m)), "        }", "    }", ""]
    lines += ["    /// Write the structs to the front of `payload`; returns their size. Panics for a shorter slice."]
    lines += [
        "    pub fn pack(&self, payload: &mut [u8]) -> usize {",
        "        let _ = &payload;",
        "        match self {",
    ]
    lines += [*(line for m in messages for line in _format_pack_message(m)), "        }", "    }", ""]
    lines += ["    /// The bytes behind the structs.", "    pub fn tail(&self) -> &'a [u8] {", "        match self {"]
    lines += [
        f"            Self::{_to_variant(m.frame_type.name)} {{ tail, .. }} => tail," for m in messages if _has_tail(m)
    ]
    return [*lines, "            _ => &[],", "        }", "    }", "}", ""]


def _format_parse(message: Message) -> list[str]:
    """Return the lines of the `match` arm that parses the payload of a frame type."""
    offset, values = 0, []
    for (name, _), part in zip(_list_members(message), message.parts, strict=False):
        values.append(f"{name}: {to_camel_case(part.struct)}::unpack(payload.get({offset}..)?)?")
        offset += get_struct_size(part.struct)
    values += [f"tail: payload.get({offset}..)?"] if _has_tail(message) else []
    variant = _to_variant(message.frame_type.name)
    return [
        f"            FrameType::{variant} => Self::{variant} {{",
        *(f"                {v}," for v in values),
        "            },",
    ]


def _bind(message: Message) -> str:
    """Return the Rust pattern that matches a message and binds its structs to variables of their names."""
    names = [name for (name, _), _ in zip(_list_members(message), message.parts, strict=False)]
    return f"Self::{_to_variant(message.frame_type.name)} {{ {', '.join([*names, '..'])} }}"


def _format_visit(message: Message) -> list[str]:
    """Return the lines of the `match` arm that calls the visitor for each field of a message."""
    lines = [f"            {_bind(message)} => {{"]
    for (name, _), part in zip(_list_members(message), message.parts, strict=False):
        lines.append(f'                {name}.visit(&mut |name, value| visitor("{part.prefix}", name, value));')
    return [*lines, "            }"]


def _format_pack_message(message: Message) -> list[str]:
    """Return the lines of the `match` arm that packs the structs of a message; its value is their size."""
    lines, offset = [f"            {_bind(message)} => {{"], 0
    for (name, _), part in zip(_list_members(message), message.parts, strict=False):
        lines.append(f"                {name}.pack(&mut payload[{offset}..]);")
        offset += get_struct_size(part.struct)
    return [*lines, f"                {offset}", "            }"]


def _format_visit_struct() -> list[str]:
    """Return the Rust lines of `visit_struct`, which reads a struct by its name and packs it again."""
    lines = ["/// Visit the fields of the struct with this name in snake case, and pack them again; returns its size."]
    lines += ["pub fn visit_struct(", "    name: &str,", "    bytes: &[u8],", "    packed: &mut [u8],"]
    lines += ["    visitor: &mut dyn FnMut(&'static str, Value<'_>),", ") -> Option<usize> {", "    match name {"]
    for name in list_structs():
        rust_name = to_camel_case(name)
        lines += [f'        "{name}" => {{', f"            let value = {rust_name}::unpack(bytes)?;"]
        lines += ["            value.visit(visitor);", "            value.pack(packed);"]
        lines += [f"            Some({rust_name}::SIZE)", "        }"]
    return [*lines, "        _ => None,", "    }", "}", ""]


def _format_rules() -> list[str]:
    """Return the Rust lines of the table of frame types and their permitted payload sizes."""
    messages = list_messages()
    lines = ["/// Every frame type of this version.", f"pub const FRAME_RULES: [FrameRule; {len(messages)}] = ["]
    for m in messages:
        has_address = str(m.has_address).lower()
        lines.append(
            f"    FrameRule {{ frame_type: FrameType::{_to_variant(m.frame_type.name)}, has_address: {has_address}, "
            f"minimum: {m.minimum}, maximum: {m.maximum} }},"
        )
    return [*lines, "];", ""]


def format_text() -> str:
    """Return the source text of the generated Rust module protocol.rs."""
    lines = [HEAD, *(f"pub const {name}: u32 = {value};" for name, value in list_constants().items())]
    for name, values in list_tables().items():
        lines += [f"pub const {name}: [u16; {len(values)}] = [", *format_rows(values, "    "), "];"]
    lines.append("")
    for name, members in list_enumerations().items():
        lines += _format_enumeration(name, members)
    for name in list_structs():
        lines += _format_struct(name)
    return "\n".join([*lines, *_format_rules(), *_format_messages(), *_format_visit_struct()])
