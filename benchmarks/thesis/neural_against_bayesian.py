"""Neural against Bayesian, on the same truths without and with noise.

    thesis sampler   16 chains of 75 steps, the best sample
    thesis network   the CNN, trained without noise
    galileo network  the amortised posterior of the package (k1, k2 and phi only), told the noise
Mean absolute errors over --num truths and seconds for each. Masses cannot be told singly.
`python benchmarks/thesis/neural_against_bayesian.py`
"""

import time
from collections.abc import Callable, Sequence

import jax
import numpy as np
import setting

from galileo_jax.commands import command
from galileo_jax.neural.checkpoint import load_network
from galileo_jax.neural.estimate import trained_network
from galileo_jax.neural.galileo_task import estimate
from galileo_jax.thesis.clips import to_clips
from galileo_jax.thesis.task import CM

LEAST_NOISE_M = 1e-5  # what the galileo network is told where there is none
TOLD = (1, 3, 4)  # k1, k2, phi


def main(argv: Sequence[str]) -> int | None:
    call = setting.start(argv, __doc__, num=30)
    network, _ = load_network(setting.NETWORKS / f"thesis_{call.frames}.npz")
    read = jax.jit(lambda profile: network(profile))
    amortised = trained_network()

    def sampler(cases: list[setting.Experiment], noise_m: float) -> np.ndarray:
        del noise_m
        fitted = np.array([setting.infer(case, i) for i, case in enumerate(cases)])
        return setting.quantities(fitted)

    def cnn(cases: list[setting.Experiment], noise_m: float) -> np.ndarray:
        del noise_m
        moved = np.array([CM * np.diff(case.seen_m, axis=-1) for case in cases])
        profile = moved.reshape(len(cases), 4, call.frames).astype(np.float32)
        return setting.quantities(np.clip(np.asarray(read(profile)), 1e-3, None))

    def galileo(cases: list[setting.Experiment], noise_m: float) -> np.ndarray:
        theta = np.array([case.theta for case in cases])
        seen = np.array([case.seen_m for case in cases])
        scene = setting.task(call.frames).surroundings
        clips = to_clips(theta, seen, scene, max(noise_m, LEAST_NOISE_M))
        draws = estimate(amortised, clips, 0)
        phi = (draws.mass_ratio - 1) / (draws.mass_ratio + 1)
        values = np.full((len(cases), 5), np.nan)
        values[:, TOLD] = np.stack([d.mean(1) for d in (draws.k1, draws.k2, phi)], axis=1)
        return values

    methods: dict[str, Callable] = {
        "thesis sampler": sampler,
        "thesis network": cnn,
        "galileo network": galileo,
    }
    setting.row("noise, method", (*setting.QUANTITIES, "s each"))
    found = {}
    for noise_m in (0.0, setting.NOISE_M):
        cases = setting.experiments(call.seed, call.num, call.frames, noise_m)
        truth = setting.quantities(np.array([case.theta for case in cases]))
        for name, method in methods.items():
            method(cases[:1] if method is sampler else cases, noise_m)
            began = time.perf_counter()
            error = np.abs(method(cases, noise_m) - truth)
            seconds = (time.perf_counter() - began) / len(cases)
            label = f"{1e3 * noise_m:.2f} mm, {name}"
            setting.row(label, [*error.mean(0), seconds])
            found[label] = {"mae": error.mean(0), "median": np.median(error, 0), "s": seconds}
    with setting.figure(call, "neural_against_bayesian") as axes:
        for label, entry in found.items():
            axes[0, 0].plot(setting.QUANTITIES, entry["mae"], "o", label=label)
        axes[0, 0].set(title="mean absolute error", yscale="log")
        axes[0, 0].legend(fontsize=6)
    setting.finish(call, "neural_against_bayesian", found)
    return None


if __name__ == "__main__":
    raise SystemExit(command.run(main))
