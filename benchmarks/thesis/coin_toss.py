"""Ablation: the thesis's chains with a coin toss in place of the similarity.

    thesis          better proposals always, others by a coin; the best sample wins
    coin alone      every proposal by a coin; the answer is where the first chain ends
    coin, best      the same walks, but the best sample of all chains wins
    draws, best     no walks: the best of as many uniform draws
`python benchmarks/thesis/coin_toss.py`
"""

from collections.abc import Sequence

import numpy as np
import setting

from galileo_jax.commands import command
from galileo_jax.thesis.sampler import NARROW, NUM_CHAINS, NUM_STEPS, WIDE, WIDE_EVERY
from galileo_jax.thesis.task import NAMES

NUM_STATES = NUM_CHAINS * (NUM_STEPS + 1)


def main(argv: Sequence[str]) -> int | None:
    call = setting.start(argv, __doc__, num=30)
    cases = setting.experiments(call.seed, call.num, call.frames)
    truths = np.array([case.theta for case in cases])
    answers: dict[str, list[np.ndarray]] = {}
    for number, case in enumerate(cases):
        generator = np.random.default_rng([number, 2])
        walks = coin_walks(generator)
        draws = generator.uniform(1e-3, 1.0, (NUM_STATES, len(NAMES)))
        found = {
            "thesis": setting.infer(case, number),
            "coin alone": walks[0, -1],
            "coin, best": nearest(walks.reshape(-1, len(NAMES)), case),
            "draws, best": nearest(draws, case),
        }
        for name, theta in found.items():
            answers.setdefault(name, []).append(theta)
    setting.row("search", (*setting.QUANTITIES, "L1", "L2"))
    table = {}
    for name, estimates in answers.items():
        error = setting.errors(np.array(estimates), truths).mean(0)
        pairs = zip(estimates, cases, strict=True)
        distance = np.mean([setting.distances(theta, case) for theta, case in pairs], axis=0)
        setting.row(name, [*error, *distance])
        table[name] = {"error": error, "distance": distance}
    with setting.figure(call, "coin_toss", columns=2) as axes:
        axes[0, 0].bar(list(table), [entry["distance"][0] for entry in table.values()])
        axes[0, 0].set(title="L1 distance, m/frame", yscale="log")
        axes[0, 0].tick_params(axis="x", labelsize=7)
        for name, entry in table.items():
            axes[0, 1].plot(setting.QUANTITIES, entry["error"], "o", label=name)
        axes[0, 1].set(title="mean absolute error", yscale="log")
        axes[0, 1].legend()
    setting.finish(call, "coin_toss", table)
    return None


def coin_walks(generator: np.random.Generator) -> np.ndarray:
    """16 chains that see no data, `[chain, step, 4]`: what is proposed, taken or not."""
    here = generator.uniform(1e-3, 1.0, (NUM_CHAINS, len(NAMES)))
    walks = [here]
    for step in range(1, NUM_STEPS + 1):
        width = WIDE if step % WIDE_EVERY == 0 else NARROW
        low, high = np.maximum(here - width, 1e-3), np.minimum(here + width, 1.0)
        proposed = generator.uniform(low, high)
        walks.append(proposed)
        here = np.where(generator.random((NUM_CHAINS, 1)) < 0.5, proposed, here)
    return np.stack(walks, axis=1)


def nearest(theta: np.ndarray, case: setting.Experiment) -> np.ndarray:
    """Of `[batch, 4]` the one of highest Gaussian similarity: least squares."""
    difference = setting.profiles(theta, case.profile_m_s.shape[-1]) - case.profile_m_s
    return theta[np.argmin((difference**2).sum(axis=(1, 2, 3)))]


if __name__ == "__main__":
    raise SystemExit(command.run(main))
