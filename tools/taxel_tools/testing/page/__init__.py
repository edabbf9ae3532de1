"""The page of a test record: one HTML file that reads without this program and without a network."""

from taxel_tools.testing.page.document import page_text, write_page

__all__ = ["page_text", "write_page"]
