"""A small interpreter of Kaitai Struct descriptions, so that the tests need no compiler of Kaitai Struct.

It covers what the descriptions of protocol/clients/kaitai use: `seq` and `instances` with `pos`, `size`, `size-eos` and
`value`; integers u1 to u8, s2, u2be, u4be, s2be and b1 to b64 (lowest bit first), user types with parameters,
`switch-on`, `contents`, `valid`, `repeat`, `if`, `encoding`, and the processes `xor` and custom ones. Anything else
raises `DescriptionError`.
"""

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import yaml

_INTEGERS: dict[str, tuple[int, Literal["little", "big"], bool]] = {
    "u1": (1, "little", False), "u2": (2, "little", False), "u4": (4, "little", False), "u8": (8, "little", False),
    "u2le": (2, "little", False), "s2le": (2, "little", True), "u2be": (2, "big", False), "u4be": (4, "big", False),
    "s2be": (2, "big", True),
}  # fmt: skip
"""Size, byte order and sign of the integer types."""

_ATTRIBUTES = {
    *("id", "type", "size", "size-eos", "repeat", "repeat-expr", "if", "enum", "process", "contents", "valid"),
    *("encoding", "doc", "pos", "value"),
}
_OPERATORS: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.BitAnd: operator.and_,
    ast.Eq: operator.eq, ast.NotEq: operator.ne,
}  # fmt: skip


class DescriptionError(Exception):
    """Error: the description uses a feature that this interpreter does not cover, or is inconsistent."""


class Source:
    """Bytes with a position, and the bits of the byte that was read last."""

    def __init__(self, data: bytes) -> None:
        """Create a source at its start."""
        self.data, self.pos = data, 0
        self._bits, self._bit_count = 0, 0

    @property
    def size(self) -> int:
        """Number of all bytes."""
        return len(self.data)

    def read(self, size: int) -> bytes:
        """Return the next bytes. Raises EOFError if there are fewer."""
        self._bit_count = 0
        if size < 0 or self.pos + size > self.size:
            raise EOFError(f"{size} bytes expected, {self.size - self.pos} found")
        self.pos += size
        return self.data[self.pos - size : self.pos]

    def read_bits(self, count: int) -> int:
        """Return the next bits, lowest bit first."""
        while self._bit_count < count:
            bits, available = self._bits if self._bit_count else 0, self._bit_count
            byte = self.read(1)[0]
            self._bits, self._bit_count = bits | byte << available, available + 8
        value = self._bits & ((1 << count) - 1)
        self._bits >>= count
        self._bit_count -= count
        return value


class Node:
    """A parsed value of a user type: attributes by name; instances are parsed at their first use."""

    def __init__(self, parser: "Description", spec: Mapping[str, Any], source: Source) -> None:
        """Create a value without attributes. spec: part of the description for its type."""
        self._parser, self._spec, self._io = parser, spec, source

    def __getattr__(self, name: str) -> Any:
        """Parse an instance at its first use, and store its value as an attribute."""
        instances = self._spec.get("instances", {})
        if name.startswith("__") or name not in instances:
            raise AttributeError(name)
        value = self._parser.read_instance(self, instances[name])
        setattr(self, name, value)
        return value


class Description:
    """A description from a .ksy file. processes: functions of custom processes by name."""

    def __init__(self, path: Path, processes: Mapping[str, Callable[[bytes], bytes]] | None = None) -> None:
        """Read a description.

        path: a .ksy file. processes: functions of the custom processes of the description, by name. Raises
        DescriptionError for a description that is not little-endian.
        """
        self._root: dict[str, Any] = yaml.safe_load(path.read_text())
        self._processes = processes or {}
        meta = self._root["meta"]
        if meta["endian"] != "le" or meta.get("bit-endian", "le") != "le":
            raise DescriptionError(f"{path}: only little-endian descriptions are interpreted")

    def parse(self, data: bytes, type_name: str | None = None, arguments: Sequence[Any] = ()) -> Node:
        """Parse bytes as the root type, or as another type of the description, with the arguments of its parameters.

        Raises EOFError for too few bytes.
        """
        return self._parse_type(self._find(type_name) if type_name else self._root, Source(data), list(arguments))

    def _find(self, name: str) -> dict[str, Any]:
        """Return the part of the description for a user type. Raises DescriptionError if it is not defined."""
        types: dict[str, dict[str, Any]] = self._root.get("types", {})
        if name not in types:
            raise DescriptionError(f"type {name} is not defined")
        return types[name]

    def _parse_type(self, spec: Mapping[str, Any], source: Source, arguments: list[Any]) -> Node:
        """Parse a user type from `source`. spec: its part of the description. arguments: values of its parameters."""
        unknown = set(spec) - {"meta", "doc", "doc-ref", "seq", "types", "enums", "params", "instances"}
        if unknown:
            raise DescriptionError(f"{sorted(unknown)} are not interpreted")
        node = Node(self, spec, source)
        for parameter, value in zip(spec.get("params", []), arguments, strict=True):
            setattr(node, parameter["id"], value)
        for attribute in spec["seq"]:
            if "if" not in attribute or self._evaluate(attribute["if"], node):
                setattr(node, attribute["id"], self._read_attribute(node, attribute, source))
        return node

    def read_instance(self, node: Node, attribute: Mapping[str, Any]) -> Any:
        """Return the value of an instance: an expression, or an attribute at a position."""
        if "value" in attribute:
            return self._evaluate(attribute["value"], node)
        source = Source(node._io.data)
        source.pos = int(attribute["pos"])
        return self._read_attribute(node, attribute, source)

    def _read_attribute(self, node: Node, attribute: Mapping[str, Any], source: Source) -> Any:
        """Read an attribute: one value, or a list of values if the attribute is repeated."""
        unknown = set(attribute) - _ATTRIBUTES
        if unknown:
            raise DescriptionError(f"{sorted(unknown)} of {attribute.get('id')} are not interpreted")
        repeat = attribute.get("repeat")
        if repeat == "eos":
            values = []
            while source.pos < source.size:
                values.append(self._read_value(node, attribute, source))
            return values
        if repeat == "expr":
            count = self._evaluate(attribute["repeat-expr"], node)
            return [self._read_value(node, attribute, source) for _ in range(count)]
        return self._read_value(node, attribute, source)

    def _read_value(self, node: Node, attribute: Mapping[str, Any], source: Source) -> Any:
        """Read one value of an attribute: an integer, bytes, a string, or a `Node`.

        Raises ValueError if the value is not the one that the description requires.
        """
        if "contents" in attribute:
            contents = attribute["contents"]
            expected = contents.encode() if isinstance(contents, str) else bytes(contents)
            return self._check(source.read(len(expected)), expected, attribute)
        named = attribute.get("type")
        kind: str | None = self._switch(node, named) if isinstance(named, dict) else named
        if "size" in attribute or attribute.get("size-eos"):
            size = source.size - source.pos if attribute.get("size-eos") else self._evaluate(attribute["size"], node)
            data = self._process(source.read(size), attribute.get("process"), node)
            if kind == "str":
                return data.decode(attribute["encoding"])
            return data if kind is None else self._parse_user_type(node, kind, Source(data))
        if kind is None:
            raise DescriptionError(f"{attribute['id']} has neither a type nor a size")
        if kind in _INTEGERS:
            size, order, is_signed = _INTEGERS[kind]
            value = int.from_bytes(source.read(size), order, signed=is_signed)
            return self._check(value, attribute.get("valid", value), attribute)
        if kind[0] == "b" and kind[1:].isdigit():
            return source.read_bits(int(kind[1:]))
        return self._parse_user_type(node, kind, source)

    def _check(self, value: Any, expected: Any, attribute: Mapping[str, Any]) -> Any:
        """Return a value; raise ValueError unless it has the expected value."""
        if value != expected:
            raise ValueError(f"{attribute['id']}: expected {expected}, found {value}")
        return value

    def _switch(self, node: Node, switch: Mapping[str, Any]) -> str | None:
        """Return the type that a switch selects; None for a value without a case."""
        value = self._evaluate(switch["switch-on"], node)
        for case, kind in switch["cases"].items():
            if self._evaluate(case, node) == value:
                return str(kind)
        return None

    def _parse_user_type(self, node: Node, kind: str, source: Source) -> Node:
        """Parse a user type, whose parameters may follow its name in parentheses."""
        name, _, arguments = kind.partition("(")
        values = [self._evaluate(part, node) for part in arguments.rstrip(")").split(",") if part]
        return self._parse_type(self._find(name), source, values)

    def _process(self, data: bytes, process: str | None, node: Node) -> bytes:
        """Apply the process of an attribute to its bytes: none, `xor` with a key, or a custom process."""
        if process is None:
            return data
        name, _, argument = process.partition("(")
        if name == "xor":
            key = self._evaluate(argument.rstrip(")"), node)
            return bytes(byte ^ key[i % len(key)] for i, byte in enumerate(data))
        return self._processes[name](data)

    def _evaluate(self, expression: Any, node: Node) -> Any:
        """Return the value of an expression of the description."""
        if not isinstance(expression, str):
            return expression
        if "::" in expression:
            enum, _, member = expression.partition("::")
            codes = {str(name): code for code, name in self._root["enums"][enum].items()}
            return codes[member]
        return self._compute(ast.parse(expression.strip(), mode="eval").body, node)

    def _compute(self, part: ast.expr, node: Node) -> Any:
        """Compute the value of a part of an expression; names are attributes of `node`."""
        match part:
            case ast.Constant(value=value):
                return value
            case ast.List(elts=elements):
                return [self._compute(element, node) for element in elements]
            case ast.Name(id=name):
                return getattr(node, name)
            case ast.Attribute(value=owner, attr=name):
                return getattr(self._compute(owner, node), name)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](self._compute(left, node), self._compute(right, node))
            case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](self._compute(left, node), self._compute(right, node))
        raise DescriptionError(f"the expression {ast.unparse(part)} is not interpreted")
