"""What measurement would tell apart what this one does not."""

from galileo_jax.diagnosis.diagnosis import Verdict
from galileo_jax.effects.forms import FORM_MEANINGS
from galileo_jax.inference.trials import Trials

# Groups of effects that imitate each other, and what separates them.
SEPARATES = (
    (
        {"air_drag", "viscous_drag", "stribeck"},
        "release object 1 from two very different heights: quadratic drag grows with the square "
        "of the speed, linear drag with the speed, and Stribeck friction falls with it",
    ),
    (
        {"ramp_angle", "scale_error", "frame_rate", "constant_force"},
        "film the same objects at another ramp angle, and measure the angle, a known length in "
        "the picture and the frame rate: each of them acts like another gravity",
    ),
    (
        {"release_delay", "initial_push", "static_friction"},
        "start the clip well before the release and film it with more frames per second",
    ),
    (
        {"friction_patch", "magnetic_brake", "surface_friction"},
        "release from another height: a brake takes force in proportion to the speed, a patch of "
        "friction does not, and neither moves with the release",
    ),
    (
        {"table_tilt", "constant_force", "surface_friction"},
        "let object 1 slide along the table in the other direction, too: a tilt or a steady force "
        "changes sign, friction does not",
    ),
    (
        {"rolling", "constant_force", "surface_friction"},
        "film at a steeper angle: inertia takes a share of every acceleration, a force does not",
    ),
    (
        {"spring_tether", "constant_force"},
        "use a longer run: a spring's force grows with the distance",
    ),
)


def advice(verdict: Verdict, trials: Trials) -> tuple[str, ...]:
    """Sentences for the user: what would tell more. Empty where nothing is open."""
    several = len(trials.problems) > 1
    if verdict.status == "unknown":
        form = verdict.form
        known = () if form is None else (f"it has the form of {FORM_MEANINGS[form]} ({form})",)
        return (
            *known,
            "look at the missing acceleration against time, speed and place: an effect of your own "
            "takes ten lines (docs/effects.md), then run diagnose with --effects-from",
        )
    if verdict.status != "ambiguous":
        return ()
    named = {name for effects in verdict.effects for name in effects.split("+")}
    said = [
        f"to tell {', '.join(sorted(named & group))} apart: {how}"
        for group, how in SEPARATES
        if len(named & group) > 1
    ]
    if forms := named & set(FORM_MEANINGS):
        meant = " or ".join(FORM_MEANINGS[form] for form in sorted(forms))
        said.append(
            f"it may as well be {meant}: release from another height, for what belongs to a place "
            "stays there, and what belongs to a speed comes with it"
        )
    if not said:
        said = ["release object 1 from another height, or use another angle of the ramp"]
    if not several:
        said.append("give several clips of the same objects together: they share their parameters")
    return tuple(said)
