"""Creation and continuation of a campaign's dataset."""

import pytest

from taxel.campaign.store import open_campaign_writer
from taxel.recording.errors import DatasetError


def test_an_existing_file_is_rejected_resumed_or_overwritten_as_requested(setup, tmp_path):
    path = tmp_path / "real.h5"
    open_campaign_writer(path, "real", setup, 20.0, "settings a", resume=True).close()
    content = path.read_bytes()
    with pytest.raises(DatasetError, match=r"real\.h5") as caught:
        open_campaign_writer(path, "real", setup, 20.0, "settings a")
    assert "\n" not in str(caught.value)
    open_campaign_writer(path, "real", setup, 20.0, "settings a", resume=True).close()
    assert path.read_bytes() == content
    open_campaign_writer(path, "real", setup, 20.0, "settings b", overwrite=True).close()
    assert path.read_bytes() != content


def test_a_file_of_another_campaign_is_rejected_with_a_one_line_message_and_unchanged(setup, tmp_path):
    path = tmp_path / "real.h5"
    open_campaign_writer(path, "real", setup, 20.0, "settings a").close()
    content = path.read_bytes()
    with pytest.raises(DatasetError, match=r"/generator: expected .*settings b, found .*settings a; ") as caught:
        open_campaign_writer(path, "real", setup, 20.0, "settings b", resume=True)
    assert "\n" not in str(caught.value)
    assert path.read_bytes() == content


def test_a_file_that_is_not_a_dataset_is_rejected_and_unchanged(setup, tmp_path):
    path = tmp_path / "real.h5"
    path.write_text("something else")
    with pytest.raises(DatasetError, match=r"real\.h5"):
        open_campaign_writer(path, "real", setup, 20.0, "settings a", resume=True)
    assert path.read_text() == "something else"
