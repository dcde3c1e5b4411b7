import os
import subprocess
import sys
from importlib import import_module, metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import galileo_jax
from galileo_jax import __main__
from galileo_jax.commands import command
from galileo_jax.files import package_data
from galileo_jax.runtime import jax_setup
from galileo_jax.runtime.errors import InputError

ROOT = Path(__file__).resolve().parents[1]
EVERY_FILE = {
    f"{folder}/{path.name}"
    for folder in ("scenes", "configs")
    for path in (ROOT / folder).iterdir()
    if path.is_file()
}


def test_help_lists_every_verb(capsys):
    assert command.run(__main__.main, ["--help"]) == 0
    shown = capsys.readouterr().out
    assert all(f"  {verb}" in shown for verb, _ in __main__.VERBS)


def test_version(capsys):
    assert command.run(__main__.main, ["--version"]) == 0
    assert capsys.readouterr().out == f"galileo {galileo_jax.__version__}\n"


@pytest.mark.parametrize("argv", [[], ["fti"], ["os"], ["__main__"]])
def test_unknown_verb_is_one_line_and_exit_code_2(argv, capsys):
    assert command.run(__main__.main, argv) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert "known: fit, compare, diagnose, track" in err


@pytest.mark.parametrize("verb", [verb for verb, _ in __main__.VERBS])
def test_every_verb_shows_its_help(verb, capsys):
    with pytest.raises(SystemExit) as stopped:
        __main__.main([verb, "--help"])
    assert stopped.value.code == 0
    assert "usage:" in capsys.readouterr().out


@pytest.mark.parametrize("verb", ["fit", "next", "studio"])
def test_every_verb_is_a_module(verb):
    words = [sys.executable, "-m", f"galileo_jax.{verb}", "--help"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout.startswith(f"usage: galileo {verb} ")


def test_a_module_of_a_verb_is_its_function():
    assert import_module("galileo_jax.fit") is galileo_jax.fit
    with pytest.raises(ModuleNotFoundError):
        import_module("galileo_jax.fti")


@pytest.mark.parametrize("verb", ["", "fit", "compare", "diagnose", "predict"])
def test_help_imports_nothing_that_takes_long(verb):
    words = [*filter(None, [verb]), "--help"]
    code = (
        "import atexit, sys; from galileo_jax.__main__ import main; "
        f"atexit.register(lambda: print(*sys.modules, file=sys.stderr)); main({words})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    imported = done.stderr.split()
    assert "galileo_jax.commands.command" in imported
    slow = {"jax", "mujoco", "cv2", "numpy", "pydantic", "rich", "yaml"}
    assert not slow & set(imported)


def test_data_files_are_found_in_the_checkout():
    for name in EVERY_FILE:
        folder, file = name.split("/")
        find = package_data.scene_path if folder == "scenes" else package_data.config_path
        assert find(file) == ROOT / name


def test_unknown_scene_names_the_known_ones():
    with pytest.raises(InputError, match=r"no file 'rmap.xml' in scenes; known: .*ramp\.xml"):
        package_data.scene_path("rmap.xml")


def test_cache_is_in_the_users_cache_folder_and_can_be_switched_off(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv(jax_setup.SWITCH, raising=False)
    default = jax_setup.cache_folder()
    assert default is not None
    assert default.parts[-2:] == ("galileo_jax", "jax")
    monkeypatch.setenv(jax_setup.SWITCH, str(tmp_path / "elsewhere"))
    assert jax_setup.cache_folder() == tmp_path / "elsewhere"
    monkeypatch.setenv(jax_setup.SWITCH, "off")
    assert jax_setup.cache_folder() is None


@pytest.mark.parametrize(("setting", "is_filled"), [("on", True), ("off", False)])
def test_compiled_programs_are_kept_unless_switched_off(setting, is_filled, tmp_path):
    environment = {key: value for key, value in os.environ.items() if "CACHE" not in key}
    environment[jax_setup.SWITCH] = "off" if setting == "off" else str(tmp_path)
    code = (
        "import jax; from galileo_jax.runtime import jax_setup as c; c.enable_cache(); "
        "jax.config.update('jax_persistent_cache_min_compile_time_secs', 0.0); "
        "jax.jit(lambda x: x * 2 + 1)(1.0)"
    )
    subprocess.run([sys.executable, "-c", code], env=environment, check=True)
    assert any(tmp_path.iterdir()) == is_filled


def test_without_a_writable_cache_programs_are_compiled_anew(tmp_path):
    """Neither the home folder nor the cache can be made: a file stands where a folder would be."""
    (tmp_path / "file").touch()
    environment = {key: value for key, value in os.environ.items() if "CACHE" not in key}
    environment |= {"HOME": os.devnull, "XDG_CACHE_HOME": str(tmp_path / "file")}
    code = (
        "import jax; from galileo_jax.runtime import jax_setup as c; c.enable_cache(); "
        "print(jax.jit(lambda x: x * 2 + 1)(1.0))"
    )
    call = [sys.executable, "-c", code]
    done = subprocess.run(call, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "3.0\n"
    assert done.stderr == ""


def test_every_package_that_make_installs_is_pinned():
    """Else pip and uv, today and next month, install different versions."""
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pinned = {canonicalize_name(line.partition("==")[0]) for line in lines if "==" in line}
    needed, open_ones = set(), [Requirement("galileo-jax[dev]")]
    while open_ones:
        requirement = open_ones.pop()
        for line in metadata.requires(requirement.name) or ():
            below = Requirement(line)
            extras = requirement.extras or {""}
            is_needed = below.marker is None or any(
                below.marker.evaluate({"extra": extra}) for extra in extras
            )
            if is_needed and (key := (canonicalize_name(below.name), *below.extras)) not in needed:
                needed.add(key)
                open_ones.append(below)
    names = {name for name, *_ in needed}
    assert {"jax", "fsspec", "pytest"} <= names, "of the core, below it, of dev"
    assert not names - pinned - {"galileo-jax"}
