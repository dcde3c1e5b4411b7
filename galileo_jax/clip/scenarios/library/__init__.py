"""The library: one scenario per file, each registering itself."""
