"""What is personal is not said; what is not, is said as it was."""

from pathlib import Path

import pytest

from galileo_jax.results import impersonal as module
from galileo_jax.results.impersonal import impersonal

FILM = Path("/home/anna/Schule 7b/annas Rutsche.mp4")


@pytest.fixture
def hidden(monkeypatch):
    monkeypatch.setattr(module.getpass, "getuser", lambda: "anna")
    monkeypatch.setattr(module.socket, "gethostname", lambda: "annas-pc.schule.de")
    monkeypatch.setattr(module.Path, "home", lambda: Path("/home/anna"))
    return impersonal([[FILM, FILM.with_suffix(".yaml")], [Path("b.csv")]], ["Blaues Auto"])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"{FILM}: too dark", "clip1.mp4: too dark"),
        ("annas Rutsche.yaml: fps: 0", "clip1.yaml: fps: 0"),
        ("'/home/anna/Schule 7b/annas Rutsche.mp4'", "clip1.mp4"),
        ("no verdict for annas Rutsche", "no verdict for clip1"),
        ("lessons/b.csv: line 3", "clip2.csv: line 3"),
        ("b and b.csv", "b and clip2.csv"),
        ("written by anna on annas-pc", "written by USER on HOST"),
        ("Blaues Auto_x_m moves", "object1_x_m moves"),
        ("see /home/anna/more/films.txt.", "see PATH"),
        ("see /srv/lessons/anna.txt, line 2", "see PATH, line 2"),
        ("C:\\Users\\Anna\\film.mp4", "PATH"),
        ("0.3 m/s, 2 rad/s and 1/2", "0.3 m/s, 2 rad/s and 1/2"),
        ("https://example.org/a/b", "https://example.org/a/b"),
        ("the absolute best", "the absolute best"),
    ],
)
def test_texts(hidden, text, said):
    assert hidden.text(text) == said


def test_documents_with_their_keys(hidden):
    document = {"inferred": {"annas Rutsche": {"sd": 0.5}}, "clips": [str(FILM)], "n": None}
    said = {"inferred": {"clip1": {"sd": 0.5}}, "clips": ["clip1.mp4"], "n": None}
    assert hidden.value(document) == said


def test_words_of_the_program_stay_where_a_file_is_called_so():
    hidden = impersonal([[Path("ramp.mp4")], [Path("2.csv")]], ["object2"])
    said = hidden.value({"scenario": "ramp", "clips": ["ramp.mp4", "2.csv"], "k": "2 object2"})
    assert said == {"scenario": "ramp", "clips": ["clip1.mp4", "clip2.csv"], "k": "2 object2"}


def test_a_traceback_names_the_program_s_files_only():
    line = f'File "{Path(module.__file__)}", line 3'
    assert impersonal([]).text(line) == 'File "galileo_jax/results/impersonal.py", line 3'
