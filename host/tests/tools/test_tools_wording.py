"""The check of the glossary finds its words in comments, docstrings, messages and names, and nowhere else."""

import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[3] / "tools" / "wording"
sys.path.insert(0, str(FOLDER))
import check_terms  # noqa: E402 - from the folder of the tool

TERMS = check_terms.read_terms()
IN_PROSE = [term for term in TERMS if term.paths == ("*",) and term.prose and term.prose.search(f"a {term.word} b")]


def find(content, path="host/taxel/example.py"):
    """Return the (word, line) pairs that the check finds in the content of a file."""
    return [(finding.word, finding.line) for finding in check_terms.Search(TERMS).findings_in(path, content)]


@pytest.mark.parametrize("term", IN_PROSE, ids=lambda term: term.word)
def test_each_word_is_found_in_comments_and_strings(term):
    text = f"a {term.word} b"
    assert (term.word, 1) in find(f"# {text}\n")
    assert (term.word, 2) in find(f'MESSAGE = (\n    f"{text} {{name}}"\n)\n')
    assert (term.word, 3) in find(f'def run():\n    """Text.\n    {text}\n    """\n')
    assert (term.word, 2) in find(f"First line.\n{text}\n", "docs/page.md")
    assert (term.word, 1) in find(f"/* {text} */\n", "firmware/hub/example.c")


def test_more_than_20_words_are_checked_in_prose():
    assert len(IN_PROSE) > 20


def test_a_word_in_a_name_is_found_only_where_the_name_is_defined():
    term = next(term for term in TERMS if term.name is not None and term.name.fullmatch(term.word))
    assert (term.word, 1) in find(f"first_{term.word} = 1\n")
    assert not find(f"import other\nother.first_{term.word}()\n")
    assert not find(f'VALUE = read("first_{term.word}")\n')


def test_a_word_in_code_marks_within_prose_is_not_found():
    word = IN_PROSE[0].word
    assert not find(f'TEXT = "see `{word}` first"\n')
    assert not find(f"Text with `{word}` in it.\n", "docs/page.md")
