"""Reproduction with several seeds: stored results, resumption, refused seeds, median and worst result."""

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
    """Make the result of a seed from the printed numbers; `points` replaces the number of raw real points unless 0."""
    results = build_printed_results()
    if points:
        results = tuple(
            replace(r, cad={**r.cad, "real": replace(r.cad["real"], points=points)}) for r in build_printed_results()
        )
    return SeedResult(seed, (f"seed {seed}",), describe_settings(), results, ())


SEED_WITH_FEW_POINTS = 103
"""Seed whose real clouds have too few points for the finding "denser"."""


@pytest.fixture
def analysed_seeds(monkeypatch):
    """Replace campaigns and analysis by the printed numbers; return the list to which analysed seeds are appended."""
    analysed = []

    def analyse(seed, out, show):
        analysed.append(seed)
        result = make_result(seed, points=1000 if seed == SEED_WITH_FEW_POINTS else 0)
        result.write(out)
        return result

    monkeypatch.setattr(run, "make_campaign", lambda folder, seed, jobs, show: seed)
    monkeypatch.setattr(run, "analyse", analyse)
    return analysed


def test_seed_with_stored_results_is_not_analysed_again(analysed_seeds, tmp_path):
    assert run_taxel("thesis", "--seeds", "101,102", "--out", tmp_path) == 0
    assert run_taxel("thesis", "--seeds", "101-103", "--out", tmp_path) == 0
    assert analysed_seeds == [101, 102, 103]


def test_command_prints_median_and_worst_number_of_reproduced_findings(analysed_seeds, tmp_path, capsys):
    assert run_taxel("thesis", "--seeds", "101-103", "--out", tmp_path) == 0
    assert "28 of 28 findings reproduced, median of 3 seeds (worst 2" in capsys.readouterr().out


def test_summary_states_how_many_seeds_reproduce_each_finding(analysed_seeds, tmp_path):
    assert run_taxel("thesis", "--seeds", "101-103", "--out", tmp_path) == 0
    values = json.loads((tmp_path / "thesis.json").read_text())
    assert values["seeds"] == [101, 102, 103]
    assert values["unseen"]
    # In two of three seeds the results are the printed numbers, which reproduce all 28 findings.
    assert values["reproduced"]["median"] == 28 > values["reproduced"]["worst"]
    denser = next(item for item in values["findings"] if item["key"] == "denser")
    assert (denser["seeds_reproduced"], denser["seeds"], denser["reproduced"]) == (2, 3, True)


def test_page_states_searched_settings_and_numbers_of_seeds(analysed_seeds, tmp_path):
    assert run_taxel("thesis", "--seeds", "101-103", "--out", tmp_path) == 0
    page = (tmp_path / "thesis.html").read_text()
    assert "not used in the search of settings (which used 1, 2, 3, 4, 5)" in page
    assert "Searched settings" in page
    assert "2 of 3 seeds" in page


def test_seed_that_was_used_in_the_search_of_settings_is_refused(capsys, tmp_path):
    assert run_taxel("thesis", "--seeds", "1-3", "--out", tmp_path) == 1
    assert "found 1; use seeds above 5, such as 101-110" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "a", "5-", "-5", "110-101", "101,,102", "1-99999"])
def test_invalid_list_of_seeds_is_refused(capsys, tmp_path, text):
    assert run_taxel("thesis", f"--seeds={text}", "--out", tmp_path) == 1
    assert "--seeds: expected " in capsys.readouterr().err


def test_ten_documented_seeds_were_not_used_in_the_search_of_settings():
    assert len(UNSEEN_SEEDS) == 10
    assert not set(UNSEEN_SEEDS) & set(SEARCH_SEEDS)


def test_stored_result_of_other_settings_is_refused_with_the_name_of_the_setting(tmp_path):
    replace(make_result(101), settings={**describe_settings(), "sim_layer_m": 0.002}).write(tmp_path)
    with pytest.raises(TaxelError, match=r"result.json: expected results with the present settings.*sim_layer_m"):
        read_seed_result(tmp_path)


def test_damaged_stored_result_is_refused(tmp_path):
    (tmp_path / "result.json").write_text('{"seed": 101')
    with pytest.raises(TaxelError, match="found a damaged file; delete it"):
        read_seed_result(tmp_path)


def test_folder_without_a_stored_result_gives_none(tmp_path):
    assert read_seed_result(tmp_path / "none") is None


def make_summary_with_one_worse_seed() -> Summary:
    """Summarise two seeds with the printed numbers, and seed 103 with too few real points."""
    return Summary([make_result(101), make_result(102), make_result(SEED_WITH_FEW_POINTS, points=1000)])


def test_worst_skill_of_three_seeds_is_the_smallest():
    spread = make_summary_with_one_worse_seed().get_skill("raw", "points")
    assert spread.median == 1.0
    assert spread.worst < 0.0


def test_shown_seed_is_the_first_with_the_median_number_of_reproduced_findings():
    summary = make_summary_with_one_worse_seed()
    assert summary.seeds[summary.shown].seed == 101
