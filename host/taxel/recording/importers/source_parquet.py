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

    path, kind: path and type of the source in error messages. Only columns of numbers, times, strings and lists of
    numbers become fields. Raises DatasetError for damaged files, different columns, and a table without rows.
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
    """Return the field with the shape of its column: number of rows, and shape of the list in the file's first row."""
    import pyarrow.parquet as parquet

    with parquet.ParquetFile(file) as opened:
        batch = next(opened.iter_batches(batch_size=1, columns=[field.name]), None)
    value = batch.column(0)[0].as_py() if batch is not None and len(batch) else None
    inner = np.shape(value) if isinstance(value, list) and field.is_numeric else ()
    return Field(field.name, (rows, *inner), field.dtype, field.load)


def _is_readable(arrow_type: Any) -> bool:
    """Whether an Arrow column type is numbers, strings, times, or lists of numbers or times."""
    import pyarrow.types as types

    if types.is_list(arrow_type) or types.is_large_list(arrow_type) or types.is_fixed_size_list(arrow_type):
        return _is_readable(arrow_type.value_type) and not _is_text(arrow_type.value_type)
    if hasattr(arrow_type, "storage_type"):
        return _is_readable(arrow_type.storage_type)
    is_number = types.is_integer(arrow_type) or types.is_floating(arrow_type) or types.is_boolean(arrow_type)
    return bool(is_number or types.is_timestamp(arrow_type)) or _is_text(arrow_type)


def _is_text(arrow_type: Any) -> bool:
    """Whether an Arrow column type is strings, plain or dictionary-encoded."""
    import pyarrow.types as types

    if types.is_dictionary(arrow_type):
        return _is_text(arrow_type.value_type)
    return bool(types.is_string(arrow_type) or types.is_large_string(arrow_type))


def _describe_type(arrow_type: Any) -> str:
    """Return the name of a column's element type, such as "float"; "text" for strings."""
    while hasattr(arrow_type, "value_type") or hasattr(arrow_type, "storage_type"):
        arrow_type = arrow_type.value_type if hasattr(arrow_type, "value_type") else arrow_type.storage_type
    return "text" if _is_text(arrow_type) else str(arrow_type)


def _make_loader(files: Sequence[Path], name: str) -> Any:
    """Return a function that reads the column `name` of all files."""

    def load() -> NDArray[Any]:
        """Read the column of all files, one after the other, as one array. Raises DatasetError."""
        import pyarrow.parquet as parquet

        arrays = []
        for file in files:
            location = Location(str(file)).key(name)
            try:
                with parquet.ParquetFile(file) as opened:
                    column = opened.read(columns=[name]).column(0).combine_chunks()
            except Exception as error:  # as in open_tables
                location.fail("a readable column", format_value(str(error).partition("\n")[0]), "write it again")
            arrays.append(_convert_column(column, location))
        if len({array.shape[1:] for array in arrays}) > 1:
            Location(str(files[0])).key(name).fail("lists of one length in all files", "several", "import separately")
        return np.concatenate(arrays)

    return load


def _convert_column(column: Any, location: Location) -> NDArray[Any]:
    """Convert an Arrow column to an array [row, ...].

    Times become integers in nanoseconds, booleans become 0 and 1, and missing strings become "". Raises DatasetError
    for lists of different lengths.
    """
    import pyarrow
    import pyarrow.compute as compute
    import pyarrow.types as types

    if isinstance(column, pyarrow.ChunkedArray):
        column = column.combine_chunks()
    if isinstance(column, pyarrow.ExtensionArray):
        column = column.storage
    arrow_type = column.type
    if types.is_list(arrow_type) or types.is_large_list(arrow_type) or types.is_fixed_size_list(arrow_type):
        lengths = set(compute.unique(compute.list_value_length(column)).to_pylist())
        if len(lengths) != 1 or None in lengths:
            found = ", ".join(str(length) for length in list(lengths)[:4])
            location.fail("a list of one length in every row", f"lengths {found}", "correct or remove those rows")
        inner = _convert_column(compute.list_flatten(column), location)
        return inner.reshape(len(column), lengths.pop(), *inner.shape[1:])
    if types.is_dictionary(arrow_type):
        column = column.dictionary_decode()
    if types.is_timestamp(arrow_type):
        column = column.cast(pyarrow.timestamp("ns")).cast(pyarrow.int64())
    if types.is_boolean(arrow_type):
        column = column.cast(pyarrow.uint8())
    if _is_text(arrow_type):
        return np.array(["" if text is None else text for text in column.to_pylist()], dtype=str)
    return np.asarray(column.to_numpy(zero_copy_only=False))
