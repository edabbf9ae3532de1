"""A report on its way to the page: its fields, and what several sections ask of it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from taxel.gap.errors import GapInputError
from taxel.gap.page.fields import REMEDY, Value
from taxel.gap.page.glossary import STATUSES
from taxel.gap.page.text import escaped
from taxel.hand.errors import format_value

FORMAT = "taxel-gap-report"
VERSION = 1

_MAX_TAXELS = 2**20
_MAX_ADDRESS = 255
_MAX_LINE = 255


class Report:
    """The report of a diagnosis.

    Attributes: root, all of its fields.

    Raises GapInputError: not a report, or one of another version; every property likewise for the fields it reads.
    """

    def __init__(self, content: Mapping[str, Any]) -> None:
        self.root = Value(dict(content) if isinstance(content, Mapping) else content)
        for key, expected in (("format", FORMAT), ("version", VERSION)):
            found = self.root.field(key).content
            if type(found) is not type(expected) or found != expected:
                raise GapInputError(f"report: {key}", repr(expected), format_value(found), REMEDY)

    @cached_property
    def verdict(self) -> Value:
        """The verdict's fields."""
        return self.root.field("verdict")

    @cached_property
    def status(self) -> str:
        """One of `STATUSES`."""
        return self.verdict.one_of("status", tuple(STATUSES))

    @property
    def no_gap(self) -> bool:
        """Whether the two recordings agree."""
        return self.status == "no_gap"

    @cached_property
    def gap(self) -> Value:
        """The gap over all grasps."""
        return self.root.field("gap")

    @cached_property
    def after(self) -> Value:
        """The held-out gap with the verdict's effects added."""
        return self.root.field("after")

    @cached_property
    def where(self) -> Value:
        """Where the excess lies."""
        return self.root.field("where")

    @cached_property
    def effects(self) -> list[Value]:
        """Every candidate, in the catalogue's order."""
        return self.root.field("effects").items()

    @cached_property
    def names(self) -> dict[int, str]:
        """The boards' names by address, as the file gives them."""
        entries = self.root.maybe_list("sensors") + self.where.maybe_list("sensors")
        return {address_of(entry): entry.text("name") for entry in reversed(entries)}

    def board(self, address: int) -> str:
        """A board in words, escaped."""
        name = self.names.get(address)
        return escaped(name.replace("_", " ")) if name else f"board {address}"

    @cached_property
    def taxels(self) -> tuple[list[int], list[int], list[int]] | None:
        """Address, TX and RX line of each taxel, each [n]; None if the report does not say."""
        found = self.root.maybe("taxels")
        if found is None or not found.table():
            return None
        address = found.integers("sensor", 0, _MAX_ADDRESS)
        lines = [found.integers(axis, 0, _MAX_LINE) for axis in ("tx", "rx")]
        for axis, own in zip(("tx", "rx"), lines, strict=True):
            if len(own) != len(address):
                where = f"report: taxels.{axis}"
                raise GapInputError(where, f"{len(address)} integers, as in taxels.sensor", str(len(own)), REMEDY)
        if len(address) > _MAX_TAXELS:
            raise GapInputError("report: taxels.sensor", f"at most {_MAX_TAXELS} taxels", str(len(address)), REMEDY)
        if len(set(zip(address, *lines, strict=True))) != len(address):
            raise GapInputError("report: taxels", "each crossing once", "one that stands there twice", REMEDY)
        return (address, lines[0], lines[1]) if address else None

    @cached_property
    def excess(self) -> tuple[list[float], list[float]] | None:
        """Excess of each taxel before and after, counts squared, each [n]; NaN where nothing is known."""
        found = self.root.maybe("taxel_excess")
        if self.taxels is None or found is None or not found.table():
            return None
        count = len(self.taxels[0])
        return found.numbers("before", count), found.numbers("after", count)


def address_of(entry: Value) -> int:
    """The address that an entry names."""
    return entry.field("address").as_integer(0, _MAX_ADDRESS)
