"""The blind check: worlds with hidden causes, sealed, diagnosed by another process, opened and scored."""
