"""The Markdown pages of the repository as a folder that MkDocs can build, with the same positions and links."""

import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

from readme_links import make_links_relative
from site_maths import convert_formulas

LINK = re.compile(r"(!?\[[^\]]*\]\()([^)#\s]+)(#[^)\s]*)?(\))")
FENCE = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
OUTSIDE = ("http://", "https://", "mailto:")


def list_pages(root: Path) -> list[Path]:
    """Return the path of every Markdown page of the repository, relative to its root.

    Templates and hidden folders such as `.github` are omitted.
    """
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"],
        cwd=root,
        capture_output=True,
        text=True,
        check=True,
    )
    names = sorted(set(listed.stdout.splitlines()))
    pages = [Path(name) for name in names if not name.startswith(".") and not name.endswith(".template.md")]
    return [page for page in pages if (root / page).exists()]


def find_links(text: str) -> Iterator[tuple[str, str]]:
    """Yield the file and anchor of every link within the repository; either may be empty. Code blocks are ignored."""
    for _, target, anchor, _ in LINK.findall(FENCE.sub("", text)):
        if not target.startswith(OUTSIDE):
            yield target, anchor


def copy_pages(root: Path, out: Path) -> list[Path]:
    """Copy the Markdown pages, and the files to which they link, to the folder from which the site is built.

    root: the repository. out: the folder. Returns the pages' paths relative to both.
    """
    pages = list_pages(root)
    for page in pages:
        text = make_links_relative((root / page).read_text(), root)
        for target, _ in find_links(text):
            _copy_linked(root, root / page.parent / target, out)
        target_path = out / page
        target_path.parent.mkdir(parents=True, exist_ok=True)
        target_path.write_text(convert_formulas(_link_readmes(root / page.parent, text)))
    return pages


def read_title(page: Path) -> str:
    """Return the first heading of a page as plain text; the file's name without its suffix if there is no heading."""
    for line in page.read_text().splitlines():
        if line.startswith("# "):
            return line[2:].replace("`", "").strip()
    return page.stem


def _copy_linked(root: Path, path: Path, out: Path) -> None:
    """Copy the file `path`, to which a page links, from the repository `root` to the same place below `out`.

    Markdown pages, folders and files outside the repository are not copied.
    """
    path = path.resolve()
    if path.is_file() and path.suffix != ".md" and path.is_relative_to(root):
        copy = out / path.relative_to(root)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, copy)


def _link_readmes(folder: Path, text: str) -> str:
    """Return `text` with each link to a folder changed to its README, which a Git host shows for the folder.

    folder: folder of the page.
    """

    def link_readme(link: re.Match[str]) -> str:
        """Return a link with README.md appended to its target if the target is a folder that has one."""
        before, target, anchor, after = link.groups(default="")
        if not target.startswith(OUTSIDE) and (folder / target / "README.md").is_file():
            target = target.rstrip("/") + "/README.md"
        return before + target + anchor + after

    return LINK.sub(link_readme, text)
