"""Levenberg-Marquardt from many points at once: optimistix's steps, rollouts in batches.

optimistix's own loop would compile the rollout, and with MuJoCo's engines it cannot. So its parts
(`kernels.propose`) decide where to look next, and what they need to know of that place (residuals
and their slopes) comes from one batch of rollouts for all points. A point that has settled leaves
the batch.

Straight ahead such a step leaves a valley that is narrow and bends, so that it would crawl there.
Where motion is smooth, a step follows the bend (geodesic acceleration): one rollout a little way
along it tells the residuals' second derivative r'' in its direction, and it ends

    a = -1/2 (J^T J + 1 + damping)^-1 J^T r''

beside. Forty-four steps along a valley (friction and wheels) become five.

Where much is left that the model cannot explain, J^T J + 1 is not the curvature of the cost: what
it lacks, S = sum_i r_i r_i'', is learned from how slopes change from step to step (`secants`); of
few points only: of many most are still on their way, and far steps tell little of S.

Source: Levenberg (1944), Marquardt (1963, 10.1137/0111030); optimistix, arXiv 2402.09983; M. K.
Transtrum, J. P. Sethna, Improvements to the Levenberg-Marquardt algorithm, arXiv 1201.5885; J. E.
Dennis, D. M. Gay, R. E. Welsch, An adaptive nonlinear least-squares algorithm, ACM TOMS 7 (1981)
348, 10.1145/355958.355965.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from galileo_jax.inference.fits.kernels import Quadratic, propose
from galileo_jax.inference.fits.residuals import (
    POINTS,
    Batch,
    Motions,
    Residuals,
    Sides,
    Slopes,
    cost,
    quadratic,
)
from galileo_jax.inference.joint_problem import NOISE_SD
from galileo_jax.numerics.normal_matrix import inverse
from galileo_jax.runtime.batching import MOTIONS, in_chunks, one_at_a_time, rounded_up
from galileo_jax.similarity.noise_scale import fitted_noise_scale

# Of a parameter's coarse step. The rigid engine rounds below its own; MuJoCo's contacts are rough
# below theirs; above the largest a step may leave a plateau (nothing moves) over its edge, and the
# plateau would look steep.
SMALLEST_STEP, SMALLEST_ROUGH_STEP, LARGEST_STEP = 1e-3, 0.2, 4.0
PARAMETERS = 16  # numbers of them are rounded up to multiples, where a step is proposed
FEW = 4  # proposals of which all slopes are taken, and from which the cost's curvature is learned
CATCHES_UP = 0.1  # what the next step must promise of what one is behind
SAME_VALLEY_NATS = 1.0  # by which points differ that are of one valley
BEHIND_IN_SEARCH = 20.0  # starts of one hypothesis, in nats of the search's coarse noise
MOST_VALLEYS = 4  # that are polished

# Both as in the paper: of a step, where its bend is looked for; of twice a bend in lengths of its
# step, where that is no longer a small part of what is to come.
AHEAD, MOST_BENT = 0.1, 0.75

# Of rounds with fitted noise scales.
MAX_ROUNDS = 6
DRIFT = 0.1  # of a noise scale, in a round, while valleys are compared
SHARE_PROMISED = 0.2  # of what counts as settled: a round ends where a step promises less
BEHIND = 100.0  # nats: a fit so far behind another, and not catching up, is left where it is


class GiveUp(NamedTuple):
    """Which points are not worth following."""

    owner: np.ndarray  # `[point]`, whose each is; those of one owner are rivals
    behind: float  # nats behind the best rival, if the next step promises little of it
    price: Any = 0.0  # `[point]`, what belongs to the cost beside chi2 / 2 and the prior's part
    behind_all: float = np.inf  # the same behind the best point of all owners
    lowest: float = np.inf  # total that somebody beside these points has come to

    def __call__(self, cost: np.ndarray, promised: np.ndarray) -> np.ndarray:
        """Which, `[point]`, by their costs and what the next steps promise, `[point]`, nats."""
        total = cost + self.price
        lowest = np.full(self.owner.max() + 1, np.inf)
        np.minimum.at(lowest, self.owner, total)
        behind, behind_all = total - lowest[self.owner], total - min(lowest.min(), self.lowest)
        return ((behind > self.behind) & (promised < CATCHES_UP * behind)) | (
            (behind_all > self.behind_all) & (promised < CATCHES_UP * behind_all)
        )


class Descended(NamedTuple):
    """Where points arrived."""

    best: Quadratic  # the points and their costs
    first_cost: np.ndarray  # `[point]`, where they began
    widths: np.ndarray  # `[point, model parameter]`, half a conditional sd, see `Descent.half_sd`
    is_settled: np.ndarray  # `[point]`; False where steps ran out or it was given up
    num_steps: int  # how many there were
    # `[point]`, which point of its owner each is in the same valley as, and behind; its own index
    # where none
    joined: np.ndarray


def in_valley(best: Quadratic, first: int, others: np.ndarray) -> np.ndarray:
    """Which of `others` `[point]` are in a point's valley; nearness is measured by its slopes."""
    step = best.z[others] - best.z[first]
    far = 0.5 * np.einsum("pi,ij,pj->p", step, best.normal[first], step)
    return np.maximum(far, best.cost[others] - best.cost[first]) < SAME_VALLEY_NATS


def _proposals(
    region: np.ndarray,
    is_first: np.ndarray,
    here: Quadratic,
    there: Quadratic,
    before: np.ndarray,
    now: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """As `propose`, which is compiled for few numbers of parameters: those added stay at 0."""
    size = here.z.shape[1]
    more = rounded_up(size, PARAMETERS) - size
    before, now = (np.pad(beside, [(0, 0), (0, more), (0, more)]) for beside in (before, now))

    def wider(one: Quadratic) -> Quadratic:
        z, gradient = (np.pad(rows, [(0, 0), (0, more)]) for rows in (one.z, one.gradient))
        normal = np.pad(one.normal, [(0, 0), (0, more), (0, more)])
        normal[:, range(size, size + more), range(size, size + more)] = 1.0
        return Quadratic(z, one.cost, gradient, normal)

    alone = one_at_a_time(propose)
    region, accepts, step, promised = in_chunks(
        POINTS, alone, region, is_first, wider(here), wider(there), before, now
    )
    return region, accepts, step[:, :size], promised


def secants(
    second: Float[np.ndarray, "point parameter parameter"],
    step: Float[np.ndarray, "point parameter"],
    turned: Float[np.ndarray, "point parameter"],
    change: Float[np.ndarray, "point parameter"],
) -> Float[np.ndarray, "point parameter parameter"]:
    """S = sum_i r_i r_i'' after a step: the least change of it with S step = turned.

        S + (d y^T + y d^T) / (y^T step) - (d^T step) y y^T / (y^T step)^2,  d = turned - S step

    As it was where the cost does not bend upwards along the step (y^T step <= 0).

    `second`: before; made smaller where residuals became so. `step`: of the parameters, z.
    `turned`: (J_there - J_here)^T r_there. `change`: of the cost's gradient, y.
    """

    def along(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        return np.einsum("pi,pi->p", one, other)

    bent, expected = along(step, turned), np.einsum("pi,pij,pj->p", step, second, step)
    is_too_large = np.abs(expected) > np.abs(bent)
    size = np.divide(bent, expected, out=np.ones(len(step)), where=is_too_large)
    sized = np.abs(size)[:, None, None] * second
    up = along(change, step)
    y = np.divide(change, up[:, None], out=np.zeros_like(change), where=up[:, None] > 0)
    off = turned - np.einsum("pij,pj->pi", sized, step)
    both = np.einsum("pi,pj->pij", off, y)
    twice = along(off, step)[:, None, None] * np.einsum("pi,pj->pij", y, y)
    found = sized + both + np.swapaxes(both, 1, 2) - twice
    is_known = (up > 0) & np.isfinite(found).all(axis=(1, 2))
    return np.where(is_known[:, None, None], found, second)


def _turned(here: Slopes, there: Slopes) -> Float[np.ndarray, "point parameter"]:
    """(J_there - J_here)^T r_there; `there` may have fewer columns."""
    width, turned = there.index.shape[1], np.zeros(there.index.shape)
    for before, after, white in zip(here.jacobian, there.jacobian, there.white, strict=True):
        more = np.swapaxes(after - before[:, :, :width], 1, 2)
        turned += (more @ white[..., None])[..., 0]
    return there.among_all(turned)


def _tells_better(
    own: Quadratic, new: Quadratic, bends: np.ndarray, second: np.ndarray
) -> np.ndarray:
    """Whether what a step brought would have been told better with S beside J^T J, `[point]`."""
    step = new.z - bends - own.z
    straight = own.cost + np.sum(own.gradient * step, axis=1)
    normal, beside = (np.einsum("pi,pij,pj->p", step, m, step) / 2 for m in (own.normal, second))
    off = new.cost - straight - normal
    return np.abs(off - beside) < np.abs(off)


def _is_convex(curvature: Float[np.ndarray, "point parameter parameter"]) -> np.ndarray:
    """Of which points the cost bends upwards in every direction, `[point]`."""
    known, is_finite = _finite(curvature)
    return is_finite & (np.linalg.eigvalsh(known)[:, 0] > 0)


def _finite(
    matrices: Float[np.ndarray, "point parameter parameter"],
) -> tuple[np.ndarray, Bool[np.ndarray, " point"]]:
    """Matrices with unit matrices in the place of those that are not finite; and which are."""
    is_finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    return np.where(is_finite[:, None, None], matrices, np.eye(matrices.shape[1])), is_finite


def _bends(
    residuals: Residuals,
    points: Batch,
    slopes: Slopes,
    steps: Float[np.ndarray, "point parameter"],
    damped: Float[np.ndarray, "point parameter parameter"],
) -> Float[np.ndarray, "point parameter"]:
    """How far beside the ends of steps the valley is that they follow, z; 0 where that is much.

    `slopes`: where the points are. `damped`: J^T J + 1 + damping, of each step.
    """
    ahead = residuals.whites(points._replace(z=points.z + AHEAD * steps))
    own = np.take_along_axis(np.pad(steps, [(0, 0), (0, 1)]), slopes.index, axis=1)[..., None]
    turned = np.zeros(own.shape)
    for jacobian, here, there in zip(slopes.jacobian, slopes.white, ahead, strict=True):
        half = ((there - here) / AHEAD - (jacobian @ own)[..., 0]) / AHEAD  # of r''
        turned += np.swapaxes(jacobian, 1, 2) @ half[..., None]
    turned = slopes.among_all(turned)
    try:
        bends = -np.linalg.solve(damped, turned)[..., 0]
    except np.linalg.LinAlgError:  # slopes so steep that rounding has left nothing of the prior
        bends = -(inverse(_finite(damped)[0]) @ turned)[..., 0] * points.free
    is_much = 2 * np.linalg.norm(bends, axis=1) > MOST_BENT * np.linalg.norm(steps, axis=1)
    return np.where(is_much[:, None], 0.0, bends)


def join(best: Quadratic, owner: np.ndarray, joined: np.ndarray) -> None:
    """Marks in `joined` the points that have come to the valley of a better one of their owner.

    Many starts of one hypothesis end in one valley: one of them may walk it for all.
    """
    left = np.flatnonzero(joined == np.arange(len(joined)))
    for own in np.flatnonzero(np.bincount(owner[left]) > 1):
        rivals = left[owner[left] == own]
        rivals = rivals[np.argsort(best.cost[rivals], kind="stable")]
        while rivals.size > 1:
            first, rivals = rivals[0], rivals[1:]
            is_same = in_valley(best, first, rivals)
            step = best.z[rivals] - best.z[first]
            # By the slopes of either: one of them may be where little shows.
            is_same &= (
                np.einsum("pi,pij,pj->p", step, best.normal[rivals], step) < 2 * SAME_VALLEY_NATS
            )
            joined[rivals[is_same]] = first
            rivals = rivals[~is_same]


def ends_of(joined: np.ndarray) -> np.ndarray:
    """Where each point that joined another is in the end, `[point]`: an index."""
    ends = joined
    while (ends != (further := joined[ends])).any():
        ends = further
    return ends


def valleys(ends: Quadratic, rows: np.ndarray) -> list[int]:
    """The best point of every valley among `rows` that is not far behind, best first."""
    left, found = rows[np.argsort(ends.cost[rows], kind="stable")], []
    left = left[ends.cost[left] < ends.cost[left[0]] + BEHIND_IN_SEARCH]
    while left.size and len(found) < MOST_VALLEYS:
        found.append(int(left[0]))
        left = left[~in_valley(ends, found[-1], left)]
    return found


@dataclass(frozen=True)
class Descent:
    """Levenberg-Marquardt on the residuals of trials."""

    residuals: Residuals  # of the trials
    coarse_steps: np.ndarray  # `[model parameter]`, as `JointProblem.coarse_steps`
    # whether motion is smooth at every scale: slopes are then taken over small steps
    is_smooth: bool
    # of differences; those ahead cost half and lead to within some hundredths of a standard
    # deviation of the mode
    sides: Sides

    def __call__(
        self, points: Batch, enough: float, max_steps: int, give_up: GiveUp | None = None
    ) -> Descended:
        """Descends until a step promises to lower the cost by less than `enough` nats."""
        count, size = points.z.shape
        eye = np.tile(np.eye(size), (count, 1, 1))
        best = Quadratic(points.z.copy(), np.full(count, np.inf), np.zeros((count, size)), eye)
        proposed, widths = points.z.copy(), np.tile(self.coarse_steps, (count, 1))
        region, promised, first_cost = np.ones(count), np.full(count, np.inf), best.cost
        active, num_steps, joined = np.arange(count), 0, np.arange(count)
        slopes, bends = self.residuals.no_slopes(points.free), np.zeros((count, size))
        second, used = np.zeros((2, count, size, size))  # S, and what of it steps are made with
        while active.size and num_steps < max_steps:
            there = points.take(active)._replace(z=proposed[active])
            own = Quadratic(*(leaf[active] for leaf in best))
            new, better, found = self._quadratic(there, own, widths, active)
            is_first = np.full(len(active), num_steps == 0)
            beside = second[active]
            if self.is_smooth and num_steps and len(active) <= FEW:
                is_better = _tells_better(own, new, bends[active], beside)
                rows = active[better]
                step, change = new.z[better] - own.z[better], (new.gradient - own.gradient)[better]
                turned = _turned(slopes.take(rows), found)
                second[rows] = secants(beside[better], step, turned, change)
                beside = second[active]
                is_better &= _is_convex(own.normal + beside) & _is_convex(new.normal + beside)
                beside = np.where(is_better[:, None, None], beside, 0.0)
            straight = new._replace(z=new.z - bends[active])
            region[active], accepts, steps, promised[active] = _proposals(
                region[active], is_first, own, straight, used[active], beside
            )
            used[active] = beside
            for leaf, value in zip(best, new, strict=True):
                leaf[active[accepts]] = value[accepts]
            slopes.put(active[accepts], found, np.flatnonzero(accepts[better]))
            proposed[active] = best.z[active] + steps
            if num_steps == 0:
                first_cost = best.cost.copy()
            num_steps += 1
            goes_on = ~(promised < enough)
            if give_up is not None:
                goes_on &= ~give_up(best.cost, promised)
                join(best, give_up.owner, joined)
                goes_on &= joined == np.arange(count)
            active = active[goes_on[active]]
            if self.is_smooth and active.size:
                here, steps = points.take(active)._replace(z=best.z[active]), proposed - best.z
                damped = best.normal[active] + np.eye(size) / region[active, None, None]
                known = slopes.take(active)
                bends[active] = _bends(self.residuals, here, known, steps[active], damped)
                proposed[active] += bends[active]
        is_settled = promised < enough
        return Descended(best, first_cost, widths, is_settled, num_steps, joined)

    def _quadratic(
        self, there: Batch, own: Quadratic, widths: np.ndarray, active: np.ndarray
    ) -> tuple[Quadratic, np.ndarray, Slopes]:
        """The cost round proposals; of those that cost more than where they set off no slopes.

        A proposal in three is refused, and its slopes would be most of the work; of few proposals
        they are taken all the same, and tell `widths`. Returned are the cost; which proposals have
        slopes; and these.

        `there`: the proposals. `own`: where they set off. `widths`: `[point, model parameter]`, of
        all points; those of `active` are changed. `active`: `[proposal]`, which points they are of.
        """
        motions = self.residuals.motions(there)
        total = cost(self.residuals.whites_of(there, motions), there.z)
        is_few = len(there.z) <= FEW and there.free.sum(axis=1).max() < MOTIONS[0]
        better = np.arange(len(total)) if is_few else np.flatnonzero(total < own.cost)
        new = Quadratic(there.z, total, np.zeros_like(own.gradient), own.normal.copy())
        if not better.size:
            return new, better, self.residuals.no_slopes(there.free[better])
        some = [tuple(values[better] for values in own) for own in motions]
        slopes = self.slopes(there.take(better), widths[active[better]], some)
        widths[active[better]] = self.half_sd(slopes)
        found = quadratic(slopes, there.z[better])
        new.gradient[better], new.normal[better] = found.gradient, found.normal
        return new, better, slopes

    def slopes(self, points: Batch, widths: np.ndarray, motions: Motions | None = None) -> Slopes:
        """Over small steps where motion is smooth, else over `widths` `[point, parameter]`."""
        if self.is_smooth:
            widths = np.tile(SMALLEST_STEP * self.coarse_steps, (len(points.z), 1))
        return self.residuals.slopes(points, widths, self.sides, motions)

    def half_sd(self, slopes: Slopes) -> np.ndarray:
        """Difference steps in z: half a conditional sd, within what slopes are good for.

        Conditional, the others held: along a ridge (all masses by the same factor) the
        marginal sd is large, and differences over it would bend the ridge.
        """
        squares = sum(slopes.among_all(np.sum(j**2, axis=1)) for j in slopes.jacobian)
        smallest = SMALLEST_STEP if self.is_smooth else SMALLEST_ROUGH_STEP
        half = 0.5 / np.sqrt(1 + squares)
        return np.clip(half, smallest * self.coarse_steps, LARGEST_STEP * self.coarse_steps)


class Polished(NamedTuple):
    """Modes."""

    points: Batch  # with fitted noise scales
    # of the models' parameters: steps of differences at the posterior's scale, in z
    widths: Float[np.ndarray, "point parameter"]
    is_settled: Bool[np.ndarray, " point"]  # False where steps ran out or it was given up
    lowest: float  # the least cost with what noise scales cost, nats
    # which of the points given: those that came to the valley of a better one of their owner are
    # left out
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
    sets off anew: settled is who gains less than `settled` nats in all of a round, of at most
    `max_steps`, in which no noise scale drifts by more than `drift`.

    `points`: where the search ended. `owner`: `[point]`, whose each is. `lowest`: as in what was
    returned, of other points polished before.
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
