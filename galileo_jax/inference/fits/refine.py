"""From where a search ended to the mode: fitted noise scales, and proof that it has settled."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from galileo_jax.inference.fits.descent import CATCHES_UP, Descent, GiveUp
from galileo_jax.inference.fits.normal_matrix import inverse
from galileo_jax.inference.fits.residuals import Batch, Residuals
from galileo_jax.inference.joint_problem import NOISE_SD
from galileo_jax.similarity.noise_scale import fitted_noise_scale

MAX_ROUNDS = 6
DRIFT = 0.1  # of a noise scale, in a round, while valleys are compared
SHARE_PROMISED = 0.2  # of what counts as settled: a round ends where a step promises less
BEHIND = 100.0  # nats: a fit so far behind another, and not catching up, is left where it is


class Polished(NamedTuple):
    """Modes.

    Attributes:
      points: with fitted noise scales.
      widths: `[point, model parameter]`, steps of differences at the posterior's scale, in z.
      is_settled: `[point]`.
      lowest: the least cost with what noise scales cost, nats.
      rows: `[point]`, which of the points given: those that came to the valley of a better one of
        their owner are left out.
    """

    points: Batch
    widths: Float[np.ndarray, "point parameter"]
    is_settled: Bool[np.ndarray, " point"]
    lowest: float
    rows: Int[np.ndarray, " point"]


def polish(
    descent: Descent,
    points: Batch,
    owner: np.ndarray,
    settled: float,
    max_steps: int,
    lowest: float = np.inf,
    drift: float = DRIFT,
) -> Polished:
    """Descends again and again, each time with noise scales that suit the residuals.

    Each round begins with no damping to speak of, so that one that was stuck in a curved valley
    sets off anew: settled is who gains less than `settled` nats in all of a round.

    Args:
      descent: of the trials.
      points: where the search ended.
      owner: `[point]`, whose each is.
      settled: nats.
      max_steps: of one round.
      lowest: as in what was returned, of other points polished before.
      drift: of a noise scale, in a round: more has not settled.
    """
    z, noise = points.z.copy(), points.noise.copy()
    count, size = z.shape
    normal, widths = np.tile(np.eye(size), (count, 1, 1)), np.tile(descent.coarse_steps, (count, 1))
    is_settled, total = np.zeros(count, bool), np.full(count, np.inf)
    active, is_alone = np.arange(count), np.ones(count, bool)
    num_values = np.array([clip.whitening.num_values for clip in descent.residuals.clips])
    for _ in range(MAX_ROUNDS):
        here = Batch(z, points.free, noise).take(active)
        used = size - np.trace(inverse(normal[active]), axis1=1, axis2=2)
        scales = noise_scales(descent.residuals, here, used)
        drifts = np.abs(scales / noise[active] - 1).max(axis=1) > drift
        noise[active] = scales
        price = np.log(noise) @ num_values  # what the noise scales cost
        give_up = GiveUp(owner[active], BEHIND, price[active], BEHIND, lowest)
        found = descent(here._replace(noise=scales), SHARE_PROMISED * settled, max_steps, give_up)
        z[active], normal[active], widths[active] = found.best.z, found.best.normal, found.widths
        total[active] = found.best.cost + price[active]
        gains = found.first_cost - found.best.cost
        is_settled[active] = (gains < settled) & ~drifts & found.is_settled
        lowest = min(lowest, float(total.min()))
        behind = total[active] - lowest
        gives_up = (behind > BEHIND) & (gains < CATCHES_UP * behind)
        is_alone[active] = found.joined == np.arange(len(active))
        active = active[~is_settled[active] & ~gives_up & is_alone[active]]
        if not active.size:
            break
    rows = np.flatnonzero(is_alone)
    ends = Batch(z, points.free, noise).take(rows)
    return Polished(ends, widths[rows], is_settled[rows], lowest, rows)


def noise_scales(
    residuals: Residuals, points: Batch, used: Float[np.ndarray, " point"]
) -> Float[np.ndarray, "point clip"]:
    """The noise scales that residuals ask for, `[point, clip]`.

    `used`: `[point]`, how many numbers' worth of the data the parameters take up.
    """
    num_values = sum(float(clip.whitening.num_values) for clip in residuals.clips)
    scales = np.empty_like(points.noise)
    for c, (clip, white) in enumerate(zip(residuals.clips, residuals.whites(points), strict=True)):
        data = clip.whitening
        own = used * float(data.num_values) / num_values
        scales[:, c] = fitted_noise_scale(white, points.noise[:, c], own, NOISE_SD, data)
    return scales
