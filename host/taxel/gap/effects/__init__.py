"""The catalogue: cheap models of what a simulator may lack. One effect a file."""
