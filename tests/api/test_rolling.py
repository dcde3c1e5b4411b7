"""A ball that rolls without slipping: friction that varies does nothing to it."""

import numpy as np
import yaml

import galileo_jax as gx


def test_no_uneven_friction_explains_a_ball_that_rolls(tmp_path):
    """Whose marks wander by a millimetre, as on a texture that turns."""
    rng, t = np.random.default_rng(4), np.arange(50) / 30
    way = 0.5 * 9.81 * np.sin(np.radians(12)) * 5 / 7 * t**2
    wander = 1e-3 * np.sin(way / 0.044)
    way = way + wander + 2e-4 * rng.normal(size=50)
    rows = "\n".join(f"{a:.4f},{b:.6f}" for a, b in zip(t, way, strict=True))
    (tmp_path / "ball.csv").write_text(f"t (s),s (m)\n{rows}\n")
    ball = {"name": "ball", "shape": "sphere", "size_m": [0.044]}
    keys = {"track": "ball.csv", "scenario": "incline", "ramp_angle_deg": 12, "objects": [ball]}
    (tmp_path / "ball.yaml").write_text(yaml.safe_dump(keys))
    fit = gx.fit(tmp_path / "ball.yaml")
    assert not fit.parameters["k1"]["identified"]
    assert "friction_roughness" not in [term.name for term in fit.problem.terms]
    assert "friction_roughness" not in fit.result.get("imperfections", {})


def test_a_declared_mass_and_a_hit_tell_the_ratio(tmp_path):
    path = tmp_path / "hit.csv"
    made = gx.simulate(path, seed=4, track_only=True)
    content = yaml.safe_load(path.with_suffix(".yaml").read_text())
    content["objects"][0]["mass_kg"] = made.truths[0]["m1"]
    path.with_suffix(".yaml").write_text(yaml.safe_dump(content))
    fit = gx.fit(path)
    assert fit.result["derived"]["mass_ratio"]["identified"]
    assert abs(fit.parameters["m2"]["mean"] / made.truths[0]["m2"] - 1) < 0.1
