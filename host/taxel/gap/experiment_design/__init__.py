"""Ranking of further contacts by the information that each of them would add to a diagnosis."""
