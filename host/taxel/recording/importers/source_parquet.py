"""Parquet tables; a column of lists of equal length is an array [row, element]. Needs pyarrow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.optional import optional_import
from taxel.recording.grasp_checks import Location
from taxel.recording.importers.fields import Field, Source


def open_file(path: Path) -> Source:
    """Open a Parquet file; columns are read on first use. Raises DatasetError, and MissingPackageError."""
    return open_tables(path, [path], "Parquet table")


def open_tables(path: Path, files: Sequence[Path], kind: str) -> Source:
    """Open Parquet files with equal columns as one table: the rows of the files in the given order.

    path: for messages. Columns of another type than numbers, texts and lists of numbers are left out.
    """
    with optional_import("pyarrow", "a Parquet table"):
        import pyarrow.parquet as parquet
    fields: dict[str, Field] = {}
    rows = 0
    for file in files:
        location = Location(str(file))
        try:
            with parquet.ParquetFile(file) as opened:
                schema, count = opened.schema_arrow, opened.metadata.num_rows
        except Exception as error:  # pyarrow raises several types for a damaged file
            location.fail("a Parquet table", format_value(str(error).partition("\n")[0]), "write the table again")
        rows += count
        names = [entry.name for entry in schema if _is_readable(entry.type)]
        if fields and list(fields) != names:
            location.fail("the columns of the first file", "others", "import files of different columns separately")
        if not fields:
            types = {entry.name: entry.type for entry in schema}
            for name in names:
                fields[name] = Field(name, (), _describe_type(types[name]), _make_loader(files, name))
    if not rows:
        Location(str(path)).fail("rows", "none", "check whether the recording is empty")
    try:
        shaped = {name: _with_shape(field, files[0], rows) for name, field in fields.items()}
    except Exception as error:  # as above
        Location(str(files[0])).fail("readable columns", format_value(str(error).partition("\n")[0]), "write it again")
    return Source(path, kind, shaped, is_table=True)


def _with_shape(field: Field, file: Path, rows: int) -> Field:
    """Add the shape of a column: the number of rows, and the shape of the list in the first row."""
    import pyarrow.parquet as parquet

    with parquet.ParquetFile(file) as opened:
        batch = next(opened.iter_batches(batch_size=1, columns=[field.name]), None)
    value = batch.column(0)[0].as_py() if batch is not None and len(batch) else None
    inner = np.shape(value) if isinstance(value, list) and field.is_numeric else ()
    return Field(field.name, (rows, *inner), field.dtype, field.load)


def _is_readable(kind: Any) -> bool:
    """Whether a column type is numbers, texts, times, or lists of numbers."""
    import pyarrow.types as types

    if types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
        return _is_readable(kind.value_type) and not _is_text(kind.value_type)
    if hasattr(kind, "storage_type"):
        return _is_readable(kind.storage_type)
    return bool(
        types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind) or types.is_timestamp(kind)
    ) or _is_text(kind)


def _is_text(kind: Any) -> bool:
    import pyarrow.types as types

    if types.is_dictionary(kind):
        return _is_text(kind.value_type)
    return bool(types.is_string(kind) or types.is_large_string(kind))


def _describe_type(kind: Any) -> str:
    """Name of the element type of a column."""
    while hasattr(kind, "value_type") or hasattr(kind, "storage_type"):
        kind = kind.value_type if hasattr(kind, "value_type") else kind.storage_type
    return "text" if _is_text(kind) else str(kind)


def _make_loader(files: Sequence[Path], name: str) -> Any:
    """Return a function that reads one column of all files."""

    def load() -> NDArray[Any]:
        import pyarrow.parquet as parquet

        arrays = []
        for file in files:
            location = Location(str(file)).key(name)
            try:
                with parquet.ParquetFile(file) as opened:
                    column = opened.read(columns=[name]).column(0).combine_chunks()
            except Exception as error:  # as in open_tables
                location.fail("a readable column", format_value(str(error).partition("\n")[0]), "write it again")
            arrays.append(_convert(column, location))
        if len({array.shape[1:] for array in arrays}) > 1:
            Location(str(files[0])).key(name).fail("lists of one length in all files", "several", "import separately")
        return np.concatenate(arrays)

    return load


def _convert(column: Any, location: Location) -> NDArray[Any]:
    """Convert a column to an array [row, ...]. Raises DatasetError for lists of different lengths."""
    import pyarrow
    import pyarrow.compute as compute
    import pyarrow.types as types

    if isinstance(column, pyarrow.ChunkedArray):
        column = column.combine_chunks()
    if isinstance(column, pyarrow.ExtensionArray):
        column = column.storage
    kind = column.type
    if types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
        lengths = set(compute.unique(compute.list_value_length(column)).to_pylist())
        if len(lengths) != 1 or None in lengths:
            found = ", ".join(str(length) for length in list(lengths)[:4])
            location.fail("a list of one length in every row", f"lengths {found}", "correct or remove those rows")
        inner = _convert(compute.list_flatten(column), location)
        return inner.reshape(len(column), lengths.pop(), *inner.shape[1:])
    if types.is_dictionary(kind):
        column = column.dictionary_decode()
    if types.is_timestamp(kind):
        column = column.cast(pyarrow.timestamp("ns")).cast(pyarrow.int64())
    if types.is_boolean(kind):
        column = column.cast(pyarrow.uint8())
    if _is_text(kind):
        return np.array(["" if text is None else text for text in column.to_pylist()], dtype=str)
    return np.asarray(column.to_numpy(zero_copy_only=False))
