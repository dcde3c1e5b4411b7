"""The jobs by name: each calls the API, writes what the commands write, and returns a view.

What is there before the end is reported with the progress.

They run in the worker's process, whose working folder is the one that was opened; results that
are asked for again are kept in its memory.
"""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import galileo_jax as gx
from galileo_jax.api.clips import ClipLike
from galileo_jax.api.explain import answered_clips, understood
from galileo_jax.api.proposed_clip import write_yaml
from galileo_jax.api.questions import answered
from galileo_jax.api.understand import Understood, sentence_of
from galileo_jax.clip.file_kinds import YAML_SUFFIXES
from galileo_jax.clip.schema import Clip
from galileo_jax.runtime import progress
from galileo_jax.runtime.errors import InputError
from galileo_jax.studio import views
from galileo_jax.studio.paths import check_declared
from galileo_jax.studio.store import yaml_content

_fits: dict[str, gx.Fit] = {}  # by run and what it was made of
_MOST_FITS = 12
_seen: dict[str, tuple[Any, Clip | Understood]] = {}  # by clip, with the state of its files


def propose(video: str) -> dict[str, Any]:
    """What a video seems to show."""
    return {"proposal": asdict(gx.propose(video))}


def understand(clip: str, typed: Mapping[str, str]) -> dict[str, Any]:
    """What a clip shows in one sentence, and what is asked of a person."""
    known = _understood(clip, {})
    if isinstance(known, Clip):
        return {"sentence": sentence_of(known), "questions": [], "problems": {}, "things": []}
    found = answered(known, typed)
    return {
        "sentence": sentence_of(found.known),
        "questions": [asdict(one) for one in found.questions],
        "problems": dict(found.problems),
        "things": [[*place, *size] for place, size in known.things.items()],
    }


def explain(clips: Sequence[str], typed: Mapping[str, str], run: str) -> dict[str, Any]:
    """What `galileo FILE` does, with answers as somebody types them there."""

    def ask(known: Understood) -> Understood:
        found = answered(known, typed)
        if found.problems:
            raise InputError(next(iter(found.problems.values())))
        return known.with_answers(found.known.answers)

    checked, asked = answered_clips(clips, {}, ask, _understood)
    for known in asked:
        with contextlib.suppress(InputError):  # a folder that is not to be written in
            write_yaml(known)
    found = gx.explain(checked, out=run)
    _keep(run, found.fit)
    return views.explanation_view(found)


def _understood(clip: ClipLike, said: Mapping[str, Any]) -> Clip | Understood:
    """`understood`, once for every state of the clip's files."""
    path = Path(str(clip))
    files = (path, *(path.with_suffix(suffix) for suffix in YAML_SUFFIXES))
    for one in files[1:]:
        check_declared(Path(), path.parent, yaml_content(one))
    state = [one.stat().st_mtime_ns if one.is_file() else 0 for one in files]
    if (kept := _seen.get(str(clip))) is None or kept[0] != state:
        kept = _seen[str(clip)] = (state, understood(clip, said))
    return kept[1]


def shown(content: Mapping[str, Any] | gx.Explanation) -> dict[str, Any]:
    """A partial result of the API as the page shows it."""
    if isinstance(content, gx.Explanation):
        return views.explanation_view(content)
    given = dict(content)
    motions = given.pop("motions", None)
    if motions is not None:
        given["curves"] = [views.thin(one) for one in motions()]
    return given


def track(clips: Sequence[str]) -> dict[str, Any]:
    """Tracks clips; NAME_track/track_px.csv, and track_m.csv where the scale is known."""
    shown = []
    for i, clip in enumerate(clips):
        with progress.part(i / len(clips), (i + 1) / len(clips)):
            loaded = gx.load(clip)
            names = [item.name for item in loaded.objects]
            begun = {"clip": loaded.path.stem, "objects": names, "fps": loaded.fps}
            progress.report("tracking", 0.0, {"tracking": begun})
            found = gx.track(loaded)
            found.save_tables(f"{Path(clip).stem}_track")
            shown.append(views.track_view(found))
            progress.report("tracking", 1.0, {"track": shown[-1]})
    return {"tracks": shown}


def fit(
    clips: Sequence[str],
    run: str,
    effects: Sequence[str],
    effects_from: Sequence[str],
    of: str,
) -> dict[str, Any]:
    """Fits a model, and writes the run as `galileo fit` does."""
    key = f"{run} {of} {','.join(effects)}"
    with progress.part(0.0, 0.9):
        found = _fits.get(key)
        if found is None:
            found = gx.fit(list(clips), effects=list(effects), effects_from=list(effects_from))
    view = views.fit_view(found)
    progress.report("writing the report", 0.95, {"fit": view})
    _fits[key] = _keep(run, found.save(run))
    return {"fit": view}


def compare(run: str) -> dict[str, Any]:
    """Compares a run with its data; RUN/compare."""
    check = gx.compare(_fit_of(run))
    view = views.comparison_view(check)
    progress.report("writing the page", 0.95, {"compare": view})
    check.save(Path(run) / "compare")
    return {"view": view}


def diagnose(clips: Sequence[str], run: str, effects_from: Sequence[str]) -> dict[str, Any]:
    """Asks which effect is missing, adds nothing; RUN/diagnosis."""
    found = gx.diagnose(list(clips), add="none", effects_from=list(effects_from))
    view = views.diagnosis_view(found)
    verdict = {**view, "document": found.document}
    progress.report("writing the page", 0.97, {"verdict": verdict})
    found.save(Path(run) / "diagnosis")
    return {"view": view}


def predict(run: str, seconds: float) -> dict[str, Any]:
    """Continues a run beyond its clips, each of them."""
    fit = _fit_of(run)
    clips = {}
    for i, name in enumerate(fit.names):
        with progress.part(i / len(fit.names), (i + 1) / len(fit.names)):
            folder = Path(run) if len(fit.names) == 1 else Path(run) / name
            ahead = gx.predict(fit if len(fit.names) == 1 else folder, seconds=seconds)
            ahead.save(folder)
            clips[name] = views.prediction_view(ahead)
    return {"view": {"clips": clips}}


def export(run: str, to: str) -> dict[str, Any]:
    """Writes a run for other programs."""
    done = gx.export(run, to=to)  # pyright: ignore[reportArgumentType]
    return {"files": [str(path) for path in done.paths]}


def open_run(run: str) -> dict[str, Any]:
    """A run that lies there, of whatever command."""
    return {"fit": views.fit_view(_fit_of(run))}


def simulate(run: str, values: Mapping[str, float]) -> dict[str, Any]:
    """Where the model of a run has the objects with other parameters."""
    motions = _fit_of(run).motions(values)
    return {"motions": [views.model_view(one) for one in motions], "values": dict(values)}


def _fit_of(run: str) -> gx.Fit:
    """The fit in a run's folder; read from there where the worker did not make it itself."""
    return _fits.get(_key(run)) or _keep(run, gx.load_run(run))


def _keep(run: str, fit: gx.Fit) -> gx.Fit:
    """The fit, which lies in a run's folder now."""
    while len(_fits) >= _MOST_FITS:
        _fits.pop(next(iter(_fits)))
    _fits[_key(run)] = fit
    return fit


def _key(run: str) -> str:
    return f"{run} {(Path(run) / 'result.json').stat().st_mtime_ns}"
