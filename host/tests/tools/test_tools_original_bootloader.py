"""Writer for the original bootloader, against a model of that bootloader: complete updates, faults, refused files."""

import random

import pytest

from host.tests.tools.original_bootloader_model import ROWS, OriginalBootloader
from taxel_protocol.bootloader import BOOT_ROW_SIZE
from taxel_tools.errors import BoardError, FirmwareFileError
from taxel_tools.files.cyacd import read_cyacd_rows
from taxel_tools.files.original_image import OriginalImage
from taxel_tools.original_bootloader import start_original_session, update_original
from taxel_tools.scheduler import run
from taxel_tools.session import BootSession
from taxel_tools.wires import SmbusWire

pytest.importorskip("smbus2")

ADDRESS, SILICON_ID, FIRST_ROW = 0x1A, 0x04FA1193, 48
APPLICATION_ROWS = 62
DAMAGE = 2e-4
"""Probability of a damaged byte: about 5 % of the rows need a second attempt."""


def make_rows(seed: int, first_row: int = FIRST_ROW) -> dict[int, bytes]:
    """Create the rows of a random application behind a bootloader, with the metadata in the last row of the flash."""
    content = random.Random(seed).randbytes(APPLICATION_ROWS * BOOT_ROW_SIZE)
    image = OriginalImage(first_row, ROWS, content, first_row * BOOT_ROW_SIZE + 1)
    return dict(image.list_rows())


def open_model(model: OriginalBootloader) -> SmbusWire:
    """Connect the model to an I2C adapter in virtual time."""
    return SmbusWire(model, "model", model.now_s, model.wait)


def write(model: OriginalBootloader, rows: dict[int, bytes], silicon_id: int = SILICON_ID) -> None:
    """Update the model with the rows of a file. silicon_id: part for which the file is made."""
    run(open_model(model), update_original(ADDRESS, model.now_s, silicon_id, rows))


def has_rows(model: OriginalBootloader, rows: dict[int, bytes]) -> bool:
    """Return whether the flash of the model contains the rows."""
    return all(model.flash[row * BOOT_ROW_SIZE :][:BOOT_ROW_SIZE] == data for row, data in rows.items())


def test_an_update_writes_all_rows_the_metadata_last_and_starts_the_application():
    model, rows = OriginalBootloader(ADDRESS, SILICON_ID, FIRST_ROW), make_rows(1)
    write(model, rows)
    assert has_rows(model, rows)
    assert model.written_rows == sorted(rows)
    assert model.has_started
    assert model.unread_responses == 0


def test_the_writer_waits_for_a_board_that_is_switched_on():
    model, rows = OriginalBootloader(ADDRESS, SILICON_ID, FIRST_ROW, on_s=(7.3,)), make_rows(2)
    write(model, rows)
    assert model.has_started
    assert model.now_s() > 7.3


def test_the_report_names_part_rows_and_application():
    model, rows = OriginalBootloader(ADDRESS, SILICON_ID, FIRST_ROW), make_rows(3)
    info = run(open_model(model), start_original_session(BootSession(ADDRESS, model.now_s)))
    assert (info.silicon_id, info.first_row, info.last_row, info.has_application) == (SILICON_ID, 48, 127, False)
    write(model, rows)
    restarted = OriginalBootloader(ADDRESS, SILICON_ID, FIRST_ROW)
    restarted.flash = model.flash
    assert run(open_model(restarted), start_original_session(BootSession(ADDRESS, restarted.now_s))).has_application


@pytest.mark.parametrize("seed", range(20))
def test_damaged_packets_are_sent_again(seed):
    model = OriginalBootloader(ADDRESS, SILICON_ID, FIRST_ROW, damage=DAMAGE, seed=seed)
    rows = make_rows(seed)
    for _ in range(5):  # a refused update may be repeated
        try:
            write(model, rows)
            break
        except BoardError:
            model.is_in_session = False
    assert has_rows(model, rows), f"seed {seed}"
    assert model.is_valid()


@pytest.mark.parametrize("cut_after", [0, 1, 30, 62])
def test_after_a_power_cut_the_board_stays_in_its_bootloader_and_is_written_again(cut_after):
    """cut_after: number of written rows after which the power fails; the application has 62 rows."""
    model = OriginalBootloader(ADDRESS, SILICON_ID, FIRST_ROW, cut_after=cut_after)
    rows = make_rows(4)
    with pytest.raises(BoardError):
        write(model, rows)
    assert not model.is_valid()
    write(model, rows)
    assert has_rows(model, rows)
    assert model.has_started


@pytest.mark.parametrize(
    ("silicon_id", "first_row", "rows", "message"),
    [
        (0x04C81193, FIRST_ROW, make_rows(5), "the file is for silicon id 04FA1193, the board reports 04C81193"),
        (0x12345678, FIRST_ROW, make_rows(5), "is not of a PSoC 4200"),
        (SILICON_ID, 50, make_rows(5), "build it with TAXEL_ORIGINAL_FIRST_ROW=50"),
        (SILICON_ID, FIRST_ROW, make_rows(5, 52), "build it with TAXEL_ORIGINAL_FIRST_ROW=48"),
        (SILICON_ID, FIRST_ROW, {48: bytes(128)}, "the file has rows 48 to 48, expected 48 to 127"),
    ],
)
def test_a_file_for_another_part_or_bootloader_is_refused_before_anything_is_written(
    silicon_id, first_row, rows, message
):
    model = OriginalBootloader(ADDRESS, silicon_id, first_row)
    with pytest.raises(BoardError, match=message) as error:
        write(model, rows)
    assert "\n" not in str(error.value)
    assert model.written_rows == []


def test_a_board_that_does_not_answer_is_reported_in_one_line():
    model = OriginalBootloader(ADDRESS, SILICON_ID, FIRST_ROW, on_s=(100.0,))
    with pytest.raises(BoardError, match=r"no bootloader answers within 60 s; switch the board off and on"):
        write(model, make_rows(6))


def test_a_file_of_another_part_is_read_and_a_damaged_line_is_named():
    body = bytes([0]) + (48).to_bytes(2, "big") + (128).to_bytes(2, "big") + bytes(range(128))
    line = ":" + (body + bytes([-sum(body) & 0xFF])).hex().upper()
    assert read_cyacd_rows(f"04FA11930000\n{line}\n", "x.cyacd") == (SILICON_ID, {48: bytes(range(128))})
    with pytest.raises(FirmwareFileError, match=r"x\.cyacd.*line 2"):
        read_cyacd_rows(f"04FA11930000\n{line.replace('010203', '010204')}\n", "x.cyacd")
