"""What the commands about clips have in common: their options, their notes, a fit as a table."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from galileo_jax.commands import command
from galileo_jax.commands.options import VerbParser
from galileo_jax.runtime.atomic_write import check_folder
from galileo_jax.runtime.errors import InputError

if TYPE_CHECKING:
    from galileo_jax import Clip, Fit
    from galileo_jax.measurement.measure import Measurement


def add_clip_options(parser: VerbParser, out: str) -> None:
    """Adds what `fit`, `compare` and `diagnose` have in common; `out` is the help of --out."""
    parser.add("effects_from")
    parser.out(out)
    parser.add("seed", "engine", "pixels_per_metre")


def load_clips(call_clips: Sequence[str], pixels_per_metre: float | None) -> "list[Clip]":
    """The clips of a call, with their warnings printed."""
    from galileo_jax.clip.load import load_clip

    clips = [load_clip(path, pixels_per_metre=pixels_per_metre) for path in call_clips]
    warn(warning for clip in clips for warning in clip.warnings)
    return clips


def warn(lines: Iterable[str]) -> None:
    """Prints warnings to stderr, each once."""
    for line in dict.fromkeys(lines):
        command.say(f"warning: {line}")


def warn_of_tracks(measured: "Sequence[Measurement]", more: Iterable[str] = ()) -> None:
    """Warns of what is to be known of the tracks, and of `more`."""
    warn([*(line for one in measured for line in (*one.remarks, *one.doubts)), *more])


def notes_on(fit: "Fit", out: Path) -> None:
    """Prints to stderr what is to be known of a fit in `out` before it is trusted."""
    from galileo_jax.results.stale_outputs import stale_documents

    stale = stale_documents(out, [one.observation for one in fit.measurements])
    warn_of_tracks(fit.measurements, [*stale, *fit.warnings])
    for line in fit.taken_as_exact:
        command.say(f"note: {line}")


def out_folder(out: Path | None, clips: "Sequence[Clip]", below: str = "") -> Path:
    """Where a call's results go: `--out`, or runs/ and the clips' names, and a folder in it."""
    folder = out or Path("runs") / "+".join(clip.path.stem for clip in clips)
    check_folder(folder)
    return folder if out else folder / below


def corrections(given: Sequence[Sequence[str]]) -> dict[str, list[list[float]]]:
    """`--correct` as the functions take it."""
    found: dict[str, list[list[float]]] = {}
    for name, *values in given:
        try:
            found.setdefault(name, []).append([float(value) for value in values])
        except ValueError:
            text = " ".join(values)
            raise InputError(f"--correct {name}: {text!r} is not a frame, x and y") from None
    return found


def fit_table(found: "Fit", truth: Mapping[str, float], is_asked: bool = False) -> str:
    """What the user asked for, in a few lines; with a column for the truth if it is known.

    `is_asked`: whether what is missing has been asked already.
    """
    from galileo_jax.inference.per_mass import SUFFIX
    from galileo_jax.report.fit_text import error_text, fit_quality
    from galileo_jax.results.shown import is_as_declared, shown, shown_parameters, unit_text

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
        elif is_as_declared(entry):
            known = f"{mean:>10}{'':>10}   as declared{unit_text(entry)}"
        elif not entry["identified"]:
            known = f"   not determined by this clip: anything in {interval}"
        lines.append(f"{name:<18}{true:>10}{known}")
    lines.append(f"{error_text(result['error'])}; {result['status']}")
    return "\n".join([*lines, *fit_quality(result, is_asked)])
