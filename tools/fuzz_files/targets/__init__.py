"""The readers under test, by kind of file."""
