"""Charts, pictures of the scene, and self-contained HTML pages of results."""
