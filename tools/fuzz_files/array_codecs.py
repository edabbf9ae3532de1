"""Codecs of files of arrays and tables: HDF5, NumPy, Parquet and SQLite."""

from __future__ import annotations

import io
import sqlite3
import warnings
import zipfile
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
import pyarrow
import pyarrow.parquet


@dataclass(frozen=True)
class Hdf5:
    """HDF5 files. A document maps paths to datasets, and "path@name" to attributes."""

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the datasets by path, and the attributes by "path@name"."""
        document: dict[str, Any] = {}

        def add(name: str, item: Any) -> None:
            """Add the attributes of one group or dataset, and the content of a dataset."""
            for key, value in item.attrs.items():
                document[f"{name}@{key}"] = _simplify(value)
            if isinstance(item, h5py.Dataset):
                is_text = h5py.check_string_dtype(item.dtype) is not None
                document[name] = _read_text(item) if is_text else item[()]

        with h5py.File(io.BytesIO(data), "r") as file:
            add("", file)
            file.visititems(add)
        return document

    def encode(self, document: Any) -> bytes:
        """Return the bytes of an HDF5 file with these datasets and attributes.

        document: datasets by path, and attributes by "path@name". Raises ValueError for a dataset at a path that an
        earlier entry has already created.
        """
        target = io.BytesIO()
        with h5py.File(target, "w") as file:
            for name, value in document.items():
                group, at, key = name.partition("@")
                if at:
                    place = file[group] if group in file else file.require_group(group or "/")
                    place.attrs[key] = value
                elif name in file:
                    raise ValueError("exists")
                else:
                    file[name] = value
        return target.getvalue()


def _read_text(dataset: Any) -> Any:
    """Return the content of a dataset of strings: one string, or a list of strings."""
    texts = dataset.asstr()[()]
    return texts if isinstance(texts, str) else list(texts)


def _simplify(value: Any) -> Any:
    """Return a NumPy scalar as a Python scalar, and any other value unchanged."""
    return value.item() if isinstance(value, np.generic) else value


@dataclass(frozen=True)
class Npz:
    """NumPy archives; a document has arrays by name."""

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the arrays by name."""
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}

    def encode(self, document: Any) -> bytes:
        """Return the bytes of a NumPy archive of the values, by name.

        A value that is not an array of numbers or strings is stored as a pickled object.
        """
        return encode_npz({name: np.asarray(value, dtype=_choose_type(value)) for name, value in document.items()})


def encode_npz(arrays: dict[str, Any]) -> bytes:
    """Return the bytes of an uncompressed NumPy archive. arrays: by name."""
    target = io.BytesIO()
    np.savez(target, **arrays)
    return target.getvalue()


def _choose_type(value: Any) -> Any:
    """Return the NumPy type of a value; object for a value from which NumPy cannot make an array of scalars."""
    try:
        return np.asarray(value).dtype
    except (ValueError, OverflowError):
        return object


@dataclass(frozen=True)
class Zip:
    """ZIP archives as a list of members and their bytes.

    As a model of a NumPy archive it mutates the headers of the arrays; the members' CRCs are recomputed.
    """

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the name and the bytes of each member."""
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return [{"name": name, "data": archive.read(name)} for name in archive.namelist()]

    def encode(self, document: Any) -> bytes:
        """Return the bytes of a compressed ZIP archive. document: list of members with `name` and `data`."""
        target = io.BytesIO()
        with (
            warnings.catch_warnings(),
            zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        ):
            warnings.simplefilter("ignore")  # a repeated name is a mutation
            for member in document:
                archive.writestr(member["name"], member["data"])
        return target.getvalue()


@dataclass(frozen=True)
class Parquet:
    """Parquet files: columns of Python values, and metadata strings by key.

    Arrow derives the type of a column from its values.
    """

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the columns and the metadata of a Parquet file."""
        table = pyarrow.parquet.read_table(pyarrow.BufferReader(data))
        metadata = {key.decode(): value.decode() for key, value in (table.schema.metadata or {}).items()}
        return {"columns": {name: table.column(name).to_pylist() for name in table.column_names}, "metadata": metadata}

    def encode(self, document: Any) -> bytes:
        """Return the bytes of a Parquet file with these columns and metadata.

        Raises ValueError for lists that are nested thirty times or more.
        """
        if any(_is_deep(values) for values in document["columns"].values()):
            raise ValueError("Arrow takes seconds for hundreds of levels")
        columns = {name: pyarrow.array(values) for name, values in document["columns"].items()}
        table = pyarrow.table(columns).replace_schema_metadata(document["metadata"])
        target = io.BytesIO()
        pyarrow.parquet.write_table(table, target)
        return target.getvalue()


def _is_deep(values: Any) -> bool:
    """Return whether `values` is a list whose first elements are lists down to a depth of thirty or more."""
    for _ in range(30):
        if not isinstance(values, list) or not values:
            return False
        values = values[0]
    return True


@dataclass(frozen=True)
class Sqlite:
    """SQLite databases: settings, statements of the schema, and rows of each table."""

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the settings, the statements of the schema, and the rows of each table of an SQLite database."""
        connection = sqlite3.connect(":memory:")
        try:
            connection.deserialize(data)
            schema = [row[0] for row in connection.execute("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL")]
            names = [row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
            rows = {name: [list(row) for row in connection.execute(f'SELECT * FROM "{name}"')] for name in names}
            settings = {
                name: connection.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version")
            }
            return {"settings": settings, "schema": schema, "rows": rows}
        finally:
            connection.close()

    def encode(self, document: Any) -> bytes:
        """Return the bytes of an SQLite database, made by executing the schema and inserting the rows."""
        connection = sqlite3.connect(":memory:", isolation_level=None)
        try:
            for statement in document["schema"]:
                connection.execute(statement)
            for name, rows in document["rows"].items():
                for row in rows:
                    connection.execute(f'INSERT INTO "{name}" VALUES ({",".join("?" * len(row))})', row)
            for name, value in document["settings"].items():
                connection.execute(f"PRAGMA {name} = {int(value)}")
            return connection.serialize()
        finally:
            connection.close()
