"""A posterior's draws in four numbers, and how far each of these would be off by chance."""

import numpy as np
from jaxtyping import Float
from scipy.special import betaincinv, ndtr

from galileo_jax.inference.posterior import Posterior

ENDS = {"q025": 0.025, "q975": 0.975}


def summarise(draws: Float[np.ndarray, " draw"], worth: float | None = None) -> dict:
    """Mean, standard deviation, central 95 % interval, and their Monte Carlo errors (`mcse`).

    With n independent draws the errors are

        mean: sd / sqrt(n)       sd: sd sqrt((kurtosis - 1) / 4 n)
        a quantile at p: half the distance between those at the 16 % and 84 % points of
            Beta(n p + 1, n (1 - p) + 1)

    `draws`: all of the same weight. `worth`: n, how many independent draws they are worth; None: as
    many as there are.

    Source: A. Vehtari and others, Rank-normalization, folding, and localization: an improved
    R-hat, Bayesian Analysis 16 (2021), 667, section 4 (10.1214/20-BA1221).
    """
    n = max(min(len(draws) if worth is None else worth, len(draws)), 1.0)
    mean, sd = float(draws.mean()), float(draws.std(ddof=1))
    kurtosis = float(np.mean((draws - mean) ** 4)) / sd**4 if sd > 0 else 1.0
    one_sd = ndtr([-1.0, 1.0])
    around = [betaincinv(n * p + 1, n * (1 - p) + 1, one_sd) for p in ENDS.values()]
    cuts = np.quantile(draws, [*ENDS.values(), *np.concatenate(around)])
    ends = dict(zip(ENDS, cuts[:2].tolist(), strict=True))
    errors = dict(zip(ENDS, (np.diff(cuts[2:])[::2] / 2).tolist(), strict=True))
    return {
        "mean": mean,
        "sd": sd,
        **ends,
        "mcse": {
            "mean": sd / n**0.5,
            "sd": sd * max((kurtosis - 1) / (4 * n), 0.0) ** 0.5,
            **errors,
        },
    }


def summary_of(posterior: Posterior, values: Float[np.ndarray, " draw"]) -> dict:
    """`summarise` of a parameter or a function of the parameters, chain after chain."""
    return summarise(values, posterior.worth(values))


def entry_of(
    posterior: Posterior, values: Float[np.ndarray, " draw"], unit: str, identified: bool
) -> dict:
    """The same with its unit and whether the data tell it: an entry of result.json."""
    return {**summary_of(posterior, values), "unit": unit, "identified": identified}
