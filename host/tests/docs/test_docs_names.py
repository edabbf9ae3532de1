"""Every public name of the three packages has a docstring. Overrides of a documented method are exempt."""

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PACKAGES = ("host/taxel", "protocol/taxel_protocol", "tools/taxel_tools")
DEFINITIONS = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def list_undocumented(node: ast.AST, name: str) -> Iterator[str]:
    """Yield the names of public modules, classes, functions and methods at or below a node without a docstring."""
    if not ast.get_docstring(node):
        yield name
    for child in () if isinstance(node, DEFINITIONS[1:]) else ast.iter_child_nodes(node):
        if isinstance(child, DEFINITIONS) and not child.name.startswith("_") and not needs_no_docstring(child):
            yield from list_undocumented(child, f"{name}.{child.name}")


def needs_no_docstring(node: ast.AST) -> bool:
    """Return True for an overload, a setter, and a method that overrides a documented method (by its decorator)."""
    decorators = {ast.unparse(decorator).rpartition(".")[2] for decorator in getattr(node, "decorator_list", ())}
    return bool(decorators & {"overload", "override", "setter"})


def list_modules() -> Iterator[tuple[str, Path]]:
    """Yield (dotted name, path) of every public module."""
    for package in PACKAGES:
        base = (ROOT / package).parent
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(base).with_suffix("").parts
            if not any(part.startswith("_") and part != "__init__" for part in parts):
                yield ".".join(part for part in parts if part != "__init__"), path


def test_every_public_name_has_a_docstring():
    undocumented_names = [
        undocumented_name
        for name, path in list_modules()
        for undocumented_name in list_undocumented(ast.parse(path.read_text()), name)
    ]
    assert undocumented_names == []


def test_every_name_in_all_of_a_package_exists_and_is_documented():
    """A class or function in `__all__` has a docstring; a value needs none."""
    for name, path in list_modules():
        if path.name != "__init__.py":
            continue
        module = importlib.import_module(name)
        for public_name in getattr(module, "__all__", ()):
            member = getattr(module, public_name)
            assert not callable(member) or (member.__doc__ or "").strip(), f"{name}.{public_name}"
