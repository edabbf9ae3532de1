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
    """Return the mapping that imports a LeRobot dataset. Raises DatasetError for an unknown column.

    column: feature with the values of the taxels. source: "real" or "sim". components: number of values of each taxel,
    1 or 3. elements: first and last element of the feature that are used; None: all. labels: labels of all contacts; if
    they contain no object, the description of the task is the label of the object.
    """
    opened = open_source(folder)
    opened.find(column)
    constant_labels = labels or Labels()
    used = None if elements is None else tuple(range(elements[0], elements[1] + 1))
    return Mapping(
        source=source,
        times=Times(opened.find(TIME).name),
        values=Values(Selection(Location(str(folder)).key(column), (column,), elements=used), components),
        sensor=column,
        properties=properties or Properties(),
        grouping=Grouping(opened.find(EPISODE).name),
        labels=constant_labels,
        label_fields={"object": TASK} if constant_labels.object is None and TASK in opened.fields else {},
    )
