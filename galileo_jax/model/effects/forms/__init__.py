"""Forms: general ways a force can depend on time, place or speed, without a physical name.

The library's effects are certain dependences: on two powers of the speed (drags) or near rest
(Stribeck), on a place (a patch). The rest of that table stands here,

                 steadily               at one                 in waves
    time         friction_with_time     force_at_a_time,       force_waves_in_time
                                        friction_from_a_time
    place        friction_with_place    (friction_patch)       friction_waves_in_place
    speed        drag_of_a_power        (stribeck)

and runs in every diagnosis beside the library. A name is given only to what explains the data
better than all of these: one that does not has merely the right shape on this clip, as a
patch of friction has that of a gust.

They are effects like any other but in no list of names: `fit --effects` does not know them.
"""

from galileo_jax.model.effects.forms.drag_of_a_power import DragOfAPower
from galileo_jax.model.effects.forms.force_at_a_time import ForceAtATime
from galileo_jax.model.effects.forms.force_waves_in_time import ForceWavesInTime
from galileo_jax.model.effects.forms.form import Form
from galileo_jax.model.effects.forms.friction_from_a_time import FrictionFromATime
from galileo_jax.model.effects.forms.friction_waves_in_place import FrictionWavesInPlace
from galileo_jax.model.effects.forms.friction_with_place import FrictionWithPlace
from galileo_jax.model.effects.forms.friction_with_time import FrictionWithTime

FORMS: tuple[Form, ...] = (
    DragOfAPower(),
    ForceAtATime(),
    ForceWavesInTime(),
    FrictionFromATime(),
    FrictionWavesInPlace(),
    FrictionWithPlace(),
    FrictionWithTime(),
)
"""In the order in which their hooks are applied, after the library's."""

FORM_NAMES = tuple(form.name for form in FORMS)
FORM_FAMILIES = {form.name: form.family for form in FORMS}
FORM_SHAPES = {form.name: (form.family, form.nature, form.is_on_all) for form in FORMS}
FORM_MEANINGS = {form.name: form.meaning for form in FORMS}
