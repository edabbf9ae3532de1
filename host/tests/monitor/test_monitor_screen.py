"""Screens of a reading on terminals of several sizes."""

import io

import numpy as np
import pytest
from rich.console import Console

from taxel.hand import load_hand
from taxel.monitor import Screen
from taxel.monitor.board_layout import layout_rows, layout_unrolled
from taxel.monitor.colours import INACTIVE_STEPS, STEPS, TABLE, UNKNOWN, ColourScale, colour_steps

SIZES = ((80, 24), (120, 40), (170, 50), (250, 70))


@pytest.fixture
def touch_reading(fake_skin):
    """A reading with one active taxel on the palm and one on the back of the hand."""
    skin = fake_skin()
    skin.pass_time(3.0)
    skin.read()
    for name in ("palm", "back_of_hand"):
        skin.raw[skin.hand.get_slice(skin.hand.find_board(name).address)][40] -= 500
    skin.pass_time(0.1)
    return skin.read()


def draw_screen(reading, width, height, shows_table=False, has_colour=True):
    """The characters of a screen: (character, foreground colour, background colour), row by row."""
    drawer = Screen(load_hand("allegro"), "fake", 150.0)
    drawer.shows_table = shows_table
    console = Console(file=io.StringIO(), width=width, height=height, color_system="truecolor", force_terminal=True)
    canvas = drawer.draw(reading, width, height, has_colour)
    rows = [[]]
    for segment in canvas.__rich_console__(console, console.options):
        if segment.text == "\n":
            rows.append([])
            continue
        style = segment.style
        colours = [c.triplet if c is not None else None for c in (style.color, style.bgcolor)]
        rows[-1] += [(character, *colours) for character in segment.text]
    return rows


def join_characters(rows):
    """The text of a screen without colours."""
    return "\n".join("".join(character[0] for character in row) for row in rows)


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_every_taxel_is_on_the_screen_once(touch_reading, width, height):
    rows = draw_screen(touch_reading, width, height)
    assert len(rows) == height
    assert {len(row) for row in rows} == {width}
    half_blocks = sum(
        (character[1] is not None) + (character[2] is not None)
        for row in rows[4:]
        for character in row
        if character[0] in "▀▄"
    )
    assert half_blocks in {1073, 4 * 1073}  # 2 x 2 half blocks per taxel on a large terminal
    active_colour = tuple(TABLE[colour_steps(np.array([500.0]), 150.0, 500.0)[0]])
    active_half_blocks = sum(colour == active_colour for row in rows[4:] for _, *colours in row for colour in colours)
    assert active_half_blocks in {2, 8}


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_screen_has_rates_errors_and_active_taxels(touch_reading, width, height):
    text = join_characters(draw_screen(touch_reading, width, height))
    for expected_text in (
        "fake",
        "20.0 scans/s",
        "17/17 boards",
        "2 active",
        "signal up to 500",
        "no errors",
        "500 counts",
    ):
        assert expected_text in text


def test_table_is_shown_beside_the_map_or_instead_of_it(touch_reading):
    assert "medial back middle" in join_characters(draw_screen(touch_reading, 170, 50))
    assert "medial back middle" not in join_characters(draw_screen(touch_reading, 80, 24))
    assert "medial back middle" in join_characters(draw_screen(touch_reading, 80, 24, shows_table=True))


@pytest.mark.parametrize(("width", "height"), [(1, 1), (10, 3), (40, 12), (300, 5)])
def test_any_terminal_size_is_accepted(touch_reading, width, height):
    assert len(draw_screen(touch_reading, width, height)) == height


def test_active_taxels_are_blocks_without_colour(touch_reading):
    rows = draw_screen(touch_reading, 80, 24, has_colour=False)
    text = join_characters(rows[4:])
    assert text.count("▀") + text.count("▄") == 2
    assert text.count("·") > 500


@pytest.mark.parametrize("name", ["allegro", "flat8", "rig4"])
def test_boards_and_their_labels_do_not_overlap(name):
    hand = load_hand(name)
    layouts = [layout_rows(hand, 80), layout_rows(hand, 160, 2), layout_unrolled(hand), layout_unrolled(hand, 2)]
    for layout in filter(None, layouts):
        assert {placed.board for placed in layout.boards} == set(hand.boards)
        occupied = np.zeros((layout.height, layout.width + 1), dtype=int)
        for placed in layout.boards:
            kind = placed.board.kind
            rows = -(-kind.tx_count * layout.scale // 2)
            occupied[placed.y : placed.y + rows, placed.x : placed.x + kind.rx_count * layout.scale] += 1
            occupied[placed.y - 1, placed.label_x : placed.label_x + len(placed.label) + 1] += 1
        for heading in layout.headings:
            occupied[heading.y, heading.x : heading.x + len(heading.text) + 1] += 1
        assert occupied.max() == 1


def test_only_the_default_hand_has_an_unrolled_layout():
    assert layout_unrolled(load_hand("allegro")) is not None
    assert layout_unrolled(load_hand("rig4")) is None


def test_default_hand_fits_an_80_by_24_terminal():
    assert layout_rows(load_hand("allegro"), 80).width <= 80
    assert layout_rows(load_hand("allegro"), 80).height <= 20


def test_active_taxel_is_brighter_than_any_inactive_one():
    colour = TABLE / 255.0
    linear_light = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)  # IEC 61966-2-1
    light = linear_light @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(light[:STEPS]) > 0.0).all()
    assert light[INACTIVE_STEPS] > 2.0 * light[INACTIVE_STEPS - 1]
    steps = colour_steps(np.array([-50.0, 0.0, 150.0, 150.1, 499.0, 1e9, np.nan]), 150.0, 500.0)
    assert steps.tolist() == [0, 0, INACTIVE_STEPS - 1, INACTIVE_STEPS, STEPS - 1, STEPS - 1, UNKNOWN]


def test_colour_scale_rises_at_once_and_falls_slowly():
    scale = ColourScale(150.0)
    assert scale.update(20.0, 0.0) == 300.0
    assert scale.update(1200.0, 1.0) == 1500.0
    assert scale.update(20.0, 8.0) == 1500.0
    assert scale.update(20.0, 12.0) == 300.0
    assert scale.update(float("nan"), 30.0) == 300.0
