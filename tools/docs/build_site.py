"""Build the site: `python tools/docs/build_site.py` (`make docs`) writes build/docs/site/index.html.

Pages stay where they are in the repository, so that the same links work here and on a Git host. Exit status 1 where a
link leads nowhere.
"""

import json
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
NEEDED = ("mkdocs", "mkdocstrings", "mkdocstrings_handlers", "latex2mathml", "pymdownx")
KIND = re.compile(r"^## (.+)$", re.MULTILINE)
ROW = re.compile(r"^\| \[[^\]]*\]\(([^)#]+)\)", re.MULTILINE)


def navigation(index: Path, source: Path, pages: list[Path]) -> list[dict[str, Any]]:
    """The four kinds as the index has them, and what is left of the pages as rooms."""
    from site_pages import title_of

    text = index.read_text()
    kinds = list(KIND.finditer(text))
    seen = {Path("README.md"), Path("docs/README.md")}
    entries: list[dict[str, Any]] = [{"taxel": "README.md"}, {"All pages": "docs/README.md"}]
    for kind, following in zip(kinds, [*kinds[1:], None], strict=False):
        rows = []
        for target in ROW.findall(text[kind.end() : following.start() if following else None]):
            page = (index.parent / target).resolve().relative_to(source.resolve())
            if not (source / page).exists():
                raise SystemExit(f"docs: docs/README.md links to {target}, which is not there")
            seen.add(page)
            rows.append({title_of(source / page): str(page)})
        entries.append({kind[1]: rows})
    rooms: dict[str, list[dict[str, str]]] = {}
    for page in pages:
        if page not in seen:
            rooms.setdefault(page.parts[0] if len(page.parts) > 1 else "project", []).append(
                {title_of(source / page): str(page)}
            )
    return [*entries, {"Rooms of the repository": [{name: inner} for name, inner in sorted(rooms.items())]}]


def add_references(source: Path, entries: list[dict[str, Any]]) -> None:
    """Write the pages that are made of commands and docstrings, and put them under Reference."""
    from site_commands import reference
    from site_modules import packages, page_of

    folder = source / "reference"
    folder.mkdir(exist_ok=True)
    (folder / "commands.md").write_text(reference())
    api = []
    for package, modules in packages(ROOT).items():
        (folder / f"{package}.md").write_text(page_of(package, modules))
        api.append({package: f"reference/{package}.md"})
    made: list[dict[str, Any]] = [{"Commands": "reference/commands.md"}, {"Python API": api}]
    for entry in entries:
        if "Reference" in entry:
            entry["Reference"] = [*made, *entry["Reference"]]


def main() -> int:
    """Stage, configure, build."""
    lacking = [name for name in NEEDED if find_spec(name) is None]
    if lacking:
        install = ".venv/bin/python -m pip install --no-build-isolation -e '.[docs]'"
        print(f"docs: {lacking[0]} is not installed; run {install}", file=sys.stderr)
        return 1
    from site_pages import stage

    build = ROOT / "build" / "docs"
    source, site = build / "source", build / "site"
    shutil.rmtree(source, ignore_errors=True)
    pages = stage(ROOT, source)
    entries = navigation(source / "docs" / "README.md", source, pages)
    add_references(source, entries)
    shutil.copyfile(HERE / "site.css", source / "site.css")
    settings = json.loads((HERE / "mkdocs.json").read_text())
    python = next(plugin for plugin in settings["plugins"] if "mkdocstrings" in plugin)["mkdocstrings"]["handlers"][
        "python"
    ]
    python["paths"] = [str(ROOT / folder) for folder in ("host", "protocol", "tools")]
    settings |= {"nav": entries, "docs_dir": str(source), "site_dir": str(site)}
    (build / "mkdocs.yml").write_text(json.dumps(settings))
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--quiet", "-f", str(build / "mkdocs.yml")], check=False
    )
    if done.returncode == 0:
        print(f"built: {(site / 'index.html').relative_to(ROOT)}, {len(list(site.rglob('*.html')))} pages")
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
