"""Base classes of the errors of the package."""

from typing import Final, final

LONGEST_MESSAGE: Final = 3000
"""Characters of the longest text of an error, so that a terminal shows it; values of files are shortened before."""


class TaxelError(Exception):
    """Base class of all errors that a user can act on.

    The text is one line that names the file, port, board or field, and the remedy. It is printable and has at most
    LONGEST_MESSAGE characters, whatever values of a file it contains. A subclass overrides `_format_message`.
    """

    @final
    def __str__(self) -> str:
        """Return the text of `_format_message` as one printable line."""
        return fit_line(self._format_message(), LONGEST_MESSAGE)

    def _format_message(self) -> str:
        """Return the text of the error: here the argument of the exception."""
        return super().__str__()


class FieldError(TaxelError):
    """A value in a file is not valid. The text is ``file: field: expected ..., found ...; remedy`` on one line.

    Attributes:
        file: path of the file, or the name of the requested resource if there is no file.
        field: location in the file, such as ``boards[3].address`` or ``/grasps/0003/phase``; ``file`` or ``/``: the
            whole file.
        expected: description of a valid value.
        found: description of the value in the file.
        remedy: instruction for the user.
    """

    def __init__(self, file: str, field: str, expected: str, found: str, remedy: str) -> None:
        """Create the error of a field in a file; the class describes the arguments, which become its attributes."""
        # Pickling between processes calls the constructor with `args`, which must therefore contain all five arguments.
        super().__init__(file, field, expected, found, remedy)
        self.file = file
        self.field = field
        self.expected = expected
        self.found = found
        self.remedy = remedy

    def _format_message(self) -> str:
        """Format the error as one line: file, field, expected and found values, remedy."""
        field, expected, found, remedy = map(fit_line, (self.field, self.expected, self.found, self.remedy))
        return f"{fit_line(self.file, 1000)}: {field}: expected {expected}, found {found}; {remedy}"


def fit_line(text: object, longest: int = 400) -> str:
    """Return `text` as one printable line of at most `longest` characters and "...", for an error message.

    Line ends and tabs become spaces, and characters that are not printable become "?": a message may contain values of
    a file.
    """
    line = " ".join(part.strip() for part in str(text).expandtabs(1).splitlines())
    shortened = line if len(line) <= longest else line[:longest] + "..."
    return "".join(character if character.isprintable() else "?" for character in shortened)
