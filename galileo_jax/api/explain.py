"""`explain`: everything about a film or table in one call, as a lab report says it."""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.api.bundle import Bundle, bundle_of
from galileo_jax.api.clips import ClipLike, as_list, load
from galileo_jax.api.compare import Comparison, compare
from galileo_jax.api.diagnose import Diagnosis, diagnose_fitted
from galileo_jax.api.fit import fit as fit_tracks
from galileo_jax.api.fit_result import Fit, write_pages
from galileo_jax.api.look import Look, look
from galileo_jax.api.proposed_clip import clip_of, placed
from galileo_jax.api.track import TrackLike, tracks_of
from galileo_jax.api.understand import Understood, is_declared, understand
from galileo_jax.clip.file_kinds import FILM_SUFFIXES, TRACK_SUFFIXES, is_track, is_yaml
from galileo_jax.clip.load import find_yaml, has_yaml, load_clip
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.sources import source_of
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.measurement.track_cache import is_tracked
from galileo_jax.report.paragraph import paragraph
from galileo_jax.results.command_line import command_line
from galileo_jax.runtime import progress
from galileo_jax.runtime.atomic_write import write_json
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import check_known
from galileo_jax.runtime.precision import in_float64

UNDERSTOOD, FITTED, COMPARED = 0.1, 0.35, 0.45  # shares of the work, for progress


@dataclass(frozen=True, eq=False)
class Explanation:
    """What a film or table shows.

    Attributes:
      fit: the fit that is told: of the model with what was found missing, if anything was.
      check: the model without missing effects against the data; `check.fit` is its fit.
      diagnosis: what is missing; None where nothing is, or where the clip cannot tell.
      command: the command that does the same.
      gravity: where nothing is missing and nothing carries the objects, the acceleration of free
        fall that the motion itself shows, as an entry of result.json; empty where it shows none.
      files: that were written.
    """

    fit: Fit
    check: Comparison
    diagnosis: Diagnosis | None
    command: str
    gravity: Mapping[str, Any] = field(default_factory=dict)
    files: tuple[Path, ...] = ()

    @cached_property
    def looks(self) -> tuple[Look, ...]:
        """What is seen in each file before anything is fitted."""
        clips = [one.clip for one in self.fit.measurements]
        return tuple(look(source) for clip in clips if (source := clip.video or clip.track))

    @property
    def look(self) -> Look:
        """What is seen in the first file."""
        return self.looks[0]

    @property
    def could_not_see(self) -> Mapping[str, Mapping[str, Any]]:
        """See `Comparison.could_not_see`, of the check."""
        return self.check.could_not_see

    @property
    def in_question(self) -> tuple[str, ...]:
        """See `Comparison.in_question`, of the check."""
        return self.check.in_question

    @cached_property
    def paragraph(self) -> str:
        """The result in the words of a lab report."""
        clip = self.fit.measurements[0].clip
        shapes, names = ([getattr(item, key) for item in clip.objects] for key in ("shape", "name"))
        rolls = [item.roll_inertia is not None for item in clip.objects]
        found = None if self.diagnosis is None else self.diagnosis.document
        return paragraph(self.fit.result, self.check_document, found, shapes, names, rolls)

    @property
    def check_document(self) -> dict[str, Any]:
        """compare.json: the check's, and what gravity the motion shows, where it shows any."""
        return {**self.check.document, **({"gravity": self.gravity} if self.gravity else {})}

    @in_float64
    def report(self, path: str | Path, beside: Mapping[str, str] | None = None) -> tuple[Path, ...]:
        """Writes the page: the paragraph, then all of the fit.

        Args:
          path: the page; of several clips each has its own: NAME.html becomes NAME_CLIP.html.
          beside: titles of other pages to their places, for links; None: none.
        """
        path = Path(path)
        return write_pages(self.fit.runs(path.parent), path, self.paragraph, beside)

    @in_float64
    def save(self, folder: str | Path) -> "Explanation":
        """Writes the run as `Fit.save` does, its page with the paragraph, and what it rests on.

        That is compare/compare.json and, where something is missing, diagnosis/.

        Returns:
          the explanation, with its `files`.
        """
        folder = Path(folder)
        fit = self.fit.save(folder, report=False)
        beside: dict[str, str] = {}
        files = [folder / "result.json"]
        write_json(folder / "compare" / "compare.json", self.check_document)
        files.append(folder / "compare" / "compare.json")
        if self.diagnosis is not None:
            self.diagnosis.save(folder / "diagnosis")
            files += [folder / "diagnosis" / name for name in ("diagnosis.json", "report.html")]
            beside["what is missing, and why"] = "diagnosis/report.html"
        pages = self.report(folder / "report.html", beside)
        return replace(self, fit=fit, files=(*pages, *files))

    @in_float64
    def bundle(self, path: str | Path) -> Bundle:
        """Writes one zip to be attached to an issue: tracks, yamls, results, versions, command.

        It has no film, no picture and no name of a file, folder, user or computer. Unpacked, its
        tracks are fitted again to the same numbers.

        Args:
          path: of the zip.

        Raises:
          InputError: the file cannot be written.
        """
        return bundle_of(self, path)

    def __repr__(self) -> str:
        return f"<Explanation {', '.join(self.fit.names)}: {self.paragraph}>"

    def _repr_html_(self) -> str:
        return f"<p>{escape(self.paragraph)}</p>{self.fit._repr_html_()}"


@in_float64
def explain(
    clips: ClipLike | Sequence[ClipLike],
    *,
    out: str | Path | None = None,
    scenario: str | None = None,
    ramp_angle: float | None = None,
    pixels_per_metre: float | None = None,
    track_units: str | None = None,
    fps: float | None = None,
    point: Sequence[float] | Sequence[Sequence[float]] | None = None,
    engine: str = "auto",
    seed: int = 0,
    on_progress: progress.OnProgress | None = None,
    cancel: progress.CancelFlag | None = None,
) -> Explanation:
    """Looks, tracks, fits, tests the model, and finds out what is missing where it fails.

    What is said here goes before what a yaml beside the file declares; what neither says is taken
    from the file where that shows it.

    Args:
      clips: a film or table of any program, its yaml or a clip; or several, or a folder with them:
        trials of the same objects.
      out: a folder for the results, and for the fit before it is asked what is missing; None:
        nothing is written.
      scenario: what the clip shows, such as ramp, incline or flight; None: as the path looks.
      ramp_angle: degrees; None: as the path lies, where that shows it.
      pixels_per_metre: of the picture; None: not known.
      track_units: of a table: m, cm, mm, km, in, ft or px; None: as the table says.
      fps: true frames per second; None: as the file says.
      point: (x, y), the middle of the object in the first picture, px, or one for each object in
        the order in which they set out; None: what moves first.
      engine: what simulates the motion: "auto" (rigid), "rigid", "c" or "mjx".
      seed: of all random numbers; the same seed gives the same result.
      on_progress: called with the stage, the share done (0 to 1) and what there is of the result.
      cancel: a flag with `is_set`, such as `threading.Event`.

    Raises:
      InputError: a file is wrong, or something is missing that only a person can know; one line
        names all of it.
      Cancelled: `cancel` was set.

    Examples:
      >>> import galileo_jax as gx
      >>> made = gx.simulate("slide.csv", scenario="incline", seed=3, track_only=True)
      >>> found = gx.explain("slide.csv")
      >>> found.paragraph.split(" with")[0]
      'The block slid'
    """
    places = [] if point is None else np.reshape(point, (-1, 2))
    said = {
        "scenario": scenario,
        "ramp_angle_deg": ramp_angle,
        "pixels_per_metre": pixels_per_metre,
        "track_units": track_units,
        "fps": fps,
        "points": [(float(x), float(y)) for x, y in places] or None,
    }
    answers = {key: value for key, value in said.items() if value is not None}
    with progress.scope(on_progress, cancel):
        progress.report("looking", 0.0)
        with progress.part(0.0, UNDERSTOOD):
            found_clips, _ = answered_clips(sources_of(clips), answers)
        found = explained(found_clips, engine, seed, out)
        if out is not None:
            progress.report("writing the page", 0.97)
            found = found.save(out)
        progress.report("explained", 1.0, found)
        return found


def sources_of(clips: ClipLike | Sequence[ClipLike]) -> list[ClipLike]:
    """The clips of a call; of a folder all in it, in the order of their names."""
    found: list[ClipLike] = []
    for one in as_list(clips):
        is_folder = isinstance(one, str | Path) and Path(one).is_dir()
        found += _in_folder(Path(one)) if is_folder else [one]
    return found


def _in_folder(folder: Path) -> list[Path]:
    for file, kind in (("result.json", "run"), ("sweep.json", "sweep")):
        if (folder / file).is_file():
            raise InputError(
                f"{folder}: a {kind}, which is a result; a film, a table or a folder of them"
            )
    found = [
        path
        for path in sorted(folder.iterdir())
        if path.is_file() and path.suffix.lower() in (*TRACK_SUFFIXES, *FILM_SUFFIXES)
    ]
    if not found:
        raise InputError(f"{folder}: no film and no table in this folder")
    return found


def understood(clip: ClipLike, answers: Mapping[str, Any]) -> Clip | Understood:
    """The checked clip, where its yaml leaves nothing open; else what is understood of the file.

    `answers`: what a person said, by keys of the yaml: it goes before what a yaml declares.
    """
    if isinstance(clip, Clip):
        return clip
    if isinstance(clip, Mapping):
        return load(clip)
    path = Path(clip)
    is_elsewhere = path.is_file() and not has_yaml(path) and source_of(path) is not None
    if is_elsewhere or is_declared(path) or (is_yaml(path) and not path.is_file()):
        return load_clip(clip, **_declared_at(path, answers))
    return understand(path)


def _declared_at(path: Path, answers: Mapping[str, Any]) -> dict[str, Any]:
    """Answers with the objects that a yaml declares where `points`, px, say that they are."""
    given = dict(answers)
    points = given.pop("points", None)
    if points is None:
        return given
    if is_track(path):
        raise InputError(f"{path}: point (given in the call): a table says itself where things are")
    yaml_path = find_yaml(path)
    return given | {"objects": placed(read_mapping(yaml_path).get("objects"), points, yaml_path)}


def kept(clips: ClipLike | Sequence[ClipLike]) -> list[str]:
    """What a call that was stopped leaves for the next: yamls and tracks of films, in words."""
    found: list[str] = []
    with contextlib.suppress(InputError):
        for source in sources_of(clips):
            with contextlib.suppress(InputError):
                if isinstance(source, str | Path) and is_declared(source):
                    clip = load_clip(source)
                    found.append(str(clip.path))
                    found += [f"the track of {clip.video}"] if is_tracked(clip) else []
    return found


def answered_clips(
    clips: Sequence[ClipLike],
    said: Mapping[str, Any],
    ask: Callable[[Understood], Understood] = lambda known: known,
    look_at: Callable[[ClipLike, Mapping[str, Any]], Clip | Understood] = understood,
) -> tuple[list[Clip], list[Understood]]:
    """The checked clips, and those whose yaml leaves something open with what was answered.

    What is answered of one trial holds of the next, but where its things are. Nothing is written.

    Args:
      clips: the trials.
      said: of all of them, by keys of the yaml.
      ask: returns what is understood of a clip with all answers.
      look_at: `understood`, or it with a memory or a display of its progress.

    Raises:
      InputError: there is no such scenario.
    """
    if (scenario := said.get("scenario")) is not None:
        check_known("scenario", "scenario", scenario, SCENARIOS)
    found: list[Clip] = []
    asked: list[Understood] = []
    answers = said
    for clip in clips:
        known = look_at(clip, said)
        if isinstance(known, Clip):
            found.append(known)
            continue
        asked.append(ask(known.with_answers(answers)))
        found.append(clip_of(asked[-1], str(clip)))
        answers = {k: v for k, v in asked[-1].answers.items() if k != "points" or k in said}
    return found, asked


def explained(
    tracks: Sequence[TrackLike], engine: str, seed: int, out: str | Path | None = None
) -> Explanation:
    """The explanation of clips that are checked, or tracked already.

    `out`: a folder in which the fit is before it is asked what is missing, for those who stop
    there; None: nothing is written.
    """
    with progress.part(UNDERSTOOD, FITTED):
        first = fit_tracks(tracks, engine=engine, seed=seed)
    with progress.part(FITTED, COMPARED):
        check = compare(first)
    sources = [one.clip.source for one in first.measurements]
    command = command_line("explain", sources, engine=engine, seed=seed or None)
    found = Explanation(first, check, None, command)
    if check.found.no_verdict is not None or "impossible" in first.result:
        return found  # what would be missing is no result either
    with progress.part(COMPARED, 0.95):
        if check.is_adequate and not (check.in_question or check.rests_on_imperfections):
            return replace(found, gravity=_gravity(first, engine, seed))
        if out is not None:
            found.save(out)
        progress.report("asking what is missing", 0.0, found)
        missing = diagnose_fitted(first, engine=engine, seed=seed)
        progress.report("fitting with what is missing", 0.98)
        return replace(found, fit=missing.best, diagnosis=missing)


def _gravity(fit: Fit, engine: str, seed: int) -> dict[str, Any]:
    """What a fit says of gravity where that is free; empty where it tells nothing."""
    clip = fit.measurements[0].clip
    if SCENARIOS[clip.scenario].has_surface or not clip.is_scale_known:
        return {}
    progress.report("what gravity it shows", 0.7)
    free = fit_tracks(tracks_of(fit.measurements), free="gravity", engine=engine, seed=seed)
    entry = free.parameters["gravity"]
    return dict(entry) if entry["identified"] else {}
