"""Fuzzing of every reader of files, with an oracle for data that are read wrongly."""
