"""Have the chains converged, and how many independent draws are they worth? Through ArviZ."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType

import numpy as np


@dataclass(frozen=True)
class Convergence:
    """Of one quantity.

    Source: Vehtari, Gelman, Simpson, Carpenter, Buerkner, Rank-normalization, folding, and
    localization: an improved R-hat, Bayesian Analysis 16 (2021), 10.1214/20-BA1221.
    """

    # rank-normalized split R-hat; 1 is agreement, above 1.01 the chains disagree; NaN where nothing
    # moved
    rhat: float
    ess_bulk: float  # effective draws for the mean
    ess_tail: float  # effective draws for the 5 % and 95 % quantiles


def arviz() -> ModuleType:
    """ArviZ, imported when first used (two seconds) and without its notice of migration."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import arviz as module

    return module


def convergence(draws: np.ndarray) -> Convergence:
    """R-hat and effective sample sizes of `draws` `[chain, draw]`."""
    draws = np.asarray(draws, np.float64)
    if not _can_tell(draws):
        return Convergence(np.nan, np.nan, np.nan)
    az = arviz()
    return Convergence(
        rhat=float(az.rhat(draws)),
        ess_bulk=effective(draws),
        ess_tail=float(az.ess(draws, method="tail")),
    )


def effective(draws: np.ndarray) -> float:
    """The bulk effective sample size alone of `[chain, draw]`; NaN where nothing moved."""
    draws = np.asarray(draws, np.float64)
    return float(arviz().ess(draws, method="bulk")) if _can_tell(draws) else np.nan


def _can_tell(draws: np.ndarray) -> bool:
    return bool(np.ptp(draws) > 0 and np.all(np.isfinite(draws)) and draws.shape[1] >= 4)


def convergences(quantities: Mapping[str, np.ndarray]) -> dict[str, Convergence]:
    """`convergence` of each of the named quantities `[chain, draw]`."""
    return {name: convergence(draws) for name, draws in quantities.items()}
