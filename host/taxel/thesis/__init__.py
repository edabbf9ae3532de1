"""Reproduction of chapter 5 of the thesis: tables, figures and findings, compared with the printed ones."""
