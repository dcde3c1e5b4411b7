"""Against the naive guesser: L1 and L2 distances of the fitted profile and of random ones.

The guesser draws masses and frictions uniformly in (0, 1): 30 guesses for every truth. Beside the
thesis's figures (on its real videos) stand the distances of the truth itself: the noise.
`python benchmarks/thesis/naive_guesser.py`
"""

from collections.abc import Sequence

import numpy as np
import setting

from galileo_jax.commands import command


def main(argv: Sequence[str]) -> int | None:
    call = setting.start(argv, __doc__, num=30)
    cases = setting.experiments(call.seed, call.num, call.frames)
    rows = {
        "fitted": [setting.distances(setting.infer(c, i), c) for i, c in enumerate(cases)],
        "guess": [setting.distances(setting.guesses(i), c) for i, c in enumerate(cases)],
        "truth": [setting.distances(c.theta, c) for c in cases],
    }
    setting.row("", ("L1", "L2", "thesis L1", "thesis L2"))
    found = {}
    for name, distances in rows.items():
        mean = np.mean(distances, axis=0)
        setting.row(name, [*mean, *setting.THESIS_DISTANCES.get(name, (None, None))])
        found[name] = mean
    better = np.mean([f[0] < g[0] for f, g in zip(rows["fitted"], rows["guess"], strict=True)])
    ratio = found["guess"] / found["fitted"]
    print(f"nearer than the guesser in {better:.0%}; the guesser is {ratio[0]:.1f} times as far")
    with setting.figure(call, "naive_guesser", columns=2) as axes:
        for i, name in enumerate(("L1", "L2")):
            axes[0, i].boxplot([np.array(d)[:, i] for d in rows.values()], tick_labels=list(rows))
            axes[0, i].set(title=f"{name}, m/frame", yscale="log")
    setting.finish(call, "naive_guesser", {**found, "nearer": better, "ratio": ratio})
    return None


if __name__ == "__main__":
    raise SystemExit(command.run(main))
