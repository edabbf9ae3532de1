"""Rendering of page templates by Jinja2; every value is escaped unless the template marks it as safe."""

from functools import cache
from importlib import resources
from typing import Any

from taxel.optional import optional_import

with optional_import("jinja2", "an HTML page"):
    import jinja2


def render(template: str, *, package: str = __package__, **context: Any) -> str:
    """Return the text of a template.

    template: path in the folder `templates` of the package. context: variables of the template. Raises
    jinja2.UndefinedError for a variable of the template that `context` lacks.
    """
    return _get_environment(package).get_template(template).render(**context)


def read_resource(name: str, package: str = __package__) -> str:
    """Return the text of a file of a package. name: path in the package."""
    return resources.files(package).joinpath(name).read_text(encoding="utf-8")


@cache
def _get_environment(package: str) -> jinja2.Environment:
    """Return the Jinja2 environment for the templates of a package. Cached."""
    return jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: read_resource(f"templates/{name}", package)),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
