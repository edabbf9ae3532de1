"""The `taxel` command."""
