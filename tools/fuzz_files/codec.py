"""Interface of the codecs: a file as a document whose fields are mutated, and the file of a changed document."""

from __future__ import annotations

from typing import Any, Protocol


class Codec(Protocol):
    """One kind of file. A codec shares no code with the reader under test."""

    @property
    def is_strict(self) -> bool:
        """Whether a file that the codec cannot decode is no file of its kind, so that the reader must refuse it."""
        ...

    def decode(self, data: bytes) -> Any:
        """Return the document of a file. Raises any exception if the codec does not understand the file."""
        ...

    def encode(self, document: Any) -> bytes:
        """Return the bytes of the file with this document, with correct lengths and checksums.

        Raises any exception if the format cannot express the document.
        """
        ...
