"""LeRobotDataset v2.1 and v3: one feature of the dataset is the tactile data; an episode is a contact.

The layout and its origin are in `taxel.recording.importers.source_lerobot`.
"""

from __future__ import annotations

from pathlib import Path

from taxel.recording.general.format import Properties
from taxel.recording.grasp_checks import Location
from taxel.recording.importers.mapping import Grouping, Labels, Mapping, Selection, Times, Values
from taxel.recording.importers.source_lerobot import EPISODE, TASK, TIME
from taxel.recording.importers.sources import open_source


def make_lerobot_mapping(
    folder: Path,
    column: str,
    source: str = "real",
    components: int = 1,
    elements: tuple[int, int] | None = None,
    labels: Labels | None = None,
    properties: Properties | None = None,
) -> Mapping:
    """Return the mapping of a LeRobot dataset. Raises DatasetError for an unknown column.

    column: feature with the values. elements: first and last element of the feature that are used; None: all. labels:
    constant labels; without an object, the text of the task is the object.
    """
    opened = open_source(folder)
    opened.find(column)
    own = labels or Labels()
    used = None if elements is None else tuple(range(elements[0], elements[1] + 1))
    return Mapping(
        source=source,
        times=Times(opened.find(TIME).name),
        values=Values(Selection(Location(str(folder)).key(column), (column,), elements=used), components),
        sensor=column,
        properties=properties or Properties(),
        grouping=Grouping(opened.find(EPISODE).name),
        labels=own,
        label_fields={"object": TASK} if own.object is None and TASK in opened.fields else {},
    )
