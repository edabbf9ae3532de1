"""The repository's Markdown pages as a tree that MkDocs can build: same places, same links."""

import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

from site_maths import with_formulas

LINK = re.compile(r"(!?\[[^\]]*\]\()([^)#\s]+)(#[^)\s]*)?(\))")
FENCE = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
OUTSIDE = ("http://", "https://", "mailto:")


def page_paths(root: Path) -> list[Path]:
    """Every page that the repository tracks, relative to its root; templates of generated pages are none."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"],
        cwd=root,
        capture_output=True,
        text=True,
        check=True,
    )
    names = sorted(set(listed.stdout.splitlines()))
    return [Path(name) for name in names if not name.endswith(".template.md") and (root / name).exists()]


def links_of(text: str) -> Iterator[tuple[str, str]]:
    """File and anchor of every link within the repository, either may be empty; blocks of code have none."""
    for _, target, anchor, _ in LINK.findall(FENCE.sub("", text)):
        if not target.startswith(OUTSIDE):
            yield target, anchor


def stage(root: Path, out: Path) -> list[Path]:
    """Write the pages, and the files that they link to, below `out`. Returns the pages."""
    pages = page_paths(root)
    for page in pages:
        text = (root / page).read_text()
        for target, _ in links_of(text):
            _copy_linked(root, root / page.parent / target, out)
        to = out / page
        to.parent.mkdir(parents=True, exist_ok=True)
        to.write_text(with_formulas(_to_pages(root / page.parent, text)))
    return pages


def title_of(page: Path) -> str:
    """Its first heading, without the marks."""
    for line in page.read_text().splitlines():
        if line.startswith("# "):
            return line[2:].replace("`", "").strip()
    return page.stem


def _copy_linked(root: Path, path: Path, out: Path) -> None:
    path = path.resolve()
    if path.is_file() and path.suffix != ".md" and path.is_relative_to(root):
        to = out / path.relative_to(root)
        to.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, to)


def _to_pages(folder: Path, text: str) -> str:
    """A Git host shows a folder's README for the folder; a site does not."""

    def page_of(found: re.Match[str]) -> str:
        before, target, anchor, after = found.groups(default="")
        if not target.startswith(OUTSIDE) and (folder / target / "README.md").is_file():
            target = target.rstrip("/") + "/README.md"
        return before + target + anchor + after

    return LINK.sub(page_of, text)
