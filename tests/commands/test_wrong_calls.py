"""Wrong calls and broken clips: one line on stderr, exit code 2, nothing is written."""

import pytest

from galileo_jax import __main__
from galileo_jax.commands import command
from tests.clip.broken_clips import BROKEN_CLIPS, build_good_track

WRONG = [
    ("fit clip.yaml --method foo", "--method: invalid choice: 'foo'"),
    ("fit clip.yaml --engine foo", "--engine: invalid choice: 'foo'"),
    ("fit clip.yaml --pixels-per-metre -3", "-3 is not a scale"),
    ("fit clip.yaml --pixels-per-metre nan", "nan is not finite"),
    ("fit clip.yaml --pixels-per-metre x", "invalid float value: 'x'"),
    ("fit clip.yaml --method mh --max-steps 7", "7 is not a multiple of 25"),
    ("fit clip.yaml --method mh --max-steps 0", "0 is not a multiple of 25"),
    ("fit clip.yaml --seed -1", "'-1' is not a whole number, 0 or more"),
    ("fit clip.yaml --seed x", "'x' is not a whole number"),
    ("fit clip.yaml --preset foo", "--preset: invalid choice: 'foo'"),
    ("fit clip.yaml --effects nonsense", "'nonsense'"),
    ("fit clip.yaml --effects a --effects b", "--effects: given twice; names are separated by c"),
    ("fit clip.yaml --seed 1 --seed 2", "--seed: given twice"),
    ("fit clip.yaml --thing", "unrecognized arguments: --thing"),
    ("fit clip.yaml --sampler mixture", "--sampler: of --method mh, not of grad"),
    ("fit clip.yaml --method cnn --preset=thesis", "--preset: of --method mh, not of cnn"),
    ("fit clip.yaml --init cnn", "--init: of --method mh, not of grad"),
    ("fit clip.yaml --method mh --preset thesis --init cnn", "--init: not of --preset th"),
    ("fit clip.yaml --method mh --selection best", "--selection: of --preset thesis only"),
    ("fit clip.yaml --motion free --engine mjx", "--engine mjx: it moves objects in a plane"),
    ("fit clip.yaml --motion free --method cnn", "--method cnn: the network knows motion in a"),
    ("--seed x gone.mp4", "'x' is not a whole number"),
    ("--scenario ramp gone.mp4", "gone.mp4: no such file"),
    ("compare clip.yaml --effects nonsense", "'nonsense'"),
    ("compare clip.yaml --effects-from missing.py", "missing.py: no such file"),
    ("compare clip.yaml folder", "a run is compared alone"),
    ("compare folder", "a folder written by `galileo fit` expected"),
    ("compare folder --effects air_drag", "a run has its own effects"),
    ("compare missing.yaml", "missing.yaml"),
    ("compare", "the following arguments are required"),
    ("diagnose clip.yaml --add nonsense", "known: auto, none, added_mass, air_drag"),
    ("diagnose clip.yaml --effects-from missing.py", "missing.py: no such file"),
    ("diagnose clip.yaml --engine foo", "--engine: invalid choice: 'foo'"),
    ("diagnose clip.yaml --seed -1", "'-1' is not a whole number"),
    ("diagnose clip.yaml --out clip.yaml", "is a file; a folder expected"),
    ("next nowhere", "nowhere: no result.json"),
    ("next nowhere --can hight=1:2", "--can: unknown setting 'hight'"),
    ("discover nowhere", "LAB: nowhere: no such program"),
    ("discover nowhere --budget 0", "not a whole number, 1 or more"),
    ("simulate", "--out"),
    ("simulate --out clip.avi", "clip.avi does not end in .mp4"),
    ("simulate --out clip.mp4 --track-only", "clip.mp4 does not end in .csv"),
    ("simulate --out clip.mp4 --angle 95", "'95' is not a number in [1, 60]"),
    ("simulate --out clip.mp4 --m1 0", "'0' is not a number in [0.01, 100]"),
    ("simulate --out clip.mp4 --k1 nan", "'nan' is not a number"),
    ("simulate --out clip.mp4 --seed -1", "'-1' is not a whole number at least 0"),
    ("simulate --out clip.mp4 --size 640", "'640' is not a size"),
    ("simulate --out clip.mp4 --size 641x360", "even numbers"),
    ("simulate --out clip.mp4 --scenario rmap", "rmap"),
    ("simulate --out clip.mp4 --effect drag", "unknown effect 'drag'; known: added_mass"),
    ("simulate --out clip.mp4 --effect air_drag:c=1", "no parameter 'c'; known: air_drag"),
    ("simulate --out clip.mp4 --effect air_drag:air_drag=x", "is not PARAMETER=NUMBER"),
    ("simulate --out clip.mp4 --effect rolling --effect rolling", "named twice"),
    ("simulate --out clip.mp4 --effect x --effects-from none.py", "none.py"),
    ("simulate --out clip.mp4 --effects-from none.py", "--effects-from: nothing of it is"),
    ("simulate --out c.csv --track-only --camera-fault roll", "has no camera"),
    ("simulate --out /proc/none/clip.mp4", "/proc/none/clip.mp4"),
    ("simulate --out clip.mp4 --strength 1", "--strength: of what? name an effect"),
    ("simulate --out clip.mp4 --track-noise 0.001", "--track-noise: of a track only"),
    ("simulate --out clip.mp4 --floor", "--floor: not of a ramp"),
    ("simulate --out clip.mp4 --scenario flight --angle=20", "--angle: of a ramp only"),
    ("simulate --out clip.mp4 --scenario fall --hand", "--hand: of a ramp only"),
    ("simulate --out clip.mp4 --scenario incline --k2 0.1", "--k2: an incline has one"),
    ("simulate --out c.csv --track-only --size 640x360", "--size: a track (--track-only)"),
    ("simulate --out c.mp4 --motion free", "in a plane only; add --track-only"),
    ("simulate --out c.csv --track-only --z2 0.01", "--z2: of --motion free only"),
    (
        "simulate --out c.csv --track-only --motion free --z2 0.6",
        "'0.6' is not a number in [-0.5, 0.5]",
    ),
    (
        "simulate --out c.csv --track-only --motion free --solver fine",
        "--solver fine: of --motion planar only",
    ),
    ("simulate --out c.csv --track-only --motion free --scenario fall", "not of scenario fall"),
    ("simulate --out c.csv --track-only --motion free --shapes box,sphere", "nothing may roll"),
]


def refused(words, capfd) -> str:
    """The line that a call is refused with."""
    assert command.run(__main__.main, words) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.startswith("error: ")
    (line,) = err.splitlines()
    return line


@pytest.mark.parametrize(("call", "said"), WRONG)
def test_a_wrong_call_is_one_line(call, said, tmp_path, capfd, monkeypatch):
    build_good_track(tmp_path)
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    assert said in refused(call.split(), capfd)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("verb", "broken"),
    [("fit", one) for one in BROKEN_CLIPS]
    + [(verb, one) for verb in ("compare", "diagnose") for one in BROKEN_CLIPS[:3]],
    ids=lambda one: getattr(one, "id", one),
)
def test_a_broken_clip_is_one_line(verb, broken, tmp_path, capfd):
    """It names the file and the fault."""
    folder, out = tmp_path / "folder", tmp_path / "run"
    folder.mkdir()
    line = refused([verb, str(broken.build(folder)), "--out", str(out)], capfd)
    assert all(word in line for word in broken.words)
    assert not out.exists()
