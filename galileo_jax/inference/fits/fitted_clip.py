"""One clip of the trials, in shapes that many clips share."""

from dataclasses import dataclass

import numpy as np

from galileo_jax.inference.fits.kernels import ClipArrays, Kind, Padded
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.model.parameters import PriorTable
from galileo_jax.runtime.batching import FRAMES, SPARE_MODES, rounded_up
from galileo_jax.runtime.device_cache import OnDevice
from galileo_jax.similarity.gaussian_likelihood import Whitening


@dataclass(frozen=True)
class FittedClip:
    """One clip of the trials, ready for compiled code.

    Attributes:
      problem: of the clip.
      column: `[own parameter]`, where its model's parameters stand among those of all clips.
      priors: of its parameters.
      absent: `[own parameter]`, values in their units where pinned.
      data: padded.
      on_device: all that its programs need.
    """

    problem: Problem
    column: np.ndarray
    priors: PriorTable
    absent: np.ndarray
    data: Padded
    on_device: OnDevice[ClipArrays]

    @classmethod
    def of(cls, trials: JointProblem, index: int) -> "FittedClip":
        """The clip of that index."""
        problem, column = trials.problems[index], trials.columns[index]
        parameters = problem.parameters
        priors, data = PriorTable.of(parameters), _padded(problem)
        absent = np.array([p.absent for p in parameters])
        scene = problem.model.scene.surroundings
        arrays = OnDevice(ClipArrays(data, scene, priors, absent, column))
        return cls(problem, column, priors, absent, data, arrays)

    @property
    def kind(self) -> Kind:
        """What its programs are compiled for."""
        return Kind(*self.problem.kind)

    @property
    def arrays(self) -> ClipArrays:
        """All that its programs need."""
        return self.on_device()

    def theta(self, z: np.ndarray, free: np.ndarray) -> np.ndarray:
        """`[point, joint parameter]` to this clip's parameters in their units."""
        own, is_free = z[:, self.column], free[:, self.column]
        return np.where(is_free, self.priors.in_units(own), self.absent)

    def search_noise(self, search_sd_m: float) -> float:
        """The noise scale at which the tracker's median error is that."""
        observation = self.problem.observation
        variance = np.trace(observation.covariance_m2, axis1=1, axis2=2)[observation.mask] / 2
        if not variance.size:
            return 1.0
        return max(1.0, search_sd_m / float(np.sqrt(np.median(variance))))

    def unpadded(self, jacobian: np.ndarray) -> np.ndarray:
        """Rows of real frames only."""
        shape = self.data.whitening.observed_m.shape
        frames = len(self.problem.observation.times_s)
        rows = jacobian.reshape(*shape, -1)[:, :, :frames]
        return rows.reshape(-1, jacobian.shape[1])


def _padded(problem: Problem) -> Padded:
    """Pads with frames that count for nothing and modes without gain."""
    times, data = problem.observation.times_s, problem.data
    frames = rounded_up(len(times), FRAMES) - len(times)
    # A camera's wobble has as many modes as frames; all else has fewer than those to spare.
    most = len(data.observed_m) * (len(times) + frames) + SPARE_MODES
    is_few = problem.noise != "camera" and len(data.gain) <= SPARE_MODES
    modes = SPARE_MODES if is_few else max(rounded_up(len(data.gain), FRAMES), most)
    modes -= len(data.gain)
    whitening = Whitening(
        np.pad(data.observed_m, [(0, 0), (0, 0), (0, frames)]),
        np.pad(data.inverse_root, [(0, 0), (0, 0), (0, 0), (0, frames)]),
        np.pad(data.basis, [(0, modes), (0, 0), (0, 0), (0, frames)]),
        np.pad(data.gain, (0, modes)),
        data.num_values,
    )
    return Padded(np.pad(times, (0, frames), mode="edge"), whitening)
