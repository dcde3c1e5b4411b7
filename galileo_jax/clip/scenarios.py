"""The scenarios a clip can show, in one registry."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Scenario:
    """What a scenario asks of its clip.

    Attributes:
      name: as written in the clip yaml.
      meaning: one phrase for the user.
      has_ramp: it needs `ramp_angle_deg`, and its objects stand on the ramp or the table.
      num_objects: (fewest, most) objects; None means no upper limit.
    """

    name: str
    meaning: str
    has_ramp: bool
    num_objects: tuple[int, int | None]


SCENARIOS: dict[str, Scenario] = {
    scenario.name: scenario
    for scenario in (
        Scenario("ramp", "object 1 slides down a ramp onto a table", True, (1, 2)),
        Scenario("incline", "one object slides down a board, no table", True, (1, 1)),
        Scenario("fall", "one object is dropped", False, (1, 1)),
        Scenario("flight", "objects are thrown", False, (1, None)),
        Scenario("multi", "object 1 slides down a ramp onto a table, into others", True, (1, None)),
        Scenario("spring", "an object hangs on or is pushed by a spring", False, (1, None)),
        Scenario("liquid", "objects move in a liquid", False, (1, None)),
    )
}
