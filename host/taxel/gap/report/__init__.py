"""The gap report: its form, what goes into it, and how one that is not trusted is read."""
