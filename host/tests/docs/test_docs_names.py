"""Every public name has a docstring, in whichever of the three packages; ruff's rules leave out what overrides."""

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PACKAGES = ("host/taxel", "protocol/taxel_protocol", "tools/taxel_tools")
DEFINITIONS = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def undocumented(node: ast.AST, name: str) -> Iterator[str]:
    """Public modules, classes, functions and methods below a node that have none.

    An overload, a setter and a method that overrides one of a documented base say nothing new.
    """
    if not ast.get_docstring(node):
        yield name
    for inner in () if isinstance(node, DEFINITIONS[1:]) else ast.iter_child_nodes(node):
        if isinstance(inner, DEFINITIONS) and not inner.name.startswith("_") and not says_nothing_new(inner):
            yield from undocumented(inner, f"{name}.{inner.name}")


def says_nothing_new(node: ast.AST) -> bool:
    marks = {ast.unparse(mark).rpartition(".")[2] for mark in getattr(node, "decorator_list", ())}
    return bool(marks & {"overload", "override", "setter"})


def modules() -> Iterator[tuple[str, Path]]:
    for package in PACKAGES:
        base = (ROOT / package).parent
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(base).with_suffix("").parts
            if not any(part.startswith("_") and part != "__init__" for part in parts):
                yield ".".join(part for part in parts if part != "__init__"), path


def test_every_public_name_has_a_docstring():
    lacking = [one for name, path in modules() for one in undocumented(ast.parse(path.read_text()), name)]
    assert lacking == []


def test_what_a_package_offers_is_there_and_is_documented():
    """`__all__` names things that exist; what it offers are classes and functions with docstrings, or values."""
    for name, path in modules():
        if path.name != "__init__.py":
            continue
        module = importlib.import_module(name)
        for offered in getattr(module, "__all__", ()):
            thing = getattr(module, offered)
            assert not callable(thing) or (thing.__doc__ or "").strip(), f"{name}.{offered}"
