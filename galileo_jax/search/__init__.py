"""The search over hypotheses: one table, moves that propose where to look next, one loop."""
