"""The page of a gap report: `report.html` and pictures of the unrolled hand, made from the report alone."""

from taxel.gap.page.document import page_text, write_page
from taxel.gap.page.hand_drawing import unrolled_svg
from taxel.gap.page.hand_png import unrolled_png

__all__ = ["page_text", "unrolled_png", "unrolled_svg", "write_page"]
