"""`next_experiment`: which setting of the lab would tell most?"""

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from galileo_jax import __version__
from galileo_jax.api.clips import as_list
from galileo_jax.api.diagnose import DOCUMENT, Diagnosis, diagnose
from galileo_jax.api.fit_result import load_run
from galileo_jax.api.track import Track, tracks_of
from galileo_jax.assembly.build_problem import with_library
from galileo_jax.clip.schema import Clip
from galileo_jax.experiment.choose import Expected, best_first, default_can, expect, sentence_of
from galileo_jax.experiment.hypothesis_probabilities import FILE, Beliefs, beliefs_of, read_beliefs
from galileo_jax.experiment.settings import NUMBERS, check_can, grid, parse_can
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.effects.registry import effect_names, load_file
from galileo_jax.report.draw import to_plotly
from galileo_jax.report.experiment_page import gains_chart, write_next_page
from galileo_jax.runtime import progress
from galileo_jax.runtime.atomic_write import write_json
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.lazy import go, pd
from galileo_jax.runtime.precision import in_float64

Found = Diagnosis | str | Path
DIAGNOSED = 0.8  # share of the work where runs are to be diagnosed together first


@dataclass(frozen=True, eq=False)
class NextExperiment:
    """What is expected of every setting that a lab allows.

    Attributes:
      expected: the settings, the most telling first.
      about: the parameter that was asked about; None: which hypothesis holds.
      hypotheses: name to probability, before the experiment.
      document: next.json.
    """

    expected: tuple[Expected, ...]
    about: str | None
    hypotheses: Mapping[str, float]
    document: Mapping[str, Any]

    @property
    def best(self) -> Mapping[str, Any]:
        """The setting with the largest gain."""
        return self.expected[0].setting

    @property
    def sentence(self) -> str:
        """What to do next, in one sentence."""
        return str(self.document["sentence"])

    @property
    def table(self) -> "pd.DataFrame":
        """One row per setting, the most telling first.

        The settings by their names, `gain_nats`, `named` and `hit` (probabilities), `lead_nats`.
        """
        return pd.DataFrame(self.document["settings"])

    def plot(self) -> "go.Figure":
        """The gain against every setting."""
        return to_plotly(gains_chart(self.document))

    def report(self, path: str | Path) -> Path:
        """Writes the page: one HTML file, no network needed."""
        return write_next_page(Path(path), self.document)

    def save(self, folder: str | Path) -> Path:
        """Writes next.json and next.html into `folder`."""
        folder = Path(folder)
        write_json(folder / "next.json", self.document)
        self.report(folder / "next.html")
        return folder

    def __repr__(self) -> str:
        return f"<NextExperiment: {self.sentence}>"

    def _repr_html_(self) -> str:
        return f"<p>{escape(self.sentence)}</p>{self.table.head(10)._repr_html_()}"  # pyright: ignore


@in_float64
def next_experiment(
    found: Found | Sequence[Found],
    *,
    can: str | Mapping[str, Any] | None = None,
    about: str | None = None,
    seed: int = 0,
    on_progress: progress.OnProgress | None = None,
    cancel: progress.CancelFlag | None = None,
) -> NextExperiment:
    """Says for every setting that a lab allows how much an experiment there is expected to tell.

    The gain is the mutual information, in nats, between the data of the experiment and which
    hypothesis holds, or a parameter; by rollouts of draws of every hypothesis' posterior
    (docs/explanation/next_experiment.md).

    Args:
      found: a diagnosis or the folder of one. Of other runs, or several, the clips are diagnosed
        together first.
      can: what the lab allows, such as height=0.1:0.5,angle=10:30,fps=30|60|240,swap (lengths in
        m, angles in degrees, masses in kg); known: height, release, angle, fps, place2, swap,
        mass1, mass2. None: other heights, and angles, near those of the first clip.
      about: a parameter, such as k2 or mass_ratio. None: which hypothesis holds.
      seed: of all random numbers; the same seed gives the same result.
      on_progress: called with the stage, the share done (0 to 1) and None.
      cancel: a flag with `is_set`, such as `threading.Event`.

    Raises:
      InputError: a run, a setting or the parameter is wrong.
      Cancelled: `cancel` was set.

    Examples:
      >>> import galileo_jax as gx
      >>> made = gx.simulate("faint.csv", seed=11, effects={"air_drag": {}}, strength=0.1,
      ...     track_only=True, track_noise=0.0004)
      >>> ahead = gx.next_experiment(gx.diagnose("faint.csv"), can="height=0.1:0.6")
      >>> ahead.table.columns.tolist()
      ['height', 'gain_nats', 'named', 'lead_nats', 'hit']
    """
    began = time.perf_counter()
    parsed = None if can is None else parse_can(can)
    if parsed is not None:
        check_can(parsed)
    with progress.scope(on_progress, cancel):
        clip, trials, beliefs, sources = _loaded(found)
        allowed = parsed or parse_can(default_can(clip, trials))
        settings = grid(allowed, seed)
        with progress.part(DIAGNOSED, 1.0):
            rows = best_first(expect(clip, trials, beliefs, settings, about, seed))
        progress.report("rehearsed", 1.0)
    document = {
        "clips": sources,
        "can": {name: kind.document for name, kind in allowed.items()},
        "about": about,
        "hypotheses": beliefs.by_name,
        "sentence": sentence_of(rows[0], about),
        "settings": [
            {**one.setting, **{key: getattr(one, key) for key in NUMBERS}} for one in rows
        ],
        "timings_s": {"next": round(time.perf_counter() - began, 3)},
        "version": __version__,
        "seed": seed,
    }
    return NextExperiment(rows, about, beliefs.by_name, document)


def _loaded(found: Found | Sequence[Found]) -> tuple[Clip, JointProblem, Beliefs, list[str]]:
    """The first clip, the joint problem, the hypotheses and the clips' names."""
    given = as_list(found, "no run given; at least one expected")
    one = given[0]
    if len(given) > 1 or not (isinstance(one, Diagnosis) or _diagnosis_folder(one)):
        with progress.part(0.0, DIAGNOSED):
            one = diagnose([clip for run in given for clip in _tracks(run)], add="none")
    if not isinstance(one, Diagnosis):
        return _read(_diagnosis_folder(one) or Path(one))
    sources = [str(source) for source in one.document["clips"]]
    return one.measurements[0].clip, one.problem, beliefs_of(one.found), sources


def _diagnosis_folder(folder: str | Path) -> Path | None:
    places = (Path(folder), Path(folder) / "diagnosis")
    return next((place for place in places if (place / DOCUMENT).is_file()), None)


def _read(folder: Path) -> tuple[Clip, JointProblem, Beliefs, list[str]]:
    try:
        document = json.loads((folder / DOCUMENT).read_text(encoding="utf-8"))
        files, sources = document.get("effects_from", []), [str(one) for one in document["clips"]]
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise InputError(f"{folder / DOCUMENT}: not a diagnosis ({error})") from error
    for path in files:
        load_file(path)
    library = effect_names()  # the last model may have a law, which the hypotheses do not know
    measured = load_run(folder / "model").measurements
    clips, seen = [one.clip for one in measured], [one.observation for one in measured]
    trials = with_library(clips, seen, str(document.get("engine", "auto")), library)
    return clips[0], trials, read_beliefs(folder / FILE, trials.names), sources


def _tracks(run: Found) -> list[Track]:
    if isinstance(run, Diagnosis):
        return tracks_of(run.measurements)
    place = _diagnosis_folder(run)
    return tracks_of(load_run(place / "model" if place else run).measurements)
