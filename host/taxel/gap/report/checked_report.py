"""A gap report whose fields are checked when they are read."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from taxel.gap.data.missing_inputs import LINES
from taxel.gap.errors import GapInputError
from taxel.gap.report.report_values import REMEDY, ReportValue
from taxel.hand.errors import format_value

FORMAT = "taxel-gap-report"
"""Value of the field `format` of a report."""

VERSIONS = (1, 2)
"""Values of the field `version` that can be read."""

STATUSES = ("no_gap", "explained", "partly_explained", "unknown")
"""Permitted values of `verdict.status`."""

FIRST_ADDRESS = 0x08
"""Smallest address of an I2C slave (UM10204, table 4); smaller addresses are numbers of sensors without a bus."""

_MAX_TAXELS = 2**20
"""Largest number of taxels in a report. Chosen: far above any hand; limits the memory that an untrusted report uses."""

_MAX_ADDRESS = 255
"""Largest address of a board: one byte."""

_MAX_LINE = 255
"""Largest index of a TX or RX line: one byte."""


class CheckedReport:
    """Report of a diagnosis whose fields are checked when they are read.

    Attributes: root, all fields of the report.

    Raises GapInputError: the content is not a report, or a report of another version. Every property raises the same
    error for the fields that it reads.
    """

    def __init__(self, content: Mapping[str, Any]) -> None:
        """Check format and version of a report. content: the JSON object. Raises GapInputError."""
        self.root = ReportValue(dict(content) if isinstance(content, Mapping) else content)
        for key, permitted in (("format", (FORMAT,)), ("version", VERSIONS)):
            found = self.root.field(key).content
            if type(found) is not type(permitted[0]) or found not in permitted:
                expected = " or ".join(map(repr, permitted))
                raise GapInputError(f"report: {key}", expected, format_value(found), REMEDY)

    @cached_property
    def verdict(self) -> ReportValue:
        """The fields of the verdict."""
        return self.root.field("verdict")

    @cached_property
    def status(self) -> str:
        """One of `STATUSES`."""
        return self.verdict.choice("status", STATUSES)

    @property
    def is_no_gap(self) -> bool:
        """Whether the two datasets agree."""
        return self.status == "no_gap"

    @property
    def named_effects(self) -> list[str]:
        """Names of the effects of the verdict, without an unknown cause."""
        return [name for name in self.verdict.texts("effects") if name != "unknown"]

    @cached_property
    def gap(self) -> ReportValue:
        """The gap over all grasps."""
        return self.root.field("gap")

    @cached_property
    def after(self) -> ReportValue:
        """The gap of the held-out grasps with the effects of the verdict added."""
        return self.root.field("after")

    @cached_property
    def where(self) -> ReportValue:
        """Shares of the excess by location."""
        return self.root.field("where")

    @cached_property
    def effects(self) -> list[ReportValue]:
        """All candidate effects in the order of the catalogue."""
        return self.root.field("effects").items()

    @cached_property
    def board_names(self) -> dict[int, str]:
        """Names of the boards by address, as the report gives them."""
        entries = self.root.optional_list("sensors") + self.where.optional_list("sensors")
        return {get_address(entry): entry.text("name") for entry in reversed(entries)}

    @cached_property
    def has_bus_addresses(self) -> bool:
        """Whether the addresses of the boards are I2C addresses, and not merely numbers of sensors that start at 0.

        Addresses below 0x08 are reserved on an I2C bus.
        """
        return min(self.board_names, default=FIRST_ADDRESS) >= FIRST_ADDRESS

    @cached_property
    def board_kinds(self) -> dict[int, str]:
        """Names of the board kinds by address; a board without a kind is absent."""
        entries = [entry for entry in self.root.optional_list("sensors") if entry.optional("kind")]
        return {get_address(entry): entry.text("kind") for entry in entries}

    @cached_property
    def taxels(self) -> tuple[list[int], list[int], list[int]] | None:
        """Board address, TX line and RX line of each taxel, three lists [n] (n taxels); None if the report does not
        contain them.
        """
        table = self.root.optional("taxels")
        if table is None or not table.table():
            return None
        address = table.integers("sensor", 0, _MAX_ADDRESS)
        lines = [table.integers(axis, 0, _MAX_LINE) for axis in ("tx", "rx")]
        for axis, indices in zip(("tx", "rx"), lines, strict=True):
            if len(indices) != len(address):
                where = f"report: taxels.{axis}"
                raise GapInputError(where, f"{len(address)} integers, as in taxels.sensor", str(len(indices)), REMEDY)
        if len(address) > _MAX_TAXELS:
            raise GapInputError("report: taxels.sensor", f"at most {_MAX_TAXELS} taxels", str(len(address)), REMEDY)
        if len(set(zip(address, *lines, strict=True))) != len(address):
            raise GapInputError("report: taxels", "each crossing once", "a repeated crossing", REMEDY)
        return (address, lines[0], lines[1]) if address else None

    @cached_property
    def has_lines(self) -> bool:
        """Whether the TX and RX lines of the taxels are electrode lines, and not merely places in a picture."""
        return LINES not in self.root.field("inputs").texts("lacking")

    @cached_property
    def excess(self) -> tuple[list[float], list[float]] | None:
        """Excess of each taxel without and with the named effects, counts squared, two lists [n] (n taxels); NaN
        without data.

        None if the report does not contain the taxels or their excess.
        """
        table = self.root.optional("taxel_excess")
        if self.taxels is None or table is None or not table.table():
            return None
        count = len(self.taxels[0])
        return table.numbers("before", count), table.numbers("after", count)


def get_address(entry: ReportValue) -> int:
    """Return the board address of an entry. Raises GapInputError for a missing or malformed address."""
    return entry.field("address").as_integer(0, _MAX_ADDRESS)
