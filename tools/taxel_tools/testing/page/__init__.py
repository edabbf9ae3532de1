"""HTML page of a test record, readable without this program and without a network."""

from taxel_tools.testing.page.document import render_page, write_page

__all__ = ["render_page", "write_page"]
