"""Attachments of a phase: pictures are shown, short texts folded, other files offered for download."""

import base64
from collections.abc import Sequence

from taxel_tools.testing.page.figures import format_size
from taxel_tools.testing.page.html_text import escape_text, render_bullets, render_folded
from taxel_tools.testing.record import Attachment

PICTURE_TYPES = ("image/png", "image/svg+xml")
"""Media types shown as <img>, which runs no scripts."""
TEXT_BYTES_MAX = 2**16


def render_attachments(attachments: Sequence[Attachment]) -> str:
    """Render the HTML of all attachments of a phase, pictures first."""
    pictures = "".join(
        _format_picture(attachment) for attachment in attachments if attachment.media_type in PICTURE_TYPES
    )
    texts = "".join(_format_text(attachment) for attachment in attachments if _is_text(attachment))
    links = [
        _format_link(attachment)
        for attachment in attachments
        if attachment.media_type not in PICTURE_TYPES and not _is_text(attachment)
    ]
    picture_list = f'<div class="pictures">{pictures}</div>' if pictures else ""
    return picture_list + texts + (render_bullets(links, "files") if links else "")


def _format_picture(attachment: Attachment) -> str:
    """Format the HTML figure with the embedded picture and its caption."""
    caption = escape_text(attachment.caption or attachment.name)
    data = base64.b64encode(attachment.data).decode()
    return (
        f'<figure><img alt="{caption}" src="data:{attachment.media_type};base64,{data}"/>'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _is_text(attachment: Attachment) -> bool:
    """Return whether an attachment is shown as text in the page: plain text that is not too long."""
    return attachment.media_type == "text/plain" and len(attachment.data) <= TEXT_BYTES_MAX


def _format_text(attachment: Attachment) -> str:
    """Format the HTML of a text attachment in a block that the reader can unfold."""
    lines = attachment.data.decode("utf-8", "replace").splitlines()
    # Line by line, because `escape_text` returns one line; the indentation of each line is kept.
    body = "\n".join(" " * (len(line) - len(line.lstrip(" "))) + escape_text(line) for line in lines)
    return render_folded(_format_caption(attachment), f"<pre>{body}</pre>")


def _format_link(attachment: Attachment) -> str:
    """Format the HTML link that saves an attachment, whose bytes are embedded in the page."""
    # The media type is fixed, so that browsers save the file and never open it.
    data = base64.b64encode(attachment.data).decode()
    name = escape_text(attachment.name) or "attachment"
    return f'<a download="{name}" href="data:application/octet-stream;base64,{data}">{_format_caption(attachment)}</a>'


def _format_caption(attachment: Attachment) -> str:
    """Format the HTML text with name, caption and size of an attachment."""
    description = f": {escape_text(attachment.caption)}" if attachment.caption.strip() else ""
    return f"{escape_text(attachment.name)}{description} ({format_size(len(attachment.data))})"
