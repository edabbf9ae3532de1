"""The gap report: its assembly, and the checked reading of an untrusted report."""
