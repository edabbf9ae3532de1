"""README.md and the pictures of the architecture: the checks of `make docs`, without a build of the site."""

import sys

import pytest

from host.tests.docs.page_blocks import ROOT


@pytest.fixture
def docs_tools(monkeypatch):
    """Make the modules of tools/docs importable during a test."""
    monkeypatch.syspath_prepend(str(ROOT / "tools" / "docs"))
    yield
    for name in ("readme_links", "draw_architecture", "svg_drawing"):
        sys.modules.pop(name, None)


@pytest.fixture
def repository(tmp_path):
    """Folder of a repository with one page and one picture, whose address is https://github.com/owner/name."""
    urls = '[project.urls]\nRepository = "https://github.com/owner/name"\n'
    (tmp_path / "pyproject.toml").write_text(urls)
    (tmp_path / "page.md").write_text("# Page\n")
    (tmp_path / "picture.png").write_bytes(b"")
    return tmp_path


def test_links_of_the_readme_are_absolute_and_name_existing_files(docs_tools):
    from readme_links import find_readme_errors

    assert list(find_readme_errors(ROOT)) == []


@pytest.mark.parametrize(
    ("link", "is_accepted"),
    [
        ("[a](https://github.com/owner/name/blob/main/page.md)", True),
        ("[a](https://github.com/owner/name/blob/main/page.md#anchor)", True),
        ("[a](https://github.com/owner/name/blob/main/missing.md)", False),
        ("[a](page.md)", False),
        ("[a](https://example.com/page.md)", True),
        ("![a](https://raw.githubusercontent.com/owner/name/main/picture.png)", True),
        ("![a](https://raw.githubusercontent.com/owner/name/main/missing.png)", False),
        ("![a](https://github.com/owner/name/blob/main/picture.png)", False),
        ("![a](picture.png)", False),
        ("```\n[a](page.md)\n```", True),
    ],
)
def test_only_absolute_links_to_existing_files_of_the_repository_are_accepted(
    docs_tools, repository, link, is_accepted
):
    from readme_links import find_readme_errors

    (repository / "README.md").write_text(link + "\n")
    assert (not list(find_readme_errors(repository))) is is_accepted


def test_links_of_the_readme_are_relative_on_the_site(docs_tools, repository):
    from readme_links import make_links_relative

    text = "[a](https://github.com/owner/name/blob/main/page.md) [b](https://github.com/owner/name/issues)"
    assert make_links_relative(text, repository) == "[a](page.md) [b](https://github.com/owner/name/issues)"


def test_pictures_of_the_architecture_are_up_to_date(docs_tools):
    from draw_architecture import find_stale_drawings

    assert find_stale_drawings() == []


def test_text_wider_than_its_box_is_refused(docs_tools):
    from svg_drawing import Drawing

    with pytest.raises(ValueError, match="at most"):
        Drawing(200, 100, "test").draw_box(0, 0, 100, 40, "a text that is wider than its box")
