"""What workers do: from a clip's files to a measurement, and from measurements to a result."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from galileo_jax.api.track import Track
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import Measurement, measure
from galileo_jax.runtime.precision import in_float64
from galileo_jax.sweeping.clip_files import Packed
from galileo_jax.sweeping.settings import Diagnose, Settings, Thesis


@in_float64
def measure_files(packed: Packed) -> Measurement:
    """Loads and tracks a clip.

    Raises:
      InputError: something is wrong with it.
    """
    with packed.unpacked() as path:
        measured = measure(load_clip(path))
    clip = measured.clip
    came_from: dict[str, Any] = {
        "path": packed.path.with_name(clip.path.name),
        "source": str(packed.path),
    }
    for key in ("video", "track"):
        if (file := getattr(clip, key)) is not None:
            came_from[key] = packed.path.with_name(Path(file).name)
    return replace(measured, clip=clip.model_copy(update=came_from), pixels=None)


def run_cell(settings: Settings, measured: Sequence[Measurement]) -> dict[str, Any]:
    """A cell's numbers: result.json as `galileo fit` writes it, or diagnosis.json.

    Raises:
      InputError: the clips do not go with each other or with the method.
    """
    from galileo_jax.api.diagnose import diagnose
    from galileo_jax.api.fit import fit

    tracks = [Track(one.clip, None, one) for one in measured]
    options = settings.model_dump(exclude={"method"})
    if isinstance(settings, Diagnose):
        return dict(diagnose(tracks, **options).document)
    if isinstance(settings, Thesis):
        options |= {"method": "mh", "preset": "thesis"}
    else:
        options["method"] = settings.method
    found = fit(tracks, **options)
    _forget_unshared_programs(found)
    return dict(found.result)


def _forget_unshared_programs(found: Any) -> None:
    """Frees compiled chains that no other clip can use: a worker would fill up with them."""
    import jax

    from galileo_jax.inference.density import density_of
    from galileo_jax.inference.samplers.program import Program

    is_sampled = found.result["method"] == "mh"
    is_thesis = "preset" in found.result
    if is_thesis or (is_sampled and not isinstance(density_of(found.problem), Program)):
        jax.clear_caches()
