"""What `fit`, `compare` and `diagnose` have in common on the command line."""

from collections.abc import Sequence
from pathlib import Path

from galileo_jax.clip.load import load_clip
from galileo_jax.clip.same_objects import check_same_objects, check_scale
from galileo_jax.clip.schema import Clip
from galileo_jax.commands import command
from galileo_jax.rollout.engine_names import ENGINES


def add_clip_options(parser: command.Parser, out: str) -> None:
    """Adds what `fit`, `compare` and `diagnose` have in common; `out` is the help of --out."""
    parser.add_argument(
        "--effects-from", action="append", default=[], metavar="FILE", help="more effects (Python)"
    )
    parser.add_argument("--out", help=out)
    parser.add_argument("--seed", type=command.whole_number(0), default=0)
    parser.add_argument("--engine", choices=ENGINES, default="auto")
    parser.add_argument("--pixels-per-metre", type=float, help="overrides the clip's scale")


def load_clips(paths: Sequence[str], pixels_per_metre: float | None = None) -> list[Clip]:
    """Loads and checks the clips of a call, trials of the same objects.

    Raises:
      InputError: a clip is wrong, two have the same name, or they are not trials of the same
        objects.
    """
    clips = [load_clip(Path(path), pixels_per_metre=pixels_per_metre) for path in paths]
    for clip in clips:
        for warning in clip.warnings:
            command.console().print(f"warning: {warning}")
        check_scale(clip)
    check_same_objects(clips)
    return clips
