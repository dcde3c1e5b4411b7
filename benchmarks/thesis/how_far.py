"""'How far will it go?': inferred from the first --frames frames, asked for frame 110.

30 frames are 1 s: hits are just over (where nothing is hit by then, the truth is left out).
Reported: the error of where each object is after 110 frames, over --num truths, of the thesis's
estimate, of the naive guesser, and of one who says that nothing moves any further.
`python benchmarks/thesis/how_far.py`
"""

from collections.abc import Sequence

import numpy as np
import setting

from galileo_jax.commands import command

END = 110


def main(argv: Sequence[str]) -> int | None:
    call = setting.start(argv, __doc__, num=30, frames=30)
    cases = setting.experiments(call.seed, call.num, call.frames)
    truths = np.array([case.theta for case in cases])
    fitted = np.array([setting.infer(case, i) for i, case in enumerate(cases)])

    def ends(theta: np.ndarray) -> np.ndarray:
        """Where the objects are in the end, `[..., object]`, m along the table."""
        flat = theta.reshape(-1, theta.shape[-1])
        return setting.task(END).positions(flat)[:, :, 0, -1].reshape(*theta.shape[:-1], 2)

    true = ends(truths)
    guessed = ends(np.array([setting.guesses(i) for i in range(len(cases))]))
    stopped = np.array([case.seen_m[:, 0, -1] for case in cases])
    errors = {
        "fitted": np.abs(ends(fitted) - true),
        "guess": np.abs(guessed - true[:, None]).reshape(-1, 2),
        "no further": np.abs(stopped - true),
    }
    setting.row("error, m", ("1 median", "1 mean", "2 median", "2 mean"))
    found = {}
    for name, error in errors.items():
        found[name] = {"median": np.median(error, axis=0), "mean": error.mean(0)}
        setting.row(name, np.stack(list(found[name].values())).T.ravel().tolist())
    with setting.figure(call, "how_far", columns=2) as axes:
        for i in range(2):
            axes[0, i].plot(true[:, i], ends(fitted)[:, i], "o", markersize=3)
            axes[0, i].axline((0, 0), slope=1, color="black", linewidth=0.6)
            axes[0, i].set(title=f"object {i + 1}", xlabel="true end, m", ylabel="predicted, m")
    setting.finish(call, "how_far", found)
    return None


if __name__ == "__main__":
    raise SystemExit(command.run(main))
