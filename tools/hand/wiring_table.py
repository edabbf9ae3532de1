"""Write the table of rise times in docs/star-wiring.md from the hand descriptions.

    python tools/hand/wiring_table.py [--check]

--check only compares, exit status 1 if the page differs.
"""

import sys
from pathlib import Path
from typing import Final

from taxel.hand import load_hand
from taxel.hand.wiring import RISE_LIMITS_S, Wiring, compute_rise_times

PAGE: Final = Path(__file__).parents[2] / "docs/star-wiring.md"
START: Final = "<!-- table of tools/hand/wiring_table.py -->\n"
END: Final = "<!-- end of the table -->"
HANDS: Final = ("original", "allegro")


def format_table(name: str) -> list[str]:
    """Return the table rows of one hand: values of hub and branches, rise time and highest clock rate."""
    wiring = load_hand(name).wiring
    assert wiring is not None
    rows = []
    for rise in compute_rise_times(wiring):
        rate = f"{rise.highest_scl_hz / 1e3:.0f} kHz" if rise.highest_scl_hz else "none"
        rows.append(
            f"| {name} | {rise.branch} | {_format_values(wiring, rise.branch)} | {rise.rise_s * 1e9:.0f} | {rate} |"
        )
    return rows


def _format_values(wiring: Wiring, branch: str) -> str:
    """Return the table columns of a branch or of the hub: pull-up, capacitance and series resistance."""
    if branch == "hub":
        return f"{_format_pullup(wiring.hub_pullup_ohm)} | {wiring.hub_capacitance_pf:g} | -"
    values = next(each for each in wiring.branches if each.name == branch)
    return f"{_format_pullup(values.pullup_ohm)} | {values.capacitance_pf:g} | {values.series_ohm:g}"


def _format_pullup(ohm: float) -> str:
    return f"{ohm:g}" if ohm else "none"


def main() -> int:
    """Write the table of the page, or with --check compare it; the exit status is 1 if it differs."""
    text = PAGE.read_text()
    before, _, rest = text.partition(START)
    _, _, after = rest.partition(END)
    lines = ["| hand | place | pull-up, ohm | capacitance, pF | series, ohm | rise time, ns | highest clock rate |"]
    lines += ["|---|---|---|---|---|---|---|", *(row for name in HANDS for row in format_table(name))]
    limits = ", ".join(f"{1e9 * limit:.0f} ns up to {rate / 1e3:.0f} kHz" for rate, limit in RISE_LIMITS_S.items())
    table = "\n".join([*lines, "", f"Limits of the rise time in the I2C specification: {limits}."])
    written = f"{before}{START}\n{table}\n\n{END}{after}"
    if "--check" in sys.argv[1:]:
        return 0 if written == text else 1
    PAGE.write_text(written)
    return 0


if __name__ == "__main__":
    sys.exit(main())
