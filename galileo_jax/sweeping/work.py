"""What workers do: from a clip's files to a measurement, and from measurements to a result."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from galileo_jax.api.track import tracks_of
from galileo_jax.measurement.measure import Measurement, measure
from galileo_jax.report.sweep_clips import thumbnail
from galileo_jax.runtime.atomic_write import write_json
from galileo_jax.runtime.precision import in_float64
from galileo_jax.sweeping.cell import Packed
from galileo_jax.sweeping.settings import Diagnose, Explain, Settings, Thesis

if TYPE_CHECKING:
    from galileo_jax.api.explain import Explanation
    from galileo_jax.api.fit_result import Fit

PAGE = "report.html"
CHECK, MISSING = "compare/compare.json", "diagnosis/diagnosis.json"  # of an explanation
FILES = ("video", "track")  # of a clip, beside its yaml


@dataclass(frozen=True)
class MeasuredClip:
    """A clip as it was tracked."""

    measurement: Measurement  # without its track in pixels
    # A picture from the middle of its motion, JPEG; None of a clip without a video
    thumbnail: bytes | None = None


@dataclass(frozen=True)
class CellResult:
    """What came of a cell."""

    # result.json as `galileo fit` writes it, or diagnosis.json; of `explain` that of its fit
    document: Mapping[str, Any]
    # What lies beside it, by path in the cell's folder: the page; of a fit the run; of `explain`
    # compare.json and, where something is missing, diagnosis.json
    files: Mapping[str, bytes] = field(default_factory=dict)


@in_float64
def measure_files(packed: Packed) -> MeasuredClip:
    """Loads and tracks a clip; whatever names a file names the one that it came from.

    Raises:
      InputError: something is wrong with it.
    """
    from galileo_jax.api.explain import answered_clips

    with packed.unpacked() as (file, as_named):
        (clip,), _ = answered_clips([file], {})
        warnings = tuple(map(as_named, clip.warnings))
        path = Path(as_named(str(clip.path)))
        named = {"path": path, "source": packed.source, "warnings": warnings}
        measured = measure(clip.model_copy(update=named))
        clip = measured.clip
        picture = thumbnail(clip, measured.observation)
        own = {key: getattr(clip, key) for key in FILES}
        files = {key: Path(as_named(str(file))) for key, file in own.items() if file}
        clip = clip.model_copy(update=files)
    return MeasuredClip(replace(measured, clip=clip, pixels=None), picture)


@in_float64
def run_cell(
    settings: Settings, measured: Sequence[Measurement], page_folder: Path | None = None
) -> CellResult:
    """A cell's numbers, and its page where it is to have one.

    `page_folder`: the cell's, which its page names in commands; nothing is written there. None:
    no page.

    Raises:
      InputError: the clips do not go with each other or with the method.
    """
    from galileo_jax.api.diagnose import diagnose
    from galileo_jax.api.explain import explained
    from galileo_jax.api.fit import fit

    tracks = tracks_of(measured)
    options = settings.model_dump(exclude={"method"})
    with tempfile.TemporaryDirectory(prefix="galileo.") as name:
        folder = Path(name)
        if isinstance(settings, Diagnose):
            found = diagnose(tracks, **options)
            if page_folder is not None:
                found.report(folder / PAGE)
            return CellResult(dict(found.document), _content(folder))
        if isinstance(settings, Explain):
            return _explanation(explained(tracks, **options), folder, page_folder)
        if isinstance(settings, Thesis):
            options |= {"method": "mh", "preset": "thesis"}
        else:
            options["method"] = settings.method
        fitted = fit(tracks, **options)
        if page_folder is not None:
            _write_run(fitted, folder, page_folder)
        _forget_unshared_programs(fitted)
        return CellResult(dict(fitted.result), _content(folder))


def _explanation(found: "Explanation", folder: Path, final: Path | None) -> CellResult:
    """What is told as of a fit, and beside it what it rests on, as `Explanation.save` writes it."""
    write_json(folder / CHECK, found.check_document)
    beside = {}
    if found.diagnosis is not None:
        write_json(folder / MISSING, found.diagnosis.document)
        if final is not None:
            page = found.diagnosis.report((folder / MISSING).with_name(PAGE))
            beside["what is missing, and why"] = page.relative_to(folder).as_posix()
    if final is not None:
        _write_run(found.fit, folder, final, found.paragraph, beside)
    return CellResult(dict(found.fit.result), _content(folder))


def _write_run(
    fitted: "Fit",
    folder: Path,
    final: Path,
    lead: str = "",
    beside: Mapping[str, str] | None = None,
) -> None:
    """Writes the run and its pages, which name the folder that it will lie in.

    `final`: where `folder` will lie; `lead` and `beside` as for `write_report`.
    """
    from galileo_jax.report.fit_page import write_report
    from galileo_jax.results.run import RESULT

    fitted.save(folder, report=False)
    (folder / RESULT).unlink()  # the store writes it last
    for run in fitted.runs(final):
        write_report(run, folder / run.folder.relative_to(final) / PAGE, lead, beside)


def _content(folder: Path) -> dict[str, bytes]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def _forget_unshared_programs(found: "Fit") -> None:
    """Frees compiled chains that no other clip can use: a worker would fill up with them."""
    import jax

    from galileo_jax.inference.log_posterior import density_of
    from galileo_jax.inference.samplers.program import Program

    is_sampled = found.result["method"] == "mh"
    is_thesis = "preset" in found.result
    if is_thesis or (is_sampled and not isinstance(density_of(found.problem), Program)):
        jax.clear_caches()
