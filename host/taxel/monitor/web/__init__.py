"""View of the skin in a browser: the page, and the checks of its requests and messages. Needs viser."""

from taxel.monitor.web.server import WebError
from taxel.monitor.web.view import WebView

__all__ = ["WebError", "WebView"]
