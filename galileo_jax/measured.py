"""From the clips of a call to what was measured: what every command that fits begins with."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from galileo_jax import command
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.errors import InputError
from galileo_jax.observation import Observation, observe
from galileo_jax.rollout.engine_names import ENGINES


@dataclass(frozen=True)
class Measured:
    """A clip and where its objects were seen."""

    clip: Clip
    observation: Observation

    @property
    def name(self) -> str:
        """The clip's, without folder and suffix."""
        return self.clip.path.stem


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
        if clip.scenario == "ramp" and clip.pixels_per_metre is None and clip.video is not None:
            raise InputError(
                f"{clip.path}: pixels_per_metre: null; the scale of a ramp clip cannot be told "
                "from its motion; set it with `galileo label --scale X1 Y1 X2 Y2 METRES` or "
                "--pixels-per-metre"
            )
    first = clips[0]
    for i, clip in enumerate(clips[1:], 1):
        if clip.path.stem in (other.path.stem for other in clips[:i]):
            raise InputError(f"{clip.path}: two clips are named {clip.path.stem}")
        if clip.scenario != first.scenario or len(clip.objects) != len(first.objects):
            raise InputError(
                f"{clip.path}: {clip.scenario} with {len(clip.objects)} objects, but {first.path}: "
                f"{first.scenario} with {len(first.objects)}; clips given together are trials of "
                "the same objects"
            )
        for one, other in zip(first.objects, clip.objects, strict=True):
            if one.mass_kg != other.mass_kg:
                raise InputError(
                    f"{clip.path}: {other.name}.mass_kg: {other.mass_kg}, but {first.path}: "
                    f"{one.mass_kg}; clips given together are trials of the same objects"
                )
    return clips


def measure(clip: Clip) -> Measured:
    """Tracks a clip's video, or reads its csv track."""
    if clip.video is None:
        assert clip.track is not None  # load_clip requires one of the two
        return Measured(clip, read_observation_csv(clip.track))
    from galileo_jax.tracking import track_clip

    with command.progress() as bar:
        return Measured(clip, observe(clip, track_clip(clip, progress=bar)))
