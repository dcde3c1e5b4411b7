"""Clips given together are trials of the same objects: checked before anything is tracked."""

from collections.abc import Sequence

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.runtime.errors import InputError


def check_scale(clip: Clip) -> None:
    """Raises `InputError` where a model needs lengths in metres and the clip has none."""
    if SCENARIOS[clip.scenario].has_table and not clip.is_scale_known:
        raise InputError(
            f"{clip.path}: pixels_per_metre: null; the scale of a ramp clip cannot be determined "
            "from its motion; set it with `galileo label --scale X1 Y1 X2 Y2 METRES` or "
            "--pixels-per-metre"
        )


def check_same_objects(clips: Sequence[Clip]) -> None:
    """Checks that clips are trials of the same objects.

    Raises:
      InputError: two clips have the same name, or another scenario, number of objects or mass.
    """
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
