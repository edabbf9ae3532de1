"""The command `taxel rate`: rate of a skin relative to the ceiling of its bus, and losses without a cause."""

import json
from typing import Any

import pytest

from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualMasterWorld, VirtualMemoryLink
from taxel_tools.cli_rate import rate_command
from taxel_tools.rate import compute_ceiling_hz, measure_rate

CEILING_SHARE = 90.0
"""Smallest share of the ceiling without a hub, percent (measured: 98.5 at 100 kHz, 96.8 at 400 kHz)."""


def measure(capsys: pytest.CaptureFixture[str], url: str, **options: Any) -> dict[str, Any]:
    """Run `taxel rate --json` on a URL and return its document. options: options of the command."""
    rate_command(url, **{"seconds": 5.0, "scl_hz": None, "at_least": CEILING_SHARE, "as_json": True} | options)
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    return document


@pytest.mark.parametrize("scl_hz", [100e3, 400e3])
def test_skin_without_a_hub_reaches_the_ceiling_of_its_bus(capsys: pytest.CaptureFixture[str], scl_hz: float) -> None:
    rate = measure(capsys, f"emulator:?wire=i2c&scl_hz={scl_hz:.0f}")
    taxels = {board.address: board.kind.taxel_count for board in load_hand("original").boards}
    assert rate["ceiling_hz"] == pytest.approx(compute_ceiling_hz(scl_hz, taxels))
    assert rate["hz"] / rate["ceiling_hz"] == pytest.approx(rate["share"])
    assert CEILING_SHARE / 100.0 <= rate["share"] <= 1.0
    assert len(rate["boards"]) == 17
    assert rate["missing"] == rate["unexplained"] == 0


def test_the_ceiling_counts_nine_clocks_for_each_byte_and_two_for_start_and_stop() -> None:
    # address byte, 10 bytes of overhead, two taxels of 2 bytes; start and stop condition
    assert compute_ceiling_hz(400e3, {0x1C: 2}) == pytest.approx(400e3 / (9 * 15 + 2))


def test_missing_frames_of_a_silent_board_are_explained_by_counters() -> None:
    """A board is unplugged during the measurement. The master then polls it rarely, so a few frames are missing."""
    hand = load_hand("rig4")
    text = format_world(hand, WorldSettings(faults=[f"1.0 unplug 0x{hand.boards[0].address:02X}"]))
    with VirtualMasterWorld(text) as world:
        rate = measure_rate(VirtualMemoryLink(world), scl_hz=400e3, seconds=3.0)
    assert rate.missing > 0
    assert rate.unexplained == 0


def test_a_skin_with_a_hub_is_measured_without_unexplained_losses(capsys: pytest.CaptureFixture[str]) -> None:
    assert measure(capsys, "emulator:?hand=rig4", at_least=None, seconds=1.0)["unexplained"] == 0


def test_a_bus_without_boards_gives_one_error_line() -> None:
    hand = load_hand("rig4")
    with VirtualMasterWorld(format_world(hand)) as world:
        for board in hand.boards:
            world.inject("unplug", board.address)
        with pytest.raises(TaxelError, match="no board answers") as caught:
            measure_rate(VirtualMemoryLink(world), 400e3, 1.0)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("options", "expected"),
    [({"seconds": 0.1}, "--seconds: expected 1 to 3600"), ({"scl_hz": 0.0}, "--scl-hz: expected a frequency above 0")],
)
def test_an_option_outside_its_range_gives_one_error_line(options: dict[str, float], expected: str) -> None:
    with pytest.raises(TaxelError, match=expected) as caught:
        rate_command("emulator:", **{"seconds": 1.0, "scl_hz": None, "at_least": None, "as_json": False} | options)
    assert "\n" not in str(caught.value)
