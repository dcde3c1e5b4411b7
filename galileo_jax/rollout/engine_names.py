"""The engines' names, importable without JAX."""

ENGINES = ("auto", "rigid", "c", "mjx")
