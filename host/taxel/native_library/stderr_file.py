"""Standard error of C code, captured in a file."""

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def redirected_stderr(path: Path) -> Iterator[None]:
    """Within the `with` block, send the standard error of the process to the file `path`.

    The file descriptor is redirected, because C code writes to this descriptor and not to `sys.stderr`.
    """
    sys.stderr.flush()
    saved = os.dup(2)
    target = os.open(path, os.O_WRONLY | os.O_CREAT, 0o600)
    os.dup2(target, 2)
    os.close(target)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)


def emulator_message(stderr: str, path: str, world: str) -> str:
    """Return the last line that the emulator printed on standard error, readable without its temporary world file.

    stderr: all printed text. path: path of the temporary world file; the word "file" replaces it. world: text of the
    world file. If the message contains the number of a line of the world file, the line is quoted after the message. If
    nothing was printed, the cause is assumed to be a lack of memory.
    """
    lines = stderr.strip().splitlines()
    if not lines:
        return "the library has no memory"
    text = lines[-1].replace(path, "file")
    number, world_lines = re.search(r", line (\d+)", text), world.splitlines()
    if number is None or not 1 <= int(number[1]) <= len(world_lines):
        return text
    return f"{text} (found '{world_lines[int(number[1]) - 1]}')"
