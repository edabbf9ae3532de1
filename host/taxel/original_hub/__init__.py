"""The original hub as a link: its messages become frames of the project."""

from taxel.original_hub.link import OriginalLink
from taxel.original_hub.url import OriginalSource, is_original_url, open_original

__all__ = ["OriginalLink", "OriginalSource", "is_original_url", "open_original"]
