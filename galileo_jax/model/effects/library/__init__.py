"""The library: one physical or measurement effect per file, each registering itself."""
