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
        """Return the document of a file. Raises any exception for a file that the codec does not understand."""
        ...

    def encode(self, document: Any) -> bytes:
        """Return the file of a document, with lengths and checksums that fit. Raises any exception if impossible."""
        ...
