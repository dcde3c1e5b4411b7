"""The tutorial's commands print what the tutorial shows."""

import pytest

from tests.docs.console import Shown, differences, run, shown_commands
from tests.docs.pages import ROOT

TUTORIAL = ROOT / "docs" / "tutorial" / "find_what_is_missing.md"


SHOWN = shown_commands(TUTORIAL.read_text())
QUICK = ("simulate", "compare")  # the others follow from them, in this order


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """What a command prints after those before it; each is run once."""
    folder, said = tmp_path_factory.mktemp("tutorial"), dict[str, str]()

    def of(shown: Shown) -> str:
        for one in SHOWN[: SHOWN.index(shown) + 1]:
            if one.command not in said:
                said[one.command] = run(one.command, folder)
        return said[shown.command]

    return of


def test_the_tutorial_shows_the_whole_loop():
    verbs = [shown.command.split()[1] for shown in SHOWN]
    assert verbs == ["simulate", "compare", "diagnose", "fit", "predict"]


@pytest.mark.parametrize(
    "shown",
    [
        pytest.param(shown, id=verb, marks=[] if verb in QUICK else [pytest.mark.slow])
        for shown in SHOWN
        for verb in shown.command.split()[1:2]
    ],
)
def test_a_command_prints_what_the_tutorial_shows(shown, printed):
    assert not differences(shown.printed, printed(shown))


class TestDifferences:
    def test_none_in_the_same_text(self):
        assert not differences("k1  0.1481  [0.146, 0.15]", "k1  0.1481  [0.146, 0.15]")

    def test_a_last_digit_may_differ(self):
        assert not differences("k1  0.1481  z 32.7", "k1  0.1482  z 32.6")

    def test_a_whole_number_may_not(self):
        assert differences("50 frames", "52 frames")

    def test_another_number_is_told(self):
        assert differences("k1  0.1481", "k1  0.2038")

    def test_a_small_number_of_another_size_is_told(self):
        assert differences("error 0.0078 m/s", "error 0.0208 m/s")

    def test_two_last_digits_are_told(self):
        assert differences("k1  0.1481", "k1  0.1483")
        assert differences("m1 anything in [0.1, 0.8] kg", "m1 anything in [0.1, 0.6] kg")

    def test_another_sign_is_told(self):
        assert differences("phi -0.0161", "phi 0.0161")

    def test_another_word_is_told(self):
        assert differences("truth: air_drag", "truth: viscous_drag")

    def test_another_count_of_lines_is_told(self):
        assert differences("a\nb", "a")
