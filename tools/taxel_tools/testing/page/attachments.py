"""What a phase attached: pictures are shown, short texts folded, and everything else offered to be saved."""

from __future__ import annotations

import base64
from collections.abc import Sequence

from taxel.gap.page.tables import bullets, folded
from taxel.gap.page.text import escaped
from taxel_tools.testing.page.figures import size_words
from taxel_tools.testing.record import Attachment

PICTURES = ("image/png", "image/svg+xml")
"""Shown as <img> alone, where neither can run a script."""
LONGEST_TEXT = 2**16


def attachments_html(attachments: Sequence[Attachment]) -> str:
    """All attachments of a phase, pictures first."""
    pictures = "".join(_picture(one) for one in attachments if one.media_type in PICTURES)
    texts = "".join(_text(one) for one in attachments if _is_text(one))
    others = [_link(one) for one in attachments if one.media_type not in PICTURES and not _is_text(one)]
    shown = f'<div class="pictures">{pictures}</div>' if pictures else ""
    return shown + texts + (bullets(others, "files") if others else "")


def _picture(one: Attachment) -> str:
    caption = escaped(one.caption or one.name)
    data = base64.b64encode(one.data).decode()
    return (
        f'<figure><img alt="{caption}" src="data:{one.media_type};base64,{data}"/>'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _is_text(one: Attachment) -> bool:
    return one.media_type == "text/plain" and len(one.data) <= LONGEST_TEXT


def _text(one: Attachment) -> str:
    lines = one.data.decode("utf-8", "replace").splitlines()
    # Line by line, because `escaped` gives one line; what indents a line is kept.
    body = "\n".join(" " * (len(line) - len(line.lstrip(" "))) + escaped(line) for line in lines)
    return folded(_caption(one), f"<pre>{body}</pre>")


def _link(one: Attachment) -> str:
    # Saved, never opened: the type is not the record's, so that no browser shows it.
    data = base64.b64encode(one.data).decode()
    name = escaped(one.name) or "attachment"
    return f'<a download="{name}" href="data:application/octet-stream;base64,{data}">{_caption(one)}</a>'


def _caption(one: Attachment) -> str:
    about = f": {escaped(one.caption)}" if one.caption.strip() else ""
    return f"{escaped(one.name)}{about} ({size_words(len(one.data))})"
