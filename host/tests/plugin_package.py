"""A package with entry points, written to a folder and found as if `pip` had installed it."""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from taxel.plugins import refresh_plugins


def write_package(folder: Path, name: str, source: str, entry_points: Mapping[str, Mapping[str, str]]) -> None:
    """Write the module `name`.py and the metadata of an installed package to a folder.

    entry_points: group -> name -> "module:attribute".
    """
    (folder / f"{name}.py").write_text(source)
    metadata = folder / f"{name}-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = []
    for group, points in entry_points.items():
        lines += [f"[{group}]", *(f"{point} = {target}" for point, target in points.items())]
    (metadata / "entry_points.txt").write_text("\n".join(lines) + "\n")


@contextmanager
def installed_package(
    folder: Path, name: str, source: str, entry_points: Mapping[str, Mapping[str, str]]
) -> Iterator[None]:
    """Write a package (`write_package`) and let Python find it, and its entry points, inside the `with` block."""
    write_package(folder, name, source, entry_points)
    sys.path.insert(0, str(folder))
    refresh_plugins()
    try:
        yield
    finally:
        sys.path.remove(str(folder))
        sys.modules.pop(name, None)
        refresh_plugins()
