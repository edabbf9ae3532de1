"""Rendering of the page's templates by Jinja2; every value is escaped unless the template marks it as safe."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import Any

from taxel.optional import optional_import

with optional_import("jinja2", "the page of a gap report"):
    import jinja2


def render(template: str, **context: Any) -> str:
    """Text of a template. template: path in the folder `templates`."""
    return _environment().get_template(template).render(**context)


def read_resource(name: str) -> str:
    """Content of a file of this package. name: path in the package."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


@cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: read_resource(f"templates/{name}")),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
