"""Experiments 1 to 4: what each of m1, k1, m2, k2 changes in the velocity profile, one at a time.

Each goes through its range (masses 0.1 to 1, frictions 0.02 to 0.3) while the others stay at the
middle. Experiment 5 is ours: both masses together, their ratio kept. Reported: the root mean square
change of each object's velocities from one end of the range to the other, and how far the objects'
last places move. `python benchmarks/thesis/parameter_influence.py`
"""

from collections.abc import Sequence

import numpy as np
import setting

from galileo_jax.commands import command
from galileo_jax.thesis.task import FPS, NAMES

MIDDLE = np.array([0.5, 0.12, 0.5, 0.15])
RANGES = np.array([[0.1, 1.0], [0.02, 0.3], [0.1, 1.0], [0.02, 0.3]])


def main(argv: Sequence[str]) -> int | None:
    call = setting.start(argv, __doc__, num=9)
    sweeps = {}
    for i, name in enumerate(NAMES):
        theta = np.tile(MIDDLE, (call.num, 1))
        theta[:, i] = np.linspace(RANGES[i, 0], RANGES[i, 1], call.num)
        sweeps[name] = theta
    both = np.tile(MIDDLE, (call.num, 1))
    both[:, [0, 2]] = np.linspace(RANGES[0, 0], RANGES[0, 1], call.num)[:, None]
    sweeps["m1 = m2"] = both

    setting.row("varied", ("dv1 m/s", "dv2 m/s", "dx1 m", "dx2 m"))
    found = {}
    with setting.figure(call, "parameter_influence", columns=len(sweeps), rows=2) as axes:
        for column, (name, theta) in enumerate(sweeps.items()):
            velocity = setting.profiles(theta, call.frames)
            last = setting.task(call.frames).positions(theta)[..., 0, -1]
            change = np.sqrt(np.mean((velocity[-1] - velocity[0]) ** 2, axis=(-2, -1)))
            moved = np.ptp(last, axis=0)
            found[name] = {"dv_m_s": change, "dx_m": moved}
            setting.row(name, [*change, *moved])
            speed = np.linalg.norm(velocity, axis=2)
            times = np.arange(call.frames) / FPS
            for k in range(2):
                for value, curve in zip(np.linspace(0, 0.9, call.num), speed[:, k], strict=True):
                    axes[k, column].plot(times, curve, color=str(value), linewidth=1)
                axes[k, column].set(title=f"{name}: object {k + 1}", xlabel="s", ylabel="m/s")
    setting.finish(call, "parameter_influence", found)
    return None


if __name__ == "__main__":
    raise SystemExit(command.run(main))
