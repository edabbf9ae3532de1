"""Star wiring of the emulated skin through the `emulator:` URL."""

import pytest

import taxel
from taxel.emulated.url import open_emulator
from taxel.hand import load_hand
from taxel.hand.branches import find_silent_branches
from taxel.link import LinkError

HAND = "original"


def read_addresses(url: str, seconds: float) -> tuple[set[int], dict[int, float]]:
    """Read an emulated hand; return the addresses of its frames and the time of each board's last frame.

    Reading ends with the stream, or when the last frames of two boards are more than `seconds` apart.
    """
    times: dict[int, float] = {}
    with taxel.open(url, HAND) as skin:
        for frame in skin:
            times[frame.address] = frame.time_s
            if max(times.values()) - min(times.values()) > seconds:
                break
    return set(times), times


def test_open_branch_in_the_url_silences_all_boards_of_this_branch() -> None:
    url = "emulator:?speed=max&duration_s=6&fault=1.5 branch_open middle 0"
    _, times = read_addresses(url, 2.5)
    newest_s = max(times.values())
    silent = [address for address, time_s in times.items() if newest_s - time_s > 1.0]
    result = find_silent_branches(load_hand(HAND), silent, times)
    assert result.branches == ("middle",)
    assert result.boards == ()


@pytest.mark.parametrize(("scl_hz", "responds"), [(400e3, False), (100e3, True)])
def test_branch_with_a_long_cable_responds_only_at_a_low_clock_rate(scl_hz: float, responds: bool) -> None:
    """The cable of the branch "middle" has 300 pF: with 2.2 kilohm, the rise time is at least 559 ns.

    The I2C specification permits 300 ns at 400 kHz and 1000 ns at 100 kHz.
    """
    url = (
        f"emulator:?speed=max&duration_s=6&scl_hz={scl_hz}&wiring=buffered"
        "&branch=middle pullup_ohm=2200 capacitance_pf=300"
        "&branch=index pullup_ohm=2200&branch=pinkie pullup_ohm=2200"
        "&branch=palm pullup_ohm=2200&branch=back_of_hand pullup_ohm=2200"
    )
    addresses, _ = read_addresses(url, 1.0)
    middle = {board.address for board in load_hand(HAND).find_branch("middle")}
    assert (middle <= addresses) == responds
    assert {0x15, 0x16} <= addresses  # palm and back of hand, on their own branches


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("wiring=ring", "option 'wiring' must be passive or buffered"),
        ("branch=thumb series_ohm=1", "has no branch 'thumb'; expected one of back_of_hand, index"),
        ("branch=index ohm=1", "expected key=value with pullup_ohm, capacitance_pf, series_ohm, found 'ohm=1'"),
        ("branch=index series_ohm=x", "series_ohm must be a number from 0 to 1e+06, found 'x'"),
        ("branch=index capacitance_pf=nan", "capacitance_pf must be a number from 0.1 to 100000"),
    ],
)
def test_invalid_option_is_refused_with_a_one_line_message(option: str, message: str) -> None:
    with pytest.raises(LinkError) as error:
        open_emulator(f"emulator:?{option}", load_hand(HAND))
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_wiring_of_a_hand_without_branches_is_refused() -> None:
    with pytest.raises(LinkError, match="hand 'flat8' has no branches"):
        open_emulator("emulator:?wiring=buffered", load_hand("flat8"))
