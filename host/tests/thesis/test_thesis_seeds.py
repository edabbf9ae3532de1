"""Median and worst of several seeds: stored results, resumption, refused seeds."""

import json
from dataclasses import replace

import pytest

from host.tests.command_line import run_taxel
from taxel.errors import TaxelError
from taxel.thesis import run
from taxel.thesis.printed_result import build_printed_results
from taxel.thesis.seed_result import SeedResult, read_seed_result
from taxel.thesis.settings import SEARCH_SEEDS, UNSEEN_SEEDS, describe_settings
from taxel.thesis.summary import Summary


def make_result(seed, points=0):
    """Result of a seed: the printed numbers; `points` replaces the number of raw real points."""
    results = build_printed_results()
    if points:
        results = tuple(
            replace(r, cad={**r.cad, "real": replace(r.cad["real"], points=points)}) for r in build_printed_results()
        )
    return SeedResult(seed, (f"seed {seed}",), describe_settings(), results, ())


@pytest.fixture
def stored_seeds(tmp_path, monkeypatch):
    """Campaigns and analysis that store the printed numbers; returns the list of seeds that were run."""
    runs = []

    def analyse(campaign, out, show):
        runs.append(campaign)
        result = make_result(campaign, points=1000 if campaign == 103 else 0)
        result.write(out)
        return result

    monkeypatch.setattr(run, "make_campaign", lambda folder, seed, jobs, show: seed)
    monkeypatch.setattr(run, "analyse", analyse)
    return runs


def test_seeds_are_stored_and_not_run_again(stored_seeds, tmp_path, capsys):
    assert run_taxel("thesis", "--seeds", "101,102", "--out", tmp_path) == 0
    assert run_taxel("thesis", "--seeds", "101-103", "--out", tmp_path) == 0
    assert stored_seeds == [101, 102, 103]
    output = capsys.readouterr().out
    assert "28 of 28 findings reproduced, median of 3 seeds (worst 2" in output
    values = json.loads((tmp_path / "thesis.json").read_text())
    assert values["seeds"] == [101, 102, 103]
    assert values["unseen"]
    assert values["reproduced"]["median"] == 28 > values["reproduced"]["worst"]
    denser = next(item for item in values["findings"] if item["key"] == "denser")
    assert (denser["seeds_reproduced"], denser["seeds"], denser["reproduced"]) == (2, 3, True)
    page = (tmp_path / "thesis.html").read_text()
    assert "not used in the search of settings (which used 1, 2, 3, 4, 5)" in page
    assert "Searched settings" in page
    assert "2 of 3 seeds" in page


def test_seed_of_the_search_is_refused(capsys, tmp_path):
    assert run_taxel("thesis", "--seeds", "1-3", "--out", tmp_path) == 1
    assert "found 1; use seeds above 5, such as 101-110" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "a", "5-", "-5", "110-101", "101,,102", "1-99999"])
def test_seeds_that_are_no_list_are_refused(capsys, tmp_path, text):
    assert run_taxel("thesis", f"--seeds={text}", "--out", tmp_path) == 1
    assert "--seeds: expected " in capsys.readouterr().err


def test_unseen_seeds_were_not_used_in_the_search():
    assert len(UNSEEN_SEEDS) == 10
    assert not set(UNSEEN_SEEDS) & set(SEARCH_SEEDS)


def test_result_of_other_settings_is_refused(tmp_path):
    replace(make_result(101), settings={**describe_settings(), "sim_layer_m": 0.002}).write(tmp_path)
    with pytest.raises(TaxelError, match=r"result.json: expected results with the present settings.*sim_layer_m"):
        read_seed_result(tmp_path)


def test_damaged_result_is_refused(tmp_path):
    (tmp_path / "result.json").write_text('{"seed": 101')
    with pytest.raises(TaxelError, match="found a damaged file; delete it"):
        read_seed_result(tmp_path)
    assert read_seed_result(tmp_path / "none") is None


def test_worst_skill_is_the_smallest():
    summary = Summary([make_result(101), make_result(102), make_result(103, points=1000)])
    spread = summary.get_skill("raw", "points")
    assert spread.median == 1.0
    assert spread.worst < 0.0
    assert summary.seeds[summary.shown].seed in (101, 102)
