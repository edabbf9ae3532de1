"""The blind check: worlds with hidden causes, sealed, diagnosed by a sandboxed process, opened and scored."""
