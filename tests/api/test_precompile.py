"""Programs built while the video is tracked are those that the fit calls."""

from pathlib import Path

import jax
import numpy as np

from galileo_jax.api import precompile
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.inference.fits.residuals import Residuals
from tests.oracle_run import HIT, make_run


def shapes(tree):
    leaves, structure = jax.tree.flatten(tree)
    return structure, [np.shape(leaf) for leaf in leaves]


def test_a_likely_clip_is_compiled_as_the_tracked_one(tmp_path):
    run = make_run(tmp_path, HIT, 1.6)
    clip = run.clip.model_copy(update={"frame_count": len(run.problem.observation.times_s)})
    likely = precompile._likely(clip)
    one, other = (
        Residuals(make_joint_problem([clip], [seen])).clips[0]
        for seen in (likely, run.problem.observation)
    )
    assert one.problem.kind == other.problem.kind
    assert shapes(one.arrays) == shapes(other.arrays)
    assert one.problem.model.num_records == other.problem.model.num_records


def test_what_is_wrong_is_told_later(tmp_path):
    def build(*_):
        raise ValueError("in earnest, this is told when the clip is fitted")

    filmed = make_run(tmp_path, HIT, 1.6).clip.model_copy(update={"video": Path("clip.mp4")})
    asked = []
    with precompile.precompiling([filmed], lambda *given: build(asked.append(given))):
        pass
    assert len(asked) == 1
