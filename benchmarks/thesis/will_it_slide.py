"""'Will it slide?': friction learned at 20 degrees, asked of object 1 on less steep ramps.

A body at rest slides where k1 < tan(angle). Correct answers over --num truths and the angles 2 to
16 degrees: of the thesis's estimate, and of the naive guesser (k1 uniform in (0, 1)).
`python benchmarks/thesis/will_it_slide.py`
"""

from collections.abc import Sequence

import numpy as np
import setting

from galileo_jax.commands import command

ANGLES_DEG = np.arange(2.0, 17.0, 2.0)


def main(argv: Sequence[str]) -> int | None:
    call = setting.start(argv, __doc__, num=30)
    cases = setting.experiments(call.seed, call.num, call.frames)
    true_k1 = np.array([case.theta[1] for case in cases])
    fitted = np.array([setting.infer(case, i)[1] for i, case in enumerate(cases)])
    guessed = np.array([setting.guesses(i)[:, 1] for i in range(len(cases))])
    slope = np.tan(np.deg2rad(ANGLES_DEG))
    slides = true_k1[:, None] < slope
    correct = {
        "fitted": ((fitted[:, None] < slope) == slides).mean(0),
        "guess": ((guessed[:, :, None] < slope) == slides[:, None]).mean((0, 1)),
    }
    setting.row("ramp, degrees", (*map(str, ANGLES_DEG), "all"))
    setting.row("slides", [*slides.mean(0), slides.mean()])
    for name, share in correct.items():
        setting.row(f"correct, {name}", [*share, share.mean()])
    with setting.figure(call, "will_it_slide") as axes:
        for name, share in correct.items():
            axes[0, 0].plot(ANGLES_DEG, share, "o-", label=name)
        axes[0, 0].set(
            title="will it slide: correct answers", xlabel="ramp, degrees", ylim=(0, 1.02)
        )
        axes[0, 0].legend()
    overall = {name: float(share.mean()) for name, share in correct.items()}
    setting.finish(call, "will_it_slide", {"angles_deg": ANGLES_DEG, **correct, "all": overall})
    return None


if __name__ == "__main__":
    raise SystemExit(command.run(main))
