"""`predict`: the motion of a fitted scene during its clip and beyond."""

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.api.fit_result import Fit, load_run
from galileo_jax.prediction.extrapolate import Motions, answers, extrapolate
from galileo_jax.report.draw import to_plotly, to_svg
from galileo_jax.report.prediction import prediction_chart, prediction_lines, write_prediction
from galileo_jax.report.side_view import write_first_and_last
from galileo_jax.results.run import Run
from galileo_jax.runtime import progress
from galileo_jax.runtime.atomic_write import write_json, write_text, writing_into
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.lazy import go, pd
from galileo_jax.runtime.precision import in_float64

MOST_DRAWS = 10_000
LONGEST_S = 60.0


@dataclass(frozen=True, eq=False)
class Prediction:
    """Where the objects go, drawn from the posterior.

    Attributes:
      run: the fit that was continued.
      motions: `times_s [time]`, `position_m`, `velocity_m_s [draw, object, 2, time]`.
      document: prediction.json: will it slide, how far, where does it stop, does it hit.
    """

    run: Run
    motions: Motions
    document: Mapping[str, Any]

    @property
    def objects(self) -> Mapping[str, Mapping[str, Any]]:
        """By object: probabilities, and `mean, sd, q025, q975` of distances, times and speeds."""
        return self.document["objects"]

    @property
    def hit(self) -> Mapping[str, Any] | None:
        """Whether and when object 1 hits object 2; None where there is one object."""
        return self.document["hit"]

    @property
    def sentences(self) -> tuple[str, ...]:
        """The answers in words."""
        return tuple(prediction_lines(self.run, self.document))

    def to_dataframe(self) -> "pd.DataFrame":
        """One row per object and time: median and 95 % interval of the centre, m.

        `object, time_s, x_m, x_q025_m, x_q975_m, y_m, y_q025_m, y_q975_m, is_beyond_clip`.
        """
        times = self.motions.times_s
        low, middle, high = np.quantile(self.motions.position_m, [0.025, 0.5, 0.975], axis=0)
        parts = []
        for k, name in enumerate(self.run.problem.observation.names):
            columns: dict[str, Any] = {"object": name, "time_s": times}
            for i, axis in enumerate("xy"):
                columns[f"{axis}_m"] = middle[k, i]
                columns[f"{axis}_q025_m"], columns[f"{axis}_q975_m"] = low[k, i], high[k, i]
            columns["is_beyond_clip"] = times > self.document["clip_end_s"]
            parts.append(pd.DataFrame(columns))
        return pd.concat(parts, ignore_index=True)

    @in_float64
    def plot(self) -> "go.Figure":
        """Places over time with 95 % bands, measured points, and where the clip ends."""
        return to_plotly(prediction_chart(self.run, self.motions))

    @in_float64
    def save(self, folder: str | Path) -> tuple[Path, ...]:
        """Writes prediction.json, prediction.svg, first_and_last.png and the report's part.

        Raises:
          InputError: the folder cannot be written.
        """
        out = Path(folder)
        chart = prediction_chart(self.run, self.motions)
        picture = out / "first_and_last.png"
        with writing_into(out):
            write_first_and_last(self.run, self.motions, picture)
            write_text(out / "prediction.svg", to_svg(chart))
            page = write_prediction(out, self.run, self.document, chart)
            write_json(out / "prediction.json", self.document)
        return out / "prediction.json", out / "prediction.svg", picture, page

    def __repr__(self) -> str:
        return f"<Prediction {self.run.problem.name}: {' '.join(self.sentences)}>"

    def _repr_html_(self) -> str:
        return "".join(f"<p>{escape(sentence)}</p>" for sentence in self.sentences)


@in_float64
def predict(
    fit: Fit | str | Path,
    *,
    seconds: float,
    draws: int = 200,
    seed: int = 0,
    on_progress: progress.OnProgress | None = None,
    cancel: progress.CancelFlag | None = None,
) -> Prediction:
    """Continues a fitted scene beyond its clip, by rollouts of the posterior's draws.

    Args:
      fit: of one clip, or the folder of a run.
      seconds: how long beyond the clip's end, s, in (0, 60].
      draws: number of posterior draws that are simulated, 2 to 10000.
      seed: of the choice of draws.
      on_progress: called with the stage, the share done (0 to 1) and None.
      cancel: a flag with `is_set`, such as `threading.Event`.

    Raises:
      InputError: no run there, a fit of several clips, or a time or number out of range.
      Cancelled: `cancel` was set.

    Examples:
      >>> import galileo_jax as gx
      >>> made = gx.simulate("slide.csv", scenario="incline", seed=1, track_only=True)
      >>> ahead = gx.predict(gx.fit("slide.csv"), seconds=0.5)
      >>> 0 <= ahead.objects["object1"]["stops_probability"] <= 1
      True
    """
    if not 0 < seconds <= LONGEST_S:
        raise InputError(f"--seconds: {seconds!r} is not a time; seconds in (0, {LONGEST_S:g}]")
    if not 2 <= draws <= MOST_DRAWS:
        raise InputError(f"--draws: {draws!r} is not a whole number, 2 to {MOST_DRAWS}")
    with progress.scope(on_progress, cancel):
        fit = fit if isinstance(fit, Fit) else load_run(fit)
        if len(fit.measurements) > 1:
            first = (fit.folder or Path(".")) / fit.names[0]
            raise InputError(
                f"{fit.folder or ', '.join(fit.names)}: a fit of several clips; predict one of "
                f"them, such as {first}"
            )
        (run,) = fit.runs(fit.folder or Path("."))
        progress.report("rolling out", 0.1)
        motions = extrapolate(run, seconds, draws, seed)
        found = {"run": str(run.folder), **answers(run, motions, seconds, seed)}
        made = Prediction(run, motions, found)
        progress.report("rolled out", 1.0, made)
        return made
