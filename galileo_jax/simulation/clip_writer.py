"""From what was asked for to the files of one clip, or of a series."""

from pathlib import Path

from galileo_jax.runtime import progress
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation.clip_files import all_or_nothing
from galileo_jax.simulation.hidden import make_hidden
from galileo_jax.simulation.plane_clip import plane_clips
from galileo_jax.simulation.ramp_clip import ramp_clips
from galileo_jax.simulation.settings import Settings, checked

SHARE_DRAWN = 0.2  # of the time, about, that goes into the motions


def write_clips(out: Path, settings: Settings) -> tuple[Path, ...]:
    """Writes NAME.mp4 (or NAME.csv), NAME.yaml, NAME.truth.json; for a series NAME_1 and on.

    Returns:
      the videos or tracks.

    Raises:
      InputError: the settings mean nothing together, an effect has no place in the scene, or a
        file cannot be written; nothing is written then.
      Cancelled: the caller asked for it; nothing is written.
    """
    if out.suffix != settings.suffix:
        raise InputError(f"--out: {out.name} does not end in {settings.suffix}")
    settings = checked(settings)
    hidden = make_hidden(settings.effects, settings.strength, settings.effects_from)
    with progress.part(0.0, SHARE_DRAWN):
        progress.report("simulating", 0.0)
        if settings.has_ramp:
            writers = ramp_clips(settings, hidden, out.stem)
        else:
            writers = plane_clips(settings, hidden)
    count = len(writers)
    names = [f"{out.stem}_{i + 1}" if settings.series else out.stem for i in range(count)]
    try:
        with progress.part(SHARE_DRAWN, 1.0), all_or_nothing(out.parent) as folder:
            for i, (name, write) in enumerate(zip(names, writers, strict=True)):
                with progress.part(i / count, (i + 1) / count):
                    write(folder / f"{name}{settings.suffix}")
                    progress.report("writing", 1.0)
    except OSError as error:
        raise InputError(f"--out: {out}: {error.strerror or error}") from error
    return tuple(out.with_name(f"{name}{settings.suffix}") for name in names)
