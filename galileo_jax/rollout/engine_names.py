"""The engines' names and the kinds of motion, importable without JAX."""

ENGINES = ("auto", "rigid", "c", "mjx")
MOTIONS = ("planar", "free")  # along a line in the plane of the picture; with six coordinates
