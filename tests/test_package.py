import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import galileo_jax
from galileo_jax import __main__
from galileo_jax.commands import command
from galileo_jax.files import package_data
from galileo_jax.runtime import compilation_cache
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


@pytest.mark.slow
def test_wheel_carries_scenes_and_configs_and_works_outside_the_checkout(tmp_path):
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path]
    subprocess.run([str(part) for part in build], cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    installed = tmp_path / "installed"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(installed)
    packaged = {
        path.relative_to(installed / "galileo_jax" / "_data").as_posix()
        for path in (installed / "galileo_jax" / "_data").rglob("*")
        if path.is_file()
    }
    assert packaged == EVERY_FILE
    code = (
        "import galileo_jax, galileo_jax.files.package_data as d; "
        "print(galileo_jax.__file__); print(d.config_path('README.md'))"
    )
    environment = os.environ | {"PYTHONPATH": str(installed)}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert all(line.startswith(str(installed)) for line in done.stdout.splitlines())


def test_cache_is_in_the_users_cache_folder_and_can_be_switched_off(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv(compilation_cache.SWITCH, raising=False)
    default = compilation_cache.cache_folder()
    assert default is not None
    assert default.parts[-2:] == ("galileo_jax", "jax")
    monkeypatch.setenv(compilation_cache.SWITCH, str(tmp_path / "elsewhere"))
    assert compilation_cache.cache_folder() == tmp_path / "elsewhere"
    monkeypatch.setenv(compilation_cache.SWITCH, "off")
    assert compilation_cache.cache_folder() is None


@pytest.mark.parametrize(("setting", "is_filled"), [("on", True), ("off", False)])
def test_compiled_programs_are_kept_unless_switched_off(setting, is_filled, tmp_path):
    environment = {key: value for key, value in os.environ.items() if "CACHE" not in key}
    environment[compilation_cache.SWITCH] = "off" if setting == "off" else str(tmp_path)
    code = (
        "import jax; from galileo_jax.runtime import compilation_cache as c; c.enable(); "
        "jax.config.update('jax_persistent_cache_min_compile_time_secs', 0.0); "
        "jax.jit(lambda x: x * 2 + 1)(1.0)"
    )
    subprocess.run([sys.executable, "-c", code], env=environment, check=True)
    assert any(tmp_path.iterdir()) == is_filled
