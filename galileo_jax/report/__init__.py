"""Charts, pictures of the scene, and self-contained HTML pages of results."""

from galileo_jax.report.fit_page import write_report

__all__ = ["write_report"]
