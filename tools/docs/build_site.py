"""Build the documentation site: `python tools/docs/build_site.py` (`make docs`) writes build/docs/site/index.html.

The pages have the same relative positions as in the repository, so that the same links work on the site and on a Git
host. The exit status is 1 if a link is broken, if a link of README.md is not absolute or names a file that does not
exist, or if a drawing of the architecture is not up to date.
"""

import json
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from draw_architecture import find_stale_drawings
from readme_links import find_readme_errors

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
REQUIRED = ("mkdocs", "mkdocstrings", "mkdocstrings_handlers", "latex2mathml", "pymdownx")
KIND = re.compile(r"^## (.+)$", re.MULTILINE)
ROW = re.compile(r"^\| \[[^\]]*\]\(([^)#]+)\)", re.MULTILINE)


def make_navigation(index: Path, source: Path, pages: list[Path]) -> list[dict[str, Any]]:
    """Create the site's navigation: the four kinds of page as in the index, then all other pages by folder.

    index: copy of docs/README.md in the folder `source`. pages: all pages, relative to `source`. Exits the program if
    the index links to a page that does not exist.
    """
    from site_pages import read_title

    text = index.read_text()
    kinds = list(KIND.finditer(text))
    seen = {Path("README.md"), Path("docs/README.md")}
    entries: list[dict[str, Any]] = [{"taxel": "README.md"}, {"Documentation": "docs/README.md"}]
    for kind, following in zip(kinds, [*kinds[1:], None], strict=False):
        rows = []
        for target in ROW.findall(text[kind.end() : following.start() if following else None]):
            page = (index.parent / target).resolve().relative_to(source.resolve())
            if not (source / page).exists():
                raise SystemExit(f"docs: docs/README.md links to {target}, which does not exist")
            seen.add(page)
            rows.append({read_title(source / page): str(page)})
        entries.append({kind[1]: rows})
    folders: dict[str, list[dict[str, str]]] = {}
    for page in pages:
        if page not in seen:
            folders.setdefault(page.parts[0] if len(page.parts) > 1 else "project", []).append(
                {read_title(source / page): str(page)}
            )
    return [*entries, {"Folders of the repository": [{name: inner} for name, inner in sorted(folders.items())]}]


def add_references(source: Path, entries: list[dict[str, Any]]) -> None:
    """Write the reference pages of all commands and of the Python API, and add them to the section Reference of
    `entries`.
    """
    from site_commands import make_reference
    from site_modules import list_packages, make_package_page

    folder = source / "reference"
    folder.mkdir(exist_ok=True)
    (folder / "commands.md").write_text(make_reference())
    api = []
    for package, modules in list_packages(ROOT).items():
        (folder / f"{package}.md").write_text(make_package_page(package, modules))
        api.append({package: f"reference/{package}.md"})
    generated: list[dict[str, Any]] = [{"Commands": "reference/commands.md"}, {"Python API": api}]
    for entry in entries:
        if "Reference" in entry:
            entry["Reference"] = [*generated, *entry["Reference"]]


def main() -> int:
    """Check the README and the drawings, then build the site.

    The exit status is not 0 if a check or the build fails.
    """
    errors = [*find_readme_errors(ROOT), *find_stale_drawings()]
    for error in errors:
        print(f"docs: {error}", file=sys.stderr)
    missing = [name for name in REQUIRED if find_spec(name) is None]
    if missing:
        install = ".venv/bin/python -m pip install --no-build-isolation -e '.[docs]'"
        print(f"docs: {missing[0]} is not installed; run {install}", file=sys.stderr)
    if errors or missing:
        return 1
    return build_site(ROOT / "build" / "docs")


def build_site(build: Path) -> int:
    """Copy the pages to `build`/source and build the site in `build`/site. Returns the exit status of MkDocs."""
    from site_pages import copy_pages

    source, site = build / "source", build / "site"
    shutil.rmtree(source, ignore_errors=True)
    pages = copy_pages(ROOT, source)
    entries = make_navigation(source / "docs" / "README.md", source, pages)
    add_references(source, entries)
    shutil.copyfile(HERE / "site.css", source / "site.css")
    settings = json.loads((HERE / "mkdocs.json").read_text())
    (plugin,) = (plugin["mkdocstrings"] for plugin in settings["plugins"] if "mkdocstrings" in plugin)
    options = plugin["handlers"]["python"]["options"]
    options["extensions"] = [f"{HERE / 'doctest_blocks.py'}:DoctestBlocks"]
    plugin["handlers"]["python"]["paths"] = [str(ROOT / folder) for folder in ("host", "protocol", "tools")]
    settings |= {"nav": entries, "docs_dir": str(source), "site_dir": str(site)}
    (build / "mkdocs.yml").write_text(json.dumps(settings))
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "-f", str(build / "mkdocs.yml")]
    status = subprocess.run(command, check=False).returncode
    if status == 0:
        print(f"built: {(site / 'index.html').relative_to(ROOT)}, {len(list(site.rglob('*.html')))} pages")
    return status


if __name__ == "__main__":
    sys.exit(main())
