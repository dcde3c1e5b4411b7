"""Advice: which further measurement would separate effects that this clip cannot separate."""

from galileo_jax.comparison.phases import free_phase
from galileo_jax.diagnosis.diagnosis import Verdict
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.effects.forms import FORM_BY_NAME

# How another run gets other speeds and places, by how the objects move.
ANOTHER_RUN = {
    "slide": "release object 1 from another height",
    "table": "push the object faster, and slower",
    "level": "push the pucks faster, slower and in another direction",
    "fall": "drop the object from another height",
    "flight": "throw the object at another speed and angle",
    "swing": "let the object swing much further, or much less",
    "liquid": "let the object go with another speed",
}
BESIDE_THE_CLIP = "measure a known length in the picture and the frame rate"
# What imitates what, as another gravity, and what separates it; springs and liquids: nothing does.
LIKE_GRAVITY = {"ramp_angle", "scale_error", "frame_rate", "constant_force"}
GRAVITY = {
    "slide": "film the same objects at another ramp angle, and measure the angle, a known length "
    "in the picture and the frame rate: an error in any of them acts like a different gravity",
    "table": f"{BESIDE_THE_CLIP}: an error in either acts like another friction",
    "fall": f"{BESIDE_THE_CLIP}: an error in any of them acts like a different gravity",
    "flight": f"{BESIDE_THE_CLIP}: an error in any of them acts like a different gravity",
}
# Other groups of effects that imitate each other, and what separates them; {again} is another run.
SEPARATES = (
    (
        {"air_drag", "viscous_drag", "stribeck"},
        "{again}, as different as possible: quadratic drag grows with the square of the speed, "
        "linear drag with the speed, and Stribeck friction falls with it",
    ),
    (
        {"release_delay", "initial_push", "static_friction"},
        "start the clip well before the release and film it with more frames per second",
    ),
    (
        {"friction_patch", "magnetic_brake", "surface_friction"},
        "{again}: the force of a brake grows with the speed, that of a patch of friction does "
        "not, and both stay in their place",
    ),
    (
        {"table_tilt", "constant_force", "surface_friction"},
        "let object 1 slide along the table in the other direction, too: a tilt or a steady force "
        "changes sign, friction does not",
    ),
    (
        {"rolling", "constant_force", "surface_friction"},
        "film at a steeper angle: rolling reduces every acceleration by the same share, a force "
        "does not",
    ),
    (
        {"camera_roll", "magnus", "constant_force"},
        "hang a plumb line into the picture; whether or not the camera was rolled, "
        "`vertical_sd_deg: 2` in the clip file allows for it",
    ),
    (
        {"spring_tether", "constant_force"},
        "use a longer run: a spring's force grows with the distance",
    ),
)

# Rules by which several explanations are left.
OPEN = ("contested", "contested_together", "not_told_apart", "separated_by_prior")


def advice(verdict: Verdict, scene: Surroundings, num_clips: int) -> tuple[str, ...]:
    """Sentences for the user: what would tell more. Empty where nothing is open."""
    motion = _motion(scene)
    again = ANOTHER_RUN[motion]
    if verdict.status == "unknown":
        form = verdict.form
        known = () if form is None else (f"it looks like {FORM_BY_NAME[form].meaning} ({form})",)
        if any(why.rule in OPEN for why in verdict.reasons):
            known = (
                *known,
                f"{again}, and diagnose both clips together: within one clip time, place and "
                "speed change together, in two they do not",
            )
        return (
            *known,
            "look at the missing acceleration against time, speed and place; if you recognise "
            "it, write it as an effect of your own (ten lines of Python: "
            "docs/how-to/write_an_effect.md) and run diagnose again with --effects-from",
        )
    if verdict.status == "named":
        seconds = [why for why in verdict.reasons if why.rule == "second_possible"]
        others = (why.numbers["second"] for why in seconds)
        return tuple(f"to see whether {other} acts, too: {again}" for other in others)
    if verdict.status != "ambiguous":
        return ()
    groups = [(group, how.format(again=again)) for group, how in SEPARATES]
    if motion in GRAVITY:
        groups.insert(1, (LIKE_GRAVITY, GRAVITY[motion]))
    hypotheses = [set(effects.split("+")) for effects in verdict.effects]
    # What all have in common is sure: there is nothing to tell it from.
    named = set.union(*hypotheses) - set.intersection(*hypotheses)
    said = [
        f"to tell {', '.join(sorted(named & group))} apart: {how}"
        for group, how in groups
        if len(named & group) > 1
    ]
    if forms := named & set(FORM_BY_NAME):
        meant = " or ".join(FORM_BY_NAME[form].meaning for form in sorted(forms))
        said.append(
            f"it may also be {meant}: {again}; an effect of a place stays in its place, an "
            "effect of the speed moves with the speed"
        )
    if verdict.law is not None:
        said.append(f"it may also be {verdict.law.text} (proposed_effect.py): {again}")
    if not said:
        said = [f"{again}, or use another angle of the ramp" if motion == "slide" else again]
    if num_clips == 1:
        said.append(
            "diagnose several clips of the same objects together: they share masses and friction"
        )
    return tuple(said)


def _motion(scene: Surroundings) -> str:
    """Under which name `ANOTHER_RUN` has it."""
    if scene.is_level:
        return "level"
    if scene.has_surface:
        return "slide" if scene.angle_rad else "table"
    return free_phase(scene)
