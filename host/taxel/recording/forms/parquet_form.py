"""A recording as Parquet: a row for each frame, its counts as a list. Needs pyarrow (pip install 'taxel[parquet]')."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from taxel.errors import TaxelError
from taxel.hand import Hand
from taxel.recording.forms.frame_table import checked_frame, fail, header_text, parse_header
from taxel.stream import TaxelFrame
from taxel.stream.encoder import FramesLink

ROWS_AT_ONCE = 4096
METADATA_KEY = b"taxel"


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise TaxelError("Parquet needs pyarrow, which is not installed: pip install 'taxel[parquet]'") from None
    return pyarrow, pyarrow.parquet


def _schema(arrow: Any) -> Any:
    return arrow.schema(
        [
            ("time_s", arrow.float64()),
            ("address", arrow.uint8()),
            ("name", arrow.dictionary(arrow.int32(), arrow.string())),
            ("sequence", arrow.uint16()),
            ("cycle", arrow.uint16()),
            ("board_time_us", arrow.uint32()),
            ("hub_time_us", arrow.uint32()),
            ("raw_counts", arrow.list_(arrow.uint16())),
        ]
    )


class ParquetSink:
    """Writes a Parquet file, row group by row group; it stands under another name until it is whole."""

    def __init__(self, path: Path, hand: Hand, header: Mapping[str, Any]) -> None:
        self._arrow, parquet = _pyarrow()
        self._path = path
        self._part = path.with_name(f".{path.name}.part")
        self._schema = _schema(self._arrow)
        text = header_text(header).encode()
        self._writer = parquet.ParquetWriter(self._part, self._schema.with_metadata({METADATA_KEY: text}))
        self._names = {board.address: board.name for board in hand.boards}
        self._rows: list[TaxelFrame] = []

    def take(self, frame: TaxelFrame) -> None:
        """Append a row."""
        self._rows.append(frame)
        if len(self._rows) >= ROWS_AT_ONCE:
            self._write()

    def _write(self) -> None:
        columns: dict[str, Any] = {name: [getattr(frame, name) for frame in self._rows] for name in self._schema.names
                                   if name != "name"}  # fmt: skip
        columns["name"] = [self._names[frame.address] for frame in self._rows]
        arrays = [self._arrow.array(columns[name], self._schema.field(name).type) for name in self._schema.names]
        self._writer.write_table(self._arrow.Table.from_arrays(arrays, schema=self._schema))
        self._rows.clear()

    def close(self, is_whole: bool) -> None:
        """Write what is left and give the file its name."""
        try:
            if is_whole and self._rows:
                self._write()
            self._writer.close()
            if is_whole:
                os.replace(self._part, self._path)
        finally:
            self._part.unlink(missing_ok=True)


def open_parquet(path: Path) -> FramesLink:
    """The recording in a Parquet file. Raises RecordingFormError for what is not one."""
    arrow, parquet = _pyarrow()
    try:
        file = parquet.ParquetFile(path)
    except (arrow.ArrowException, OSError) as error:
        fail(path, "file", "a whole Parquet file", str(error).partition("\n")[0][:80], "give one of taxel convert")
    metadata = file.schema_arrow.metadata or {}
    if METADATA_KEY not in metadata:
        fail(path, "metadata", "the header that taxel convert writes", "none", "give a file that it made")
    missing = set(_schema(arrow).names) - set(file.schema_arrow.names)
    if missing:
        fail(path, "columns", ", ".join(_schema(arrow).names), f"no {min(missing)}", "keep the columns")
    link = FramesLink(os.fspath(path), _frames(path, file))
    link.header = parse_header(metadata[METADATA_KEY], path)
    return link


def _frames(path: Path, file: Any) -> Iterator[TaxelFrame]:
    number = 0
    with file:
        for batch in file.iter_batches(batch_size=ROWS_AT_ONCE):
            for row in batch.to_pylist():
                number += 1
                empty = [name for name, value in row.items() if value is None]
                if empty:
                    fail(path, f"row {number}, {empty[0]}", "a value", "none", "correct the row")
                yield checked_frame(row, row["raw_counts"], path, f"row {number}")
