"""The base of every error that a user of the library may want to catch."""


class TaxelError(Exception):
    """Something that the user can act on. Its text is one line that names the file, port, board or field, and what to
    do.
    """


class FieldError(TaxelError):
    """Something in a file that cannot be used.

    Prints as ``file: field: expected ..., found ...; what to do`` on one line.

    Attributes:
        file: the file, or what was asked for where there is none.
        field: the place in it, such as ``boards[3].address`` or ``/grasps/0003/phase``; ``file`` or ``/`` means all.
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
