"""The file of the page: viser's client with the banner of the monitor, and the headers of its response."""

import gzip
from pathlib import Path
from typing import Final

HEADERS: Final = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",  # the address contains the token
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}
"""Headers of every response."""


class PageFile:
    """The file of the page, without and with compression."""

    def __init__(self, client: Path) -> None:
        """Read the page from viser's file `client` and add the banner. Raises OSError if the file cannot be read."""
        script = Path(__file__).with_name("banner.js").read_text()
        before, tag, after = client.read_text(encoding="utf-8").rpartition("</body>")
        self.plain = f"{before}<script>\n{script}</script>\n{tag}{after}".encode()
        self.compressed = gzip.compress(self.plain, mtime=0)


def make_content_policy(host: str) -> str:
    """Return the Content-Security-Policy of the page: it loads nothing from and connects to nothing but `host`.

    host: value of the header Host, after its check. viser's page is one file with scripts, workers, compiled code and
    fonts inside.
    """
    return (
        "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob: data:; worker-src blob: data:; "
        "style-src 'unsafe-inline' data:; img-src data: blob:; font-src data:; "
        f"connect-src ws://{host} data: blob:; "
        "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
    )
