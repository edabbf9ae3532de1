"""Links of README.md: absolute, because a package index shows the README without the repository."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Final

LINK: Final = re.compile(r"(!?)\[[^\]]*\]\(([^)\s]+)\)")
FENCE: Final = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
RAW_HOST: Final = "https://raw.githubusercontent.com/"
BRANCH: Final = "main"


def get_repository_urls(root: Path) -> tuple[str, str]:
    """Return the URL prefixes of a page and of a raw file of the repository.

    They follow from `[project.urls]` of pyproject.toml.
    """
    repository = tomllib.loads((root / "pyproject.toml").read_text())["project"]["urls"]["Repository"]
    raw = RAW_HOST + repository.removeprefix("https://github.com/")
    return f"{repository}/blob/{BRANCH}/", f"{raw}/{BRANCH}/"


def find_readme_errors(root: Path) -> Iterator[str]:
    """Yield one message for each link of README.md that is relative or names a file that the repository lacks.

    An image must use the prefix of raw files, because the page of a file is not an image.
    """
    page, raw = get_repository_urls(root)
    for mark, target in LINK.findall(FENCE.sub("", (root / "README.md").read_text())):
        prefix = raw if mark else page
        if not target.startswith(("https://", "http://")):
            yield f"README.md: expected an absolute link, found {target}; write {prefix}{target}"
        elif mark and not target.startswith(raw):
            yield f"README.md: expected an image below {raw}, found {target}"
        elif target.startswith(prefix) and not (root / target.removeprefix(prefix).partition("#")[0]).is_file():
            yield f"README.md: {target} names a file that does not exist in the repository"


def make_links_relative(text: str, root: Path) -> str:
    """Return `text` with links to the repository relative to its root, as the site needs them. text: README.md."""
    page, raw = get_repository_urls(root)
    return text.replace(f"]({page}", "](").replace(f"]({raw}", "](")
