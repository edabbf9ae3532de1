"""The API reference: one page per package with the docstrings of its modules."""

from pathlib import Path

SOURCES = {"host": "taxel", "protocol": "taxel_protocol", "tools": "taxel_tools"}


def list_packages(root: Path) -> dict[str, list[str]]:
    """Return the names of the public modules of each package, by package.

    The first name is that of the package itself.
    """
    found: dict[str, list[str]] = {}
    for folder, name in SOURCES.items():
        for init in sorted((root / folder / name).rglob("__init__.py")):
            package = ".".join(init.parent.relative_to(root / folder).parts)
            inner = sorted(path.stem for path in init.parent.glob("*.py") if not path.stem.startswith("_"))
            found[package] = [package, *(f"{package}.{stem}" for stem in inner)]
    return found


def make_package_page(package: str, modules: list[str]) -> str:
    """Return the Markdown text from which mkdocstrings makes the reference page of a package."""
    return "\n\n".join([f"# {package}", *(f"::: {module}" for module in modules)]) + "\n"
