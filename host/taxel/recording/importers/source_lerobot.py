"""Folders of LeRobotDataset v2.1 (one Parquet file for each episode) and v3 (several episodes in a file).

Layout: huggingface/lerobot, and the blog page lerobot-datasets-v3.md of huggingface/blog. ``meta/info.json`` has the
key codebase_version; the tables are data/chunk-NNN/episode_NNNNNN.parquet (v2.1) or data/chunk-NNN/file-NNN.parquet
(v3), with the columns timestamp (seconds from the start of the episode), frame_index, episode_index, task_index, and
the features. The descriptions of the tasks are in meta/tasks.jsonl (v2.1) or meta/tasks.parquet (v3); this module adds
the field ``task``, which contains the description of the task in each row.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.input_files import TextError, parse_json, read_regular_file
from taxel.input_files.json_text import JSON_BYTES_MAX
from taxel.recording.grasp_checks import Location
from taxel.recording.importers.fields import Field, Source
from taxel.recording.importers.source_parquet import open_tables

EPISODE, TIME, TASK_INDEX, TASK = "episode_index", "timestamp", "task_index", "task"

_LARGEST_TASK: Final = 1e9
"""Largest number of a task that is accepted."""

_VERSIONS: Final = {"v2.": "episode_*.parquet", "v3.": "file-*.parquet"}
"""Pattern of the data files, by the start of the dataset's version."""


def open_file(path: Path) -> Source:
    """Open the tables of a LeRobot dataset as one table. Raises DatasetError."""
    location = Location(str(path / "meta/info.json"))
    info = _read_json(path / "meta/info.json", location)
    version = str(info.get("codebase_version", "")) if isinstance(info, dict) else ""
    pattern = next((name for start, name in _VERSIONS.items() if version.startswith(start)), None)
    if pattern is None:
        remedy = "convert the dataset with the scripts of lerobot"
        location.key("codebase_version").fail("v2.0, v2.1 or v3.0", format_value(version), remedy)
    files = sorted((path / "data").glob(f"chunk-*/{pattern}"))
    if not files:
        remedy = "download the folder data/ completely"
        Location(str(path / "data")).fail(f"files chunk-*/{pattern}", "none", remedy)
    source = open_tables(path, files, f"LeRobot dataset {version}")
    fields = dict(source.fields)
    texts = _read_tasks(path)
    if TASK not in fields and TASK_INDEX in fields and texts:
        fields[TASK] = Field(TASK, fields[TASK_INDEX].shape, "text", lambda: _name_tasks(source, texts))
    return Source(path, source.kind, fields, is_table=True)


def _read_json(file: Path, location: Location) -> Any:
    """Read a JSON file. Raises DatasetError."""
    try:
        return parse_json(read_regular_file(file, JSON_BYTES_MAX))
    except (OSError, TextError) as error:
        return location.fail("a JSON file", format_value(str(error)), "download the folder meta/ completely")


def _read_tasks(path: Path) -> dict[int, str]:
    """Read the descriptions of the tasks by number; empty if there are none. Raises DatasetError for damaged files."""
    lines, table = path / "meta/tasks.jsonl", path / "meta/tasks.parquet"
    if lines.is_file():
        location = Location(str(lines))
        try:
            texts = read_regular_file(lines, JSON_BYTES_MAX).splitlines()
            entries = [parse_json(line) for line in texts if line.strip()]
            return {int(entry[TASK_INDEX]): str(entry[TASK]) for entry in entries}
        except (OSError, ValueError, OverflowError, KeyError, TypeError) as error:
            location.fail("one JSON object with task_index and task in each line", format_value(str(error)), "fix it")
    if not table.is_file():
        return {}
    source = open_tables(table, [table], "table of tasks")
    # The text of the task is the index of the table. pandas stores an index as a column with the name of the index, or
    # as __index_level_0__ if the index has no name.
    name = next((name for name in (TASK, "__index_level_0__") if name in source.fields), TASK)
    return dict(zip(_read_task_numbers(source), source.read(name).astype(str).tolist(), strict=True))


def _name_tasks(source: Source, texts: dict[int, str]) -> NDArray[Any]:
    """Return the description of the task in each row of a table; "task 7" for a number without description."""
    return np.array([texts.get(index, f"task {index}") for index in _read_task_numbers(source)])


def _read_task_numbers(source: Source) -> list[int]:
    """Return the number of the task in each row of a table. Raises DatasetError for a value that is no integer."""
    values = source.read_numbers(TASK_INDEX).ravel()
    if not np.isfinite(values).all() or (values != np.round(values)).any() or (np.abs(values) > _LARGEST_TASK).any():
        source.at(TASK_INDEX).fail("the number of a task in each row", "other numbers", "correct the column")
    return [int(value) for value in values]
