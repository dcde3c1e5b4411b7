"""What a film or table shows, in one sentence, and what is then asked."""

import re

import numpy as np

from galileo_jax.api.explain import understood
from galileo_jax.api.questions import answered
from galileo_jax.api.understand import Understood, sentence_of
from tests.studio.clips import clip_in, still_film

SLOPE = "t (s);s\n" + "".join(f"{t:.2f};{0.4 * t**2:.4f}\n" for t in np.arange(30) / 25)


def test_the_sentence_of_a_table_and_what_is_asked_of_it(tmp_path):
    path = tmp_path / "slope.csv"
    path.write_text(SLOPE)
    known = understood(path, {})
    assert isinstance(known, Understood)
    found = answered(known, {"ramp_angle_deg": "steep"})
    sentence = sentence_of(found.known)
    assert sentence.startswith("One thing moves, 0.538 (in a unit that it does not say) in one")
    assert sentence.endswith("it looks like an incline. 30 rows, 25 a second.")
    asked = [one.key for one in found.questions]
    assert asked == ["scenario", "track_units", "ramp_angle_deg"]
    assert found.known.answers == {"scenario": "incline", "track_units": "m"}, (
        "Enter takes the default"
    )
    assert found.problems == {"ramp_angle_deg": "ramp_angle_deg: 'steep' is not a number"}
    other = sentence_of(known.with_answers({"scenario": "fall"}))
    assert ": it is taken for a fall, as you say; it looks like an incline. 30 rows" in other
    asked = answered(known, {"scenario": "fall"}).questions
    assert [one.key for one in asked] == ["scenario", "track_units"], "a fall has no ramp"


def test_the_sentence_of_a_film_and_of_a_clip(tmp_path):
    bare = understood(clip_in(tmp_path, is_bare=True), {})
    assert re.match(r"(2|One) things? moves?", sentence_of(bare))
    assert "pictures a second." in sentence_of(bare)
    still = understood(still_film(tmp_path / "still.mp4"), {})
    assert sentence_of(still).startswith("No moving thing was found: ")
    declared = understood(clip_in(tmp_path), {})
    assert sentence_of(declared).startswith("slide.yaml says all that is needed: a ramp at ")
