"""A dataset that is a changed copy of another: everything stays but some grasps' counts and which frames arrived."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any, Final

import h5py  # type: ignore[import-untyped, unused-ignore]
import numpy as np
from numpy.typing import NDArray

from taxel.gap.errors import GapInputError
from taxel.hand.errors import format_path
from taxel.output import LiveOutput, PendingOutput
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_storage import check_target, convert_writing_errors, write_array
from taxel.recording.hdf5_output import extend_hdf5

NOTE: Final = "gap_applied"
"""Attribute of the file that says what was added; a second one is called gap_applied_2, and so on."""


@contextmanager
def made_beside(target: Path, inputs: tuple[Path, ...], overwrite: bool) -> Iterator[Path]:
    """A path in a folder beside the target, for a file that takes the target's name once it is whole.

    Whatever fails, a target that was there stays as it was. Raises DatasetError for a target that must not or cannot
    be made, and GapInputError for one that is among the inputs.
    """
    place = Location(str(target))
    for path in inputs:
        if target.exists() and path.exists() and target.samefile(path):
            raise GapInputError("--out", "another file than the inputs", format_path(target), "choose another name")
    check_target(target, overwrite, place)
    with convert_writing_errors(place):
        pending = PendingOutput(target, overwrite=overwrite)
    # A user's simulator creates its file itself and may need the ending of the target's name.
    folder = pending.part.with_name(pending.part.name + ".folder")
    whole = folder / target.name
    try:
        with convert_writing_errors(place):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
        yield whole
        with convert_writing_errors(place):
            pending.commit(whole)
    except DatasetError as error:
        if error.file != format_path(whole):
            raise
        raise DatasetError(format_path(target), *error.args[1:]) from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        pending.discard()


def copied(source: str | PathLike[str], target: Path) -> None:
    """Copy a file, bit for bit. Raises DatasetError where the disk refuses."""
    with convert_writing_errors(Location(str(target))):
        shutil.copyfile(source, target)


class Rewriting:
    """An open copy in which arrays of grasps are replaced. Use it as a context manager."""

    def __init__(self, path: Path) -> None:
        self._place = Location(str(path))
        self._output = LiveOutput.without_name(path)
        self._file = extend_hdf5(self._output, self._place)

    def put(self, grasp_id: str, name: str, array: NDArray[Any]) -> None:
        """Replace an array of a grasp; its attributes stay. Raises DatasetError where the disk refuses."""
        with convert_writing_errors(self._place.key("grasps").key(grasp_id).key(name)):
            group = self._file["grasps"][grasp_id]
            node = group[name]
            if h5py.h5o.get_info(node.id).rc == 1 and np.can_cast(array.dtype, node.dtype):
                node[...] = array
                self._file.check()
                return
            # It stands in several places, or holds narrower integers.
            notes = dict(node.attrs)
            del group[name]
            write_array(group, name, array)
            group[name].attrs.update(notes)
            self._file.check()

    def note(self, text: str) -> None:
        """Say in the file's attributes what was done to it."""
        with convert_writing_errors(self._place):
            number = 1
            while self._name(number) in self._file.attrs:
                number += 1
            self._file.attrs[self._name(number)] = text

    def _name(self, number: int) -> str:
        return NOTE if number == 1 else f"{NOTE}_{number}"

    def __enter__(self) -> Rewriting:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            with convert_writing_errors(self._place):
                self._file.close()
        finally:
            self._output.file.close()


def changed(before: NDArray[Any], after: NDArray[Any]) -> bool:
    """Whether an array is to be written."""
    return after is not before and not np.array_equal(before, after)
