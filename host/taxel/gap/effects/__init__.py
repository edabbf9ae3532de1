"""The catalogue of effects: fast models of what a simulator may lack, one effect in each file."""
