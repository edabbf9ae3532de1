"""A writer as a case of the fault campaign, and the two usual kinds of cases."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from pathlib import Path

Acknowledge = Callable[[], None]
"""Called by a case when a record is complete: from then on it must not be lost."""


@dataclass(frozen=True)
class Case:
    """A writer.

    Attributes:
        name: for the table and the command line.
        guarantee: "whole" (the old or the new output), "live" (all complete records) or "append" (all complete
            records, old and new).
        prepare: writes the old output into a folder; the argument is the capture that conversions read.
        run: writes the new output into the folder, and calls its last argument after each complete record.
        read: content of the output in the folder, as a value that can be compared; raises if it is unreadable.
        names: names in the folder after a complete run.
    """

    name: str
    guarantee: str
    prepare: Callable[[Path, Path], None]
    run: Callable[[Path, Path, Acknowledge], None]
    read: Callable[[Path], Hashable]
    names: tuple[str, ...]


def make_whole_case(
    name: str, file: str, write: Callable[[Path, bool], None], read: Callable[[Path], Hashable]
) -> Case:
    """Create the case of a writer that replaces a file: after a crash, the file has its old or its new content.

    write: called with the path, and whether it writes the new content. read: called with the path.
    """

    def run(folder: Path, source: Path, acknowledge: Acknowledge) -> None:
        write(folder / file, True)
        acknowledge()

    return Case(
        name, "whole", lambda folder, source: write(folder / file, False), run, lambda at: read(at / file), (file,)
    )


def make_live_case(name: str, file: str, write: Callable[..., None], read: Callable[[Path], Hashable]) -> Case:
    """Create the case of a recording that replaces another one: after a crash, all complete records are readable.

    write: called with the path and the number of the first record: 0 for the old recording, 10 for the new one. For
    the new one, `write` also receives the function that it calls after each complete record.
    """
    return Case(
        name, "live", lambda folder, source: write(folder / file, 0),
        lambda folder, source, acknowledge: write(folder / file, 10, acknowledge), lambda at: read(at / file), (file,),
    )  # fmt: skip
