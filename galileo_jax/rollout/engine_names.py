"""The engines' names, importable without JAX."""

ENGINES = ("auto", "c", "mjx")
