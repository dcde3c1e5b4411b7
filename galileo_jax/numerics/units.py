"""What a metre counts as where nobody knows how long one is."""

NOMINAL_SCALE_PX_PER_M = 500.0
