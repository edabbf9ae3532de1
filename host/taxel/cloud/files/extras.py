"""What a contact cloud knows beyond its points, as columns and comments of a file that can hold them.

Comments ``taxel.approach ROW NAME`` and ``taxel.grasp ROW APPROACH_ROW ID`` name the rows that the column ``grasp``
holds. A file of another program has none: then all points are of one grasp.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files.source import Source, natural, shown, whole

Columns = Mapping[str, npt.NDArray[np.float64]]

APPROACH: Final = "taxel.approach"
GRASP: Final = "taxel.grasp"

PREFIX: Final = "scalar_"
"""CloudCompare writes it before the names of scalars."""

SILENT: Final = "silent"
"""Name of the rows x, y, z, grasp of taxels that felt nothing, where a format has rows of several kinds."""

LONGEST_NAME: Final = 200
MOST_NAMES: Final = 100_000


@dataclass(frozen=True)
class Names:
    """grasps: ids. approach: row in `approaches` of each grasp."""

    grasps: tuple[str, ...]
    approach: tuple[int, ...]
    approaches: tuple[str, ...]


def comments_of(cloud: ContactCloud) -> list[str]:
    """Lines that name the approaches and grasps; none for a cloud that has no names."""
    if not any(cloud.grasps):
        return []
    lines = [f"{APPROACH} {row} {_plain(name)}" for row, name in enumerate(cloud.approaches)]
    rows = zip(cloud.grasp_approach.tolist(), cloud.grasps, strict=True)
    return lines + [f"{GRASP} {row} {approach} {_plain(name)}" for row, (approach, name) in enumerate(rows)]


def names_of(source: Source, comments: Sequence[str]) -> Names | None:
    """The names that comments hold; None without any. Fails for rows that are not there or not in order."""
    approaches: list[str] = []
    grasps: list[str] = []
    rows: list[int] = []
    for line in comments:
        key, _, rest = line.partition(" ")
        if key == APPROACH:
            row, _, name = rest.partition(" ")
            _check_row(source, row, len(approaches), line)
            approaches.append(name[:LONGEST_NAME])
        elif key == GRASP:
            row, _, rest = rest.partition(" ")
            approach, _, name = rest.partition(" ")
            _check_row(source, row, len(grasps), line)
            number = natural(approach)
            if number is None or number >= len(approaches):
                source.fail("comment", "an approach that stands above", shown(line), "correct it")
            grasps.append(name[:LONGEST_NAME])
            rows.append(number)
    return Names(tuple(grasps), tuple(rows), tuple(approaches)) if grasps else None


def extra_columns(cloud: ContactCloud) -> tuple[list[str], npt.NDArray[np.float64]]:
    """Names and numbers, f64[N, k]: x, y, z; counts, grasp, taxel where they are known."""
    names, columns = ["x", "y", "z"], [*cloud.points.T]
    if len(cloud) and not np.isnan(cloud.counts).any():
        names.append("counts")
        columns.append(cloud.counts)
    if any(cloud.grasps):
        names += ["grasp", "taxel"]
        columns += [cloud.grasp.astype(np.float64), cloud.taxel.astype(np.float64)]
    return names, np.column_stack(columns)


def cloud_of_columns(source: Source, columns: Columns, names: Names | None) -> ContactCloud:
    """The cloud of named columns. Fails without x, y, z."""
    known = {name.removeprefix(PREFIX): column for name, column in columns.items()}
    points = places(source, known)
    plain = ContactCloud.of_points(points, known.get("counts"), source.name)
    if names is None or "grasp" not in known:
        return plain
    taxel = whole(known["taxel"], source, "taxel") if "taxel" in known else plain.taxel
    grasp = whole(known["grasp"], source, "grasp")
    return ContactCloud(
        source.name, points, plain.counts, grasp, taxel, names.grasps, np.array(names.approach), names.approaches
    )


def silent_columns(cloud: ContactCloud) -> npt.NDArray[np.float64]:
    """x, y, z and grasp of what felt nothing, f64[M, 4]; none of a cloud that has no names."""
    rows = np.column_stack([cloud.quiet, cloud.quiet_grasp.astype(np.float64)])
    return np.asarray(rows[: len(rows) if any(cloud.grasps) else 0])


def with_silent(source: Source, cloud: ContactCloud, columns: Columns) -> ContactCloud:
    """The cloud and what felt nothing in its grasps. Fails without x, y, z, grasp."""
    if "grasp" not in columns:
        source.fail(SILENT, "x, y, z and grasp", "no grasp", "use the whole file")
    grasp = whole(columns["grasp"], source, f"{SILENT} grasp")
    return replace(cloud, quiet=places(source, columns), quiet_grasp=grasp)


def places(source: Source, columns: Columns) -> npt.NDArray[np.float64]:
    """The columns x, y and z, f64[N, 3]. Fails without them."""
    missing = [axis for axis in "xyz" if axis not in columns]
    if missing:
        source.fail("points", "x, y and z", f"no {missing[0]}", "use a file of points")
    return np.column_stack([columns[axis] for axis in "xyz"])


def _check_row(source: Source, row: str, expected: int, line: str) -> None:
    if row != str(expected) or expected >= MOST_NAMES:
        source.fail("comment", f"row {expected}, at most {MOST_NAMES}", shown(line), "correct it")


def _plain(name: str) -> str:
    """A name on one line."""
    return "".join(letter if letter.isprintable() and letter.isascii() else "?" for letter in name)[:LONGEST_NAME]
