"""What `fit`, `compare` and `diagnose` have in common on the command line."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from galileo_jax.commands import command
from galileo_jax.commands.options import adder
from galileo_jax.rollout.engine_names import ENGINES
from galileo_jax.runtime.atomic_write import check_folder
from galileo_jax.runtime.errors import InputError

if TYPE_CHECKING:
    from galileo_jax.api.fit_result import Fit
    from galileo_jax.clip.schema import Clip
    from galileo_jax.measurement.measure import Measurement


def add_clip_options(parser: command.Parser, function: str, out: str) -> None:
    """Adds what `fit`, `compare` and `diagnose` have in common; `out` is the help of --out."""
    add = adder(parser, function)
    add("effects_from", metavar="FILE.py")
    parser.add_argument("--out", metavar="DIR", help=out)
    add("seed", type=command.whole_number(0))
    add("engine", choices=ENGINES, metavar=None)
    add("pixels_per_metre", metavar="SCALE")


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


def out_folder(out: str | None, clips: "Sequence[Clip]", below: str = "") -> Path:
    """Where a call's results go: `--out`, or runs/ and the clips' names, and a folder in it.

    Raises:
      InputError: it is a file, or nothing can be written there.
    """
    folder = Path(out) if out else Path("runs") / "+".join(clip.path.stem for clip in clips)
    check_folder(folder)
    return folder if out else folder / below


def corrections(given: Sequence[Sequence[str]]) -> dict[str, list[list[float]]]:
    """`--correct` as the functions take it.

    Raises:
      InputError: a number is none.
    """
    found: dict[str, list[list[float]]] = {}
    for name, *values in given:
        try:
            found.setdefault(name, []).append([float(value) for value in values])
        except ValueError:
            text = " ".join(values)
            raise InputError(f"--correct {name}: {text!r} is not a frame, x and y") from None
    return found
