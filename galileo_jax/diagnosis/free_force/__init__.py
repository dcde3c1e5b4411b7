"""An acceleration that no effect explains, as a Gaussian process: its fit and its size."""
