"""Codecs of text files: TOML, JSON, lines of JSON, CSV, and lines of words."""

from __future__ import annotations

import csv
import gzip
import io
import json
import tomllib
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np


@dataclass(frozen=True)
class Toml:
    """TOML files; the encoder writes tables as inline tables, except tables and lists of tables at the top."""

    is_strict: bool = True

    def decode(self, data: bytes) -> Any:
        """Return the document as nested tables. Raises an error for invalid TOML."""
        return tomllib.loads(data.decode())

    def encode(self, document: Any) -> bytes:
        """Return the TOML text of a document (nested dicts and lists). Raises ValueError for None, which TOML lacks."""
        lines = [f"{_quote(key)} = {_write(value)}" for key, value in document.items() if not _is_tables(value)]
        for key, value in document.items():
            for table in (value if isinstance(value, list) else [value]) if _is_tables(value) else ():
                head = f"[[{_quote(key)}]]" if isinstance(value, list) else f"[{_quote(key)}]"
                lines += [head, *(f"{_quote(name)} = {_write(each)}" for name, each in table.items())]
        return "\n".join(lines).encode() + b"\n"


def _is_tables(value: Any) -> bool:
    """Return whether a value is a table of TOML (a dict), or a list of one or more tables."""
    return isinstance(value, dict) or (
        isinstance(value, list) and bool(value) and all(isinstance(each, dict) for each in value)
    )


def _quote(text: str) -> str:
    """Return a key or a string as a basic string of TOML."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _write(value: Any) -> str:
    """Return a value in the syntax of TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_quote(str(key))} = {_write(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ",\n".join(map(_write, value)) + "]"
    if isinstance(value, str):
        return _quote(value)
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, int):
        return str(value)
    if value is None:
        raise ValueError("TOML has no null")
    return str(value.isoformat())


@dataclass(frozen=True)
class Json:
    """JSON files."""

    is_strict: bool = True

    def decode(self, data: bytes) -> Any:
        """Return the value. Raises ValueError for NaN, infinite numbers and repeated keys."""
        return json.loads(data.decode(), parse_constant=_refuse, parse_float=_finite, object_pairs_hook=_make_unique)

    def encode(self, document: Any) -> bytes:
        """Return the text; NaN and infinite numbers are written although JSON does not have them."""
        return json.dumps(document).encode()


def _refuse(word: str) -> NoReturn:
    """Refuse the constants NaN and Infinity, which JSON does not have."""
    raise ValueError(word)


def _finite(text: str) -> float:
    """Convert the text of a number; raise ValueError if it exceeds the range of a float."""
    value = float(text)
    if not np.isfinite(value):
        raise ValueError(text)
    return value


def _make_unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the members of a JSON object as a dict; raise ValueError for a repeated key."""
    if len(dict(pairs)) != len(pairs):
        raise ValueError("a repeated key")
    return dict(pairs)


@dataclass(frozen=True)
class GzipJsonLines:
    """Lines of JSON, compressed by gzip."""

    is_strict: bool = True

    def decode(self, data: bytes) -> Any:
        """Return the value of each line."""
        return [Json().decode(line) for line in gzip.decompress(data).splitlines()]

    def encode(self, document: Any) -> bytes:
        """Return the compressed text with one line per value."""
        return gzip.compress(b"".join(Json().encode(line) + b"\n" for line in document), 1, mtime=0)


@dataclass(frozen=True)
class Csv:
    """Tables of comma-separated values; a document is a list of rows of strings."""

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the rows that are not empty."""
        return [row for row in csv.reader(io.StringIO(data.decode(), newline=""), strict=True) if row]

    def encode(self, document: Any) -> bytes:
        """Return the CSV text of a list of rows."""
        text = io.StringIO(newline="")
        csv.writer(text, lineterminator="\n").writerows([[_convert_entry(entry) for entry in row] for row in document])
        return text.getvalue().encode()


def _convert_entry(value: Any) -> Any:
    """Return the value of a table entry; a list or a table becomes its text."""
    return value if isinstance(value, str | int | float) else ascii(value)


@dataclass(frozen=True)
class Words:
    """Texts of lines of words, such as OBJ, XYZ and the text forms of STL, PLY and PCD."""

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the words of each line."""
        return [line.split() for line in data.decode().splitlines()]

    def encode(self, document: Any) -> bytes:
        """Return the text of a list of lines, each a list of words that are separated by spaces."""
        return (
            "\n".join(" ".join(map(str, line if isinstance(line, list) else [line])) for line in document).encode()
            + b"\n"
        )
