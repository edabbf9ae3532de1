"""Text of the frames of a stream as the Kaitai description describes them, for the comparison with the Python decoder.

The description is either interpreted (kaitai_interpreter.py) or compiled by the compiler of Kaitai Struct.
"""

import importlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import yaml
from kaitai_interpreter import Description
from programs import CLIENTS, ProgramMissingError, find_program

from taxel_protocol import FrameType
from taxel_protocol.frames import FRAMES
from taxel_protocol.layout import list_fields

FOLDER = CLIENTS / "kaitai"
COMPILER_VARIABLE = "TAXEL_KAITAI_COMPILER"
"""Environment variable with the folder of the npm package kaitai-struct-compiler."""

Parser = Callable[..., Any]
"""Parses bytes as the root type, or as the named type, of a description, with the arguments of its parameters."""

_COMPILE = """
const compiler = require(process.argv[1]), fs = require("fs");
compiler.compile("python", JSON.parse(fs.readFileSync(process.argv[2])), null, false).then(
    files => Object.keys(files).forEach(name => fs.writeFileSync(process.argv[3] + "/" + name, files[name])),
    error => { console.error(String(error)); process.exit(1); });
"""


def _load_process() -> Callable[[bytes], bytes]:
    """Load the decoding process `taxel_deframe` from the folder of the description, as a function of bytes."""
    sys.path.insert(0, str(FOLDER))
    try:
        process: Callable[[bytes], bytes] = importlib.import_module("taxel_deframe").TaxelDeframe().decode
    finally:
        sys.path.remove(str(FOLDER))
    return process


def interpret(name: str) -> Parser:
    """Return a parser that interprets a description. name: taxel_stream or taxel_capture."""
    return Description(FOLDER / f"{name}.ksy", {"taxel_deframe": _load_process()}).parse


def compile_description(name: str) -> Parser:
    """Compile the description `name`.ksy with the compiler of Kaitai Struct, and return a parser of its types.

    Raises ProgramMissingError if the compiler, its Python runtime or Node.js is not installed.
    """
    package = os.environ.get(COMPILER_VARIABLE)
    if package is None:
        raise ProgramMissingError(f"{COMPILER_VARIABLE} is not set: npm install kaitai-struct-compiler@0.11.0")
    try:
        runtime = importlib.import_module("kaitaistruct")
    except ImportError:
        raise ProgramMissingError("kaitaistruct is missing: pip install kaitaistruct") from None
    node = find_program(("node", "nodejs"), "nodejs")
    _load_process()
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "description.json")
        source.write_text(json.dumps(yaml.safe_load((FOLDER / f"{name}.ksy").read_text())))
        subprocess.run([node, "-e", _COMPILE, package, str(source), folder], check=True, timeout=120)
        sys.path.insert(0, folder)
        try:
            module = importlib.import_module(name)
        finally:
            sys.path.remove(folder)
    root = getattr(module, "".join(part.capitalize() for part in name.split("_")))

    def parse(data: bytes, type_name: str | None = None, arguments: Sequence[Any] = ()) -> Any:
        """Parse bytes with the compiled classes."""
        kind = getattr(root, "".join(part.capitalize() for part in type_name.split("_"))) if type_name else root
        return kind(*arguments, runtime.KaitaiStream(runtime.BytesIO(data)))

    return parse


def read_records(parse_capture: Parser, path: Path) -> bytes:
    """Read the bytes of all records of a capture file, by the description of capture files."""
    return b"".join(record.bytes for record in parse_capture(path.read_bytes(), None).records)


def _find_field(payload: Any, name: str) -> Any:
    """Return the value of a field by its flat name: an attribute of the payload, or of one of its structs.

    For example, "header_cycle" is the attribute `cycle` of `header`. Raises AttributeError for an unknown name.
    """
    for prefix in ("", "fields", "header", "snapshot", "snapshot_header"):
        owner = getattr(payload, prefix, None) if prefix else payload
        rest = name.removeprefix(f"{prefix}_") if prefix not in ("", "fields") else name
        if owner is not None and (rest != name or prefix in ("", "fields")) and hasattr(owner, rest):
            return getattr(owner, rest)
    raise AttributeError(name)


def format_value(value: Any) -> str:
    """Format a field value as text: a number, a code of an enumeration, or bytes in hexadecimal."""
    return value.hex() if isinstance(value, bytes) else str(int(getattr(value, "value", value)))


def format_frames(parse: Parser, data: bytes, directions: int = 1) -> list[str]:
    """Format one line for each known frame of a stream.

    A line contains type, sequence, lost frames, all fields, and the raw counts or the bytes behind the fields; for a
    compact frame the bytes of its snapshot. directions: bits of the accepted directions, 1: to the host, 2: to the hub.
    """
    lines, previous, lost = [], None, 0
    for entry in parse(data, None).frames.entries:
        body = entry.body
        code = int(getattr(body.type, "value", body.type))
        if not directions & (2 if code & 0x80 else 1):  # bit 7 of the type is set in frames to the hub
            continue
        # Frames that are lost before an unknown frame are counted in the line of the next known frame.
        lost = (lost + (0 if previous is None else body.sequence - previous - 1)) % 65536
        previous = body.sequence
        if not entry.is_known:
            continue
        kind = FrameType(code)
        # This handshake is the first frame after a start of the hub, whose numbers do not continue the earlier ones.
        if kind == FrameType.HUB_HANDSHAKE and body.sequence == 0 and body.payload.fields.tag == 0:
            lost = 0
        line = f"frame type={kind.name} sequence={body.sequence} lost={lost}"
        for field in list_fields(FRAMES[kind].payload):
            line += f" {field.name}={format_value(_find_field(body.payload, field.name))}"
        lines.append(f"{line} {_format_rest(kind, body.payload)}")
        lost = 0
    return lines


def _format_rest(kind: FrameType, payload: Any) -> str:
    """Format the part of a payload behind its structs: raw counts, snapshot, acknowledgements or bytes."""
    if kind == FrameType.TAXELS:
        return f"counts={','.join(map(str, payload.raw_counts))}"
    if kind == FrameType.COMPACT_TAXELS:
        return f"data={payload.data.hex()}"
    if kind == FrameType.ACKNOWLEDGE:
        pairs = (bytes([a.address]) + a.key_frame.to_bytes(2, "little") for a in payload.acknowledgements)
        return f"tail={b''.join(pairs).hex()}"
    last = next((name for name in ("text", "data", "arguments") if hasattr(payload, name)), None)
    return f"tail={getattr(payload, last).hex() if last else ''}"


def shorten(lines: Sequence[str]) -> list[str]:
    """Reduce the lines of the Python decoder to the content that the Kaitai description provides."""
    shortened = []
    for line in lines:
        words = [word for word in line.split(" ") if not word.startswith(("flags=", "wire="))]
        if words[0] != "frame":
            continue
        if words[1] in ("type=TAXELS", "type=COMPACT_TAXELS"):
            words = [word for word in words if not word.startswith(("missing=", "board_time_us="))]
        if words[1] == "type=COMPACT_TAXELS":
            words = [word for word in words if not word.startswith("counts=")]
        shortened.append(" ".join(words))
    return shortened
