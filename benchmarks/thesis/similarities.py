"""The three similarities, compared by Gaussians fitted to what 50 chains say.

Each of 50 chains gives its best sample; a Gaussian is fitted to the 50 values of every parameter.
Its error is |mean - truth|, its width how far chains disagree. (Our reading: the thesis compares
"the error of a Gaussian fit of 50 chains".) Means over --num truths; L1 and L2 of the best of all
chains. `python benchmarks/thesis/similarities.py`
"""

from collections.abc import Sequence

import numpy as np
import setting

from galileo_jax.commands import command
from galileo_jax.inference.posterior import Posterior
from galileo_jax.thesis.task import NAMES

NUM_CHAINS = 50
SIMILARITIES = ("thesis_gaussian", "earth_mover", "root_mean")


def main(argv: Sequence[str]) -> int | None:
    call = setting.start(argv, __doc__, num=6)
    cases = setting.experiments(call.seed, call.num, call.frames)
    setting.row("similarity, of", (*setting.QUANTITIES, "L1", "L2"))
    found, drawn = {}, {}
    for similarity in SIMILARITIES:
        errors, widths, distances = [], [], []
        for number, case in enumerate(cases):
            posterior = setting.chains(case, number, similarity=similarity, count=NUM_CHAINS)
            each = best_of_each(posterior)
            values = setting.quantities(each)
            errors.append(np.abs(values.mean(0) - setting.quantities(case.theta)))
            widths.append(values.std(0, ddof=1))
            best = posterior.flat()[np.argmax(posterior.log_density)]
            distances.append(setting.distances(best, case))
            drawn.setdefault(similarity, each)
        error, width = np.mean(errors, axis=0), np.mean(widths, axis=0)
        l1, l2 = np.mean(distances, axis=0)
        setting.row(f"{similarity} error", [*error, l1, l2])
        setting.row(f"{similarity} sd", list(width))
        found[similarity] = {"error": error, "sd": width, "l1": l1, "l2": l2}
    with setting.figure(call, "similarities", columns=4, rows=len(SIMILARITIES)) as axes:
        for i, similarity in enumerate(SIMILARITIES):
            for j, name in enumerate(NAMES):
                draw_gaussian(axes[i, j], drawn[similarity][:, j], cases[0].theta[j])
                axes[i, j].set(title=f"{similarity}: {name}", yticks=[])
    setting.finish(call, "similarities", found)
    return None


def best_of_each(posterior: Posterior) -> np.ndarray:
    """The best sample of every chain, `[chain, 4]`."""
    best = posterior.log_density.argmax(axis=1)
    return posterior.draws[np.arange(len(best)), best]


def draw_gaussian(axes, values: np.ndarray, truth: float) -> None:
    """A histogram, the Gaussian fitted to it, and the truth."""
    mean, sd = values.mean(), values.std(ddof=1)
    axes.hist(values, bins=15, density=True, alpha=0.4)
    grid = np.linspace(values.min() - sd, values.max() + sd, 200)
    axes.plot(grid, np.exp(-0.5 * ((grid - mean) / sd) ** 2) / (sd * np.sqrt(2 * np.pi)))
    axes.axvline(truth, color="black", linewidth=0.8)


if __name__ == "__main__":
    raise SystemExit(command.run(main))
