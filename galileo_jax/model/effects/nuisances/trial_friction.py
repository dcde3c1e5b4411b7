"""Trial friction: each trial of the same things has friction of its own, about one that they share.

    k_i(trial) = k_i exp(s u),    u ~ N(0, 1)

A block and a board that are put together again differ by some five per cent from run to run: dust,
where they touch, how they lie. How much (s) is inferred from the trials. Two that agree narrow it
down by little; then the prior's width, a factor of four either way, decides.

Source: four runs of one block on one board (docs/explanation/real_data.md); Gelman and Hill (2007),
Data Analysis Using Regression and Multilevel/Hierarchical Models, ch. 12.
"""

from galileo_jax.model.effects import Effect, LogNormal, Normal, Parameter

SPREAD, SPREAD_FACTOR = 0.03, 1.386  # median, and the standard deviation of its logarithm


class TrialFriction(Effect, where=lambda scene: scene.has_surface):
    name = "trial_friction"
    spread = "friction_spread"

    def parameters(self, scene):
        between = LogNormal(SPREAD, SPREAD_FACTOR)
        return (
            Parameter(self.spread, "1", between, 0.0, "latent", 0.2),
            *(
                Parameter(f"trial_friction_{i + 1}", "1", Normal(0.0, 1.0), 0.0, "nuisance", 0.2)
                for i in range(len(scene.names))
            ),
        )

    def friction(self, theta, scene):
        deviation = [theta[f"trial_friction_{i + 1}"] for i in range(len(scene.names))]
        xp = deviation[0].__array_namespace__()
        factor = xp.exp(theta[self.spread][..., None] * xp.stack(deviation, axis=-1))
        return lambda state, k: k * factor
