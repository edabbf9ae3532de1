"""Version of the package; pyproject.toml reads the version from this file."""

VERSION = "0.2.0"
