"""A mass that is declared, and a hit."""

import yaml

import galileo_jax as gx
from galileo_jax.commands.clip_options import fit_table


def test_a_declared_mass_and_a_hit_tell_the_ratio(tmp_path):
    path = tmp_path / "hit.csv"
    made = gx.simulate(path, seed=4, track_only=True)
    content = yaml.safe_load(path.with_suffix(".yaml").read_text())
    content["objects"][0]["mass_kg"] = made.truths[0]["m1"]
    path.with_suffix(".yaml").write_text(yaml.safe_dump(content))
    fit = gx.fit(path)
    (line,) = (one for one in fit_table(fit, {}).splitlines() if one.startswith("m1 "))
    assert line.endswith("as declared kg") and f"{made.truths[0]['m1']:.3f}" in line
    assert fit.result["derived"]["mass_ratio"]["identified"]
    assert abs(fit.parameters["m2"]["mean"] / made.truths[0]["m2"] - 1) < 0.1
