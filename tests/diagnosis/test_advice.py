"""What to film next must be possible in the scenario, and is only told where something is open."""

from dataclasses import replace

import pytest

from galileo_jax.diagnosis.advice import advice
from galileo_jax.diagnosis.diagnosis import Reason, Verdict
from galileo_jax.model.effects.forms import FORM_NAMES
from tests.ramp_model import HIT, make_surroundings

RAMP = make_surroundings(HIT)
FALL = replace(make_surroundings(replace(HIT, object2_x_m=None)), has_surface=False)
TABLE = replace(RAMP, angle_rad=0.0)
FLIGHT = replace(FALL, moves_in_plane=True, laws=("start_velocity",))
SPRING = replace(FALL, laws=("spring", "start_velocity"))
LIQUID = replace(FALL, laws=("liquid", "start_velocity"))
OPEN = [
    ("air_drag", "viscous_drag"),
    ("frame_rate", "scale_error"),
    ("air_drag", "frame_rate"),  # of no group
    ("air_drag", FORM_NAMES[0]),
]


@pytest.mark.parametrize("effects", OPEN)
@pytest.mark.parametrize(
    ("scene", "says"),
    [
        (TABLE, "push the object"),
        (FALL, "drop"),
        (FLIGHT, "throw"),
        (SPRING, "swing"),
        (LIQUID, "another speed"),
    ],
)
def test_without_a_surface_no_ramp_is_asked_for(scene, says, effects):
    told = " ".join(advice(Verdict("ambiguous", effects), scene, num_clips=1))
    assert "ramp" not in told and "release object 1" not in told
    assert says in told or "frame rate" in told


def test_each_scene_has_its_own_gravity():
    verdict = Verdict("ambiguous", ("frame_rate", "scale_error"))
    assert "another ramp angle" in advice(verdict, RAMP, 1)[0]
    assert "different gravity" in advice(verdict, FALL, 1)[0]
    assert "gravity" not in " ".join(advice(verdict, SPRING, 1))


def test_several_clips_are_only_asked_for_where_there_is_one():
    verdict = Verdict("ambiguous", ("air_drag", "viscous_drag"))
    assert len(advice(verdict, RAMP, 1)) == 1 + len(advice(verdict, RAMP, 2))


def test_where_nothing_is_open_nothing_is_asked_for():
    assert advice(Verdict("named", ("air_drag",)), RAMP, 1) == ()
    assert "docs/how-to/write_an_effect.md" in advice(Verdict("unknown", ()), FALL, 1)[0]


def test_what_is_sure_is_told_from_nothing():
    """A tilt that is in all that explain the data, and friction that is in one of them."""
    sure = Verdict("ambiguous", ("table_tilt", "table_tilt+surface_friction"))
    assert not any("table_tilt" in line for line in advice(sure, RAMP, 1))
    open_ = Verdict("ambiguous", ("table_tilt", "surface_friction"))
    assert "to tell surface_friction, table_tilt apart" in advice(open_, RAMP, 1)[0]


def test_a_name_is_followed_by_how_to_see_a_second_effect_that_may_be_there():
    named = Verdict("named", ("air_drag",))
    assert advice(named, RAMP, 1) == ()
    why = Reason("second_possible", "", {"second": "frame_rate"})
    (said,) = advice(replace(named, reasons=(why,)), FALL, 1)
    assert "frame_rate" in said and "another height" in said
