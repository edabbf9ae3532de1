"""What can go wrong with a recording."""

from taxel.errors import TaxelError


class RecordingError(TaxelError):
    """A recording cannot be found, read, laid over a hand or replayed."""


class DatasetError(RecordingError):
    """A grasp dataset that cannot be read, or cannot be written as asked.

    Prints as ``file: field: expected ..., found ...; what to do`` on one line.

    Attributes:
        file: the dataset.
        field: HDF5 path of the array, group or attribute, such as ``/grasps/0003/raw_counts``; ``/`` is the file.
        expected: what should stand there.
        found: what stands there.
        remedy: what to do about it.
    """

    def __init__(self, file: str, field: str, expected: str, found: str, remedy: str) -> None:
        # All five are args, so that the error survives pickling between processes.
        super().__init__(file, field, expected, found, remedy)
        self.file = file
        self.field = field
        self.expected = expected
        self.found = found
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.file}: {self.field}: expected {self.expected}, found {self.found}; {self.remedy}"
