"""Opening of a page in the user's browser, on request."""

import os
import sys
import webbrowser
from pathlib import Path

import typer

TEXT_BROWSERS = ("www-browser", "links", "elinks", "lynx", "w3m")
"""Browsers of `webbrowser` that would take over the terminal."""


def offer_page(page: Path, is_wanted: bool | None) -> None:
    """Open a page in a browser, or print a line to standard error if there is no browser.

    is_wanted: True: open the page; False: do nothing; None: ask, if the command runs on a terminal and a graphical
    browser is available, else do nothing.
    """
    if is_wanted is None:
        if not (sys.stdin.isatty() and sys.stdout.isatty() and _has_browser()):
            return
        is_wanted = typer.confirm("open the page?", default=False)
    if is_wanted and not webbrowser.open(page.absolute().as_uri()):
        print(f"{page}: no browser is available; open the file on another computer", file=sys.stderr)


def _has_browser() -> bool:
    """Whether a graphical browser can be opened; on Linux this needs a display."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    try:
        return getattr(webbrowser.get(), "name", "") not in TEXT_BROWSERS
    except webbrowser.Error:
        return False
