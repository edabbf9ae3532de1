"""Changes of arrays in a copy of a dataset; all other content of the copy remains unchanged."""

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

PROVENANCE_ATTRIBUTE: Final = "gap_applied"
"""Attribute of the file that states the added effects; further attributes are named gap_applied_2, and so on."""


@contextmanager
def open_temporary_output(target: Path, inputs: tuple[Path, ...], overwrite: bool) -> Iterator[Path]:
    """Yield a temporary path for a new file; at the end of the context, rename the complete file to `target`.

    An existing target remains unchanged if an error occurs. inputs: files that must not be the target. overwrite:
    whether an existing target may be replaced. Raises DatasetError for a target that exists or cannot be written, and
    GapInputError for a target that is one of the inputs.
    """
    location = Location(str(target))
    for path in inputs:
        if target.exists() and path.exists() and target.samefile(path):
            raise GapInputError("--out", "a file other than the inputs", format_path(target), "choose another name")
    check_target(target, overwrite, location)
    with convert_writing_errors(location):
        pending = PendingOutput(target, overwrite=overwrite)
    # The temporary file has the target's name, because a user's simulator may choose the format by the file extension.
    folder = pending.part.with_name(pending.part.name + ".folder")
    temporary = folder / target.name
    try:
        with convert_writing_errors(location):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
        yield temporary
        with convert_writing_errors(location):
            pending.commit(temporary)
    except DatasetError as error:
        if error.file != format_path(temporary):
            raise
        raise DatasetError(format_path(target), *error.args[1:]) from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        pending.discard()


def copy_file(source: str | PathLike[str], target: Path) -> None:
    """Copy the content of a file to `target`. Raises DatasetError if writing fails."""
    with convert_writing_errors(Location(str(target))):
        shutil.copyfile(source, target)


class DatasetEditor:
    """Open dataset whose arrays can be replaced. Use the editor as a context manager."""

    def __init__(self, path: Path) -> None:
        """Open an existing dataset for changes. Raises DatasetError if this fails."""
        self._location = Location(str(path))
        self._output = LiveOutput.without_name(path)
        self._file = extend_hdf5(self._output, self._location)

    def replace_array(self, grasp_id: str, name: str, array: NDArray[Any]) -> None:
        """Replace an array of a grasp; its attributes remain. Raises DatasetError if writing fails.

        An array that other grasps share (hard links) is replaced for this grasp only.
        """
        with convert_writing_errors(self._location.key("grasps").key(grasp_id).key(name)):
            group = self._file["grasps"][grasp_id]
            node = group[name]
            if h5py.h5o.get_info(node.id).rc == 1 and np.can_cast(array.dtype, node.dtype):
                node[...] = array
                self._file.check()
                return
            # The array has several hard links, or its integer type is too narrow for the new values.
            attributes = dict(node.attrs)
            del group[name]
            write_array(group, name, array)
            group[name].attrs.update(attributes)
            self._file.check()

    def add_provenance(self, text: str) -> None:
        """Add a provenance text as a further attribute of the file. Raises DatasetError if writing fails."""
        with convert_writing_errors(self._location):
            number = 1
            while self._get_attribute_name(number) in self._file.attrs:
                number += 1
            self._file.attrs[self._get_attribute_name(number)] = text

    def _get_attribute_name(self, number: int) -> str:
        """Return the attribute name of provenance text `number`, from 1."""
        return PROVENANCE_ATTRIBUTE if number == 1 else f"{PROVENANCE_ATTRIBUTE}_{number}"

    def __enter__(self) -> DatasetEditor:
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file. Raises DatasetError if the remaining changes cannot be written."""
        try:
            with convert_writing_errors(self._location):
                self._file.close()
        finally:
            self._output.file.close()


def has_changed(before: NDArray[Any], after: NDArray[Any]) -> bool:
    """Return whether two arrays differ."""
    return after is not before and not np.array_equal(before, after)
