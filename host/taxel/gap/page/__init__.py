"""The page of a gap report: `report.html` and the picture of the unrolled hand, from the report alone."""

from taxel.gap.page.document import page_text, write_page
from taxel.gap.page.unrolled import unrolled_svg
from taxel.gap.page.unrolled_png import unrolled_png

__all__ = ["page_text", "unrolled_png", "unrolled_svg", "write_page"]
