"""Analysis of a board's raw counts: pure functions on arrays."""
