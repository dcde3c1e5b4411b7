"""One clip of the trials, in shapes that many clips share."""

from dataclasses import dataclass

import numpy as np

from galileo_jax.inference.fits.kernels import ClipArrays
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.model.parameters import PriorTable
from galileo_jax.runtime.batching import FRAMES, SPARE_MODES, rounded_up
from galileo_jax.runtime.device_cache import OnDevice
from galileo_jax.similarity.gaussian_likelihood import Whitening

# Half a difference that gives a derivative of order 1 to some 1e-10, for rounding as for curvature.
RATE_Z = 1e-5


@dataclass(frozen=True)
class FittedClip:
    """One clip of the trials, ready for compiled code."""

    problem: Problem  # of the clip
    priors: PriorTable  # of its parameters
    absent: np.ndarray  # `[own parameter]`, values in their units where pinned
    column: np.ndarray  # `[own parameter]`, where these stand among those of all clips
    host: ClipArrays  # all that its programs need, padded
    on_device: OnDevice[ClipArrays]  # the same

    @classmethod
    def of(cls, trials: JointProblem, index: int) -> "FittedClip":
        """The clip of that index."""
        problem = trials.problems[index]
        host = ClipArrays(*_padded(problem), problem.model.scene.surroundings)
        return cls(
            problem,
            PriorTable.of(problem.parameters),
            np.array([p.absent for p in problem.parameters]),
            trials.columns[index],
            host,
            OnDevice(host),
        )

    @property
    def arrays(self) -> ClipArrays:
        """All that its programs need."""
        return self.on_device()

    @property
    def whitening(self) -> Whitening:
        """Its covariance, padded."""
        return self.host.whitening

    def theta(self, z: np.ndarray, free: np.ndarray) -> np.ndarray:
        """`[point, joint parameter]` to this clip's parameters in their units."""
        own = self.priors.in_units(z[:, self.column])
        return np.where(free[:, self.column], own, self.absent)

    def rates(self, z: np.ndarray) -> np.ndarray:
        """How fast this clip's parameters change with `z` `[point, joint parameter]`."""
        ahead, back = (self.priors.in_units(z[:, self.column] + s) for s in (RATE_Z, -RATE_Z))
        with np.errstate(invalid="ignore"):  # so far out that both are infinite
            return (ahead - back) / (2 * RATE_Z)

    def search_noise(self, search_sd_m: float) -> float:
        """The noise scale at which the tracker's median error is that."""
        observation = self.problem.observation
        variance = np.trace(observation.covariance_m2, axis1=1, axis2=2)[observation.mask] / 2
        if not variance.size:
            return 1.0
        return max(1.0, search_sd_m / float(np.sqrt(np.median(variance))))

    def unpadded(self, jacobian: np.ndarray) -> np.ndarray:
        """Rows of real frames only."""
        frames = len(self.problem.observation.times_s)
        rows = jacobian.reshape(*self.whitening.observed_m.shape, -1)[:, :, :frames]
        return rows.reshape(-1, jacobian.shape[1])


def _padded(problem: Problem) -> tuple[np.ndarray, Whitening]:
    """Times and whitening with frames that count for nothing and modes without gain."""
    times, data = problem.observation.times_s, problem.data
    frames = rounded_up(len(times), FRAMES) - len(times)
    # A camera's wobble has as many modes as frames; all else has fewer than those to spare.
    most = len(data.observed_m) * (len(times) + frames) + SPARE_MODES
    is_few = problem.noise != "camera" and len(data.gain) <= SPARE_MODES
    modes = SPARE_MODES if is_few else max(rounded_up(len(data.gain), FRAMES), most)
    modes -= len(data.gain)
    return np.pad(times, (0, frames), mode="edge"), Whitening(
        np.pad(data.observed_m, [(0, 0), (0, 0), (0, frames)]),
        np.pad(data.inverse_root, [(0, 0), (0, 0), (0, 0), (0, frames)]),
        np.pad(data.basis, [(0, modes), (0, 0), (0, 0), (0, frames)]),
        np.pad(data.gain, (0, modes)),
        data.num_values,
    )
