"""Tables of motions as any program writes them: bytes to columns with their roles and units."""
