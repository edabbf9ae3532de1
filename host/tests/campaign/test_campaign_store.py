"""Beginning a dataset, and going on with one."""

from __future__ import annotations

import pytest

from taxel.campaign.store import begin_or_extend
from taxel.recording.errors import DatasetError


def test_a_file_that_exists_is_refused_kept_or_replaced_as_asked(setup, tmp_path):
    path = tmp_path / "real.h5"
    begin_or_extend(path, "real", setup, 20.0, "settings a", resume=True).close()
    before = path.read_bytes()
    with pytest.raises(DatasetError, match=r"real\.h5") as caught:
        begin_or_extend(path, "real", setup, 20.0, "settings a")
    assert "\n" not in str(caught.value)
    begin_or_extend(path, "real", setup, 20.0, "settings a", resume=True).close()
    assert path.read_bytes() == before
    begin_or_extend(path, "real", setup, 20.0, "settings b", overwrite=True).close()
    assert path.read_bytes() != before


def test_a_file_of_another_campaign_is_refused_in_one_line_and_stays(setup, tmp_path):
    path = tmp_path / "real.h5"
    begin_or_extend(path, "real", setup, 20.0, "settings a").close()
    before = path.read_bytes()
    with pytest.raises(DatasetError, match=r"/generator: expected .*settings b, found .*settings a; ") as caught:
        begin_or_extend(path, "real", setup, 20.0, "settings b", resume=True)
    assert "\n" not in str(caught.value)
    assert path.read_bytes() == before


def test_a_file_that_is_no_dataset_is_refused(setup, tmp_path):
    path = tmp_path / "real.h5"
    path.write_text("something else")
    with pytest.raises(DatasetError, match=r"real\.h5"):
        begin_or_extend(path, "real", setup, 20.0, "settings a", resume=True)
    assert path.read_text() == "something else"
