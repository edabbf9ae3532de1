"""Files of test results, which are written completely or not at all."""

import os

from taxel import output
from taxel.hand.errors import format_path
from taxel_tools.testing.errors import ResultFileError


def write_whole(path: str | os.PathLike[str], data: bytes, overwrite: bool) -> None:
    """Write a file completely or not at all, as `taxel.output.write_whole`.

    Raises `ResultFileError` if the file exists and `overwrite` is False, if another program writes it, or if the system
    refuses; an existing file stays unchanged.
    """
    try:
        output.write_whole(path, data, overwrite=overwrite)
    except output.OutputError as error:
        raise ResultFileError(*error.args) from None
    except OSError as error:
        reason = error.strerror or type(error).__name__
        remedy = "check the folder and its permissions"
        raise ResultFileError(format_path(path), "file", "a writable file", reason, remedy) from None
