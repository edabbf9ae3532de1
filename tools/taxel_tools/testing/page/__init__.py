"""HTML page of a test record, readable without this program and without a network."""

from taxel_tools.testing.page.document import page_text, write_page

__all__ = ["page_text", "write_page"]
