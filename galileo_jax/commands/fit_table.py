"""A fit as a table, for the terminal."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from galileo_jax.api.fit_result import Fit


def table(found: "Fit", truth: Mapping[str, float]) -> str:
    """What the user asked for, in a few lines; with a column for the truth if it is known."""
    from galileo_jax.inference.per_mass import SUFFIX
    from galileo_jax.report.fit_text import chi2_text, fit_quality
    from galileo_jax.results.shown_digits import shown, unit_text
    from galileo_jax.results.shown_parameters import shown_parameters

    result: Mapping[str, Any] = found.result
    entries = shown_parameters(result)
    title = f"{'':<18}{'truth' if truth else '':>10}{'mean':>10}{'sd':>10}   95 % interval"
    lines = [title] if entries else []
    for name, entry in entries.items():
        mean, sd, low, high = (shown(entry, key) for key in ("mean", "sd", "q025", "q975"))
        interval = f"[{low}, {high}]{unit_text(entry)}"
        true = f"{truth[name]:.4g}" if name in truth else ""
        known = f"{mean:>10}{sd:>10}   {interval}"
        if f"{name}{SUFFIX}" in result["derived"]:
            known = "   not determined by this clip: only per mass, below"
        elif not entry["identified"]:
            known = f"   not determined by this clip: anything in {interval}"
        lines.append(f"{name:<18}{true:>10}{known}")
    error = result["error"]
    lines.append(
        f"{chi2_text(error)}, velocity error {error['rmse']:.4f} m/s (tracking noise "
        f"{error['noise']:.4f}); {result['status']}"
    )
    return "\n".join([*lines, *fit_quality(result)])
