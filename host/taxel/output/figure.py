"""Pictures of matplotlib that are written completely or not at all."""

import io
import os
from pathlib import Path
from typing import Any

from taxel.output.whole import write_whole


def save_figure(figure: Any, path: str | os.PathLike[str], **options: Any) -> None:
    """Write a figure of matplotlib to an image file; the ending of the name selects the format, PNG without an ending.

    options: further arguments of `Figure.savefig`. Raises the errors of `write_whole`.
    """
    picture = io.BytesIO()
    figure.savefig(picture, **{"format": Path(path).suffix.removeprefix(".") or "png", **options})
    write_whole(path, picture.getvalue())
