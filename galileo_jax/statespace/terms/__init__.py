"""Terms: one file each."""
