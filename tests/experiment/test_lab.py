"""A lab as a program: it may die, hang, refuse, or answer rubbish; each is one line."""

import json
import sys
import time
from pathlib import Path

import pytest

from galileo_jax.experiment.lab import LabError, Program, program_of
from galileo_jax.runtime.errors import InputError

DESCRIBED = {
    "settings": {"height_m": {"low": 0.1, "high": 0.5}, "fps": {"choices": [30, 60]}},
    "clip": {"scenario": "incline"},
}


def program(folder: Path, body: str, timeout_s: float = 20.0) -> Program:
    path = folder / "lab.py"
    path.write_text(f"import sys, os, time, json\n{body}\n")
    return Program((sys.executable, str(path)), timeout_s)


def test_it_is_asked_and_answers_by_the_protocol(tmp_path):
    lab = program(
        tmp_path,
        f"if sys.argv[1:] == ['--describe']: print(json.dumps({DESCRIBED!r}))\n"
        "else: print('height', json.load(sys.stdin)['height_m'])",
    )
    assert lab.describe().document == DESCRIBED
    assert lab.measure({"height_m": 0.25, "fps": 30}) == "height 0.25\n"


@pytest.mark.parametrize(
    ("body", "line"),
    [
        ("sys.exit(3)", "exit code 3"),
        ("raise ValueError('no ramp')", "exit code 1: ValueError: no ramp"),
        ("os.kill(os.getpid(), 9)", "ended by signal 9"),
        ("print('too high', file=sys.stderr); sys.exit(2)", "refused: too high"),
        ("sys.stdout.buffer.write(bytes([255, 254, 0]))", "the answer is not text"),
        ("while True: print('x' * 100000)", "more than 20000000 bytes"),
    ],
)
def test_what_goes_wrong_is_one_line(tmp_path, body, line):
    with pytest.raises(LabError, match=line) as caught:
        program(tmp_path, body).measure({})
    assert "\n" not in str(caught.value)


def test_one_that_hangs_is_ended_with_what_it_started(tmp_path):
    body = (
        "import subprocess\n"
        f"child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        f"open({str(tmp_path / 'pid')!r}, 'w').write(str(child.pid))\n"
        "time.sleep(600)"
    )
    with pytest.raises(LabError, match="no answer within 3 s"):
        program(tmp_path, body, timeout_s=3.0).measure({})
    pid = int((tmp_path / "pid").read_text())
    for _ in range(100):  # until the system has taken it away
        status = Path(f"/proc/{pid}/stat")
        if not status.exists() or status.read_text().split(")")[1].split()[0] == "Z":
            break
        time.sleep(0.05)
    else:
        pytest.fail("what it started lives on")


@pytest.mark.parametrize(
    ("says", "line"),
    [
        ("ready", "--describe: a JSON object expected; it printed 'ready'"),
        ("", "--describe: a JSON object expected; it printed nothing"),
        (json.dumps([]), "--describe: a JSON object expected"),
        (json.dumps({"settings": {"fps": 30}}), "--describe: clip: missing"),
        (json.dumps({"settings": {}, "clip": {}}), "--describe: settings: empty"),
        (json.dumps({"settings": {"fps": {"low": 1}}, "clip": {}}), "fps: {low, high} or"),
    ],
)
def test_one_that_does_not_describe_itself(tmp_path, says, line):
    with pytest.raises(LabError, match=line):
        program(tmp_path, f"print({says!r})").describe()


def test_which_program_is_meant(tmp_path):
    script = tmp_path / "lab.py"
    script.write_text("print(1)\n")
    assert program_of(script, 1.0).words == (sys.executable, str(script))
    script.chmod(0o755)
    assert program_of(script, 1.0).words == (str(script),)
    assert program_of(f"{sys.executable} -c 'print(2)'", 9.0).measure({}) == "2\n"
    (tmp_path / "lab.txt").write_text("")
    for wrong, line in (
        (tmp_path, "is a folder"),
        (tmp_path / "lab.txt", "cannot be run; make it executable"),
        (tmp_path / "nowhere", "no such program"),
        ("'", "No closing quotation"),
    ):
        with pytest.raises(InputError, match=line):
            program_of(wrong, 1.0)
