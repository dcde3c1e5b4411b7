"""What a form has besides what every effect has: words for it, as it has no name."""

from typing import ClassVar

from galileo_jax.model.effects.effect import Effect, Surroundings, Theta

UNNAMED_ODDS = 0.05  # of a law that nobody has named, against one that is met again and again


class Form(Effect):
    """An effect without a name; `meaning` says what it does, `name` only labels it."""

    meaning: ClassVar[str]
    family: ClassVar[str]
    """The shape of its formula, as `diagnosis.laws` calls it; a law of that shape is the same."""

    def odds(self, theta: Theta, scene: Surroundings) -> float:
        """One in twenty."""
        return UNNAMED_ODDS
