"""The thesis's experiments of chapter 5 once more: its tables, its figures and what it found, ours beside its own."""
