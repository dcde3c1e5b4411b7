"""60 frames against 110: does seeing for longer help?

The sampler on the same truths (0.01 m/s of noise), and the thesis's network on the same noise-free
ones. Most objects rest within 60 frames. `python benchmarks/thesis/frame_counts.py`
"""

from collections.abc import Sequence

import numpy as np
import setting

from galileo_jax.commands import command
from galileo_jax.neural.checkpoint import load_network
from galileo_jax.thesis.task import CM

FRAMES = (60, 110)


def main(argv: Sequence[str]) -> int | None:
    call = setting.start(argv, __doc__, num=30, frames=max(FRAMES))
    found = {}
    setting.row("frames, method", setting.QUANTITIES)
    for frames in FRAMES:
        cases = setting.experiments(call.seed, call.num, frames)
        truths = np.array([case.theta for case in cases])
        fitted = np.array([setting.infer(case, i) for i, case in enumerate(cases)])
        network, _ = load_network(setting.NETWORKS / f"thesis_{frames}.npz")
        many = setting.experiments(call.seed, 10 * call.num, frames, noise_m=0.0)
        moved = np.array([CM * np.diff(case.clean_m, axis=-1) for case in many])
        read = np.asarray(network(moved.reshape(len(many), 4, frames).astype(np.float32)))
        speed = setting.profiles(truths, frames)[..., -1]
        found[str(frames)] = {
            "sampler": setting.errors(fitted, truths).mean(0),
            "network": setting.errors(
                np.clip(read, 1e-3, None), np.array([case.theta for case in many])
            ).mean(0),
            "at_rest": float(np.mean(np.abs(speed).max(axis=(1, 2)) < 1e-3)),
        }
        for name in ("sampler", "network"):
            setting.row(f"{frames}, {name}", list(found[str(frames)][name]))
        print(f"{found[str(frames)]['at_rest']:.0%} of the truths are at rest in the last frame")
    with setting.figure(call, "frame_counts", columns=2) as axes:
        for i, name in enumerate(("sampler", "network")):
            for frames in FRAMES:
                axes[0, i].plot(setting.QUANTITIES, found[str(frames)][name], "o", label=frames)
            axes[0, i].set(title=f"{name}: mean absolute error", yscale="log")
            axes[0, i].legend()
    setting.finish(call, "frame_counts", found)
    return None


if __name__ == "__main__":
    raise SystemExit(command.run(main))
