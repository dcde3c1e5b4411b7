"""The report of a run: plots and one self-contained HTML page."""

from galileo_jax.report.write import write_report

__all__ = ["write_report"]
