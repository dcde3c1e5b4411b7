"""The wheel: all files are in it, and its programs run far from the checkout."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import galileo_jax

ROOT = Path(__file__).resolve().parents[1]
INSTALL = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (made,) = folder.glob("*.whl")
    return made


def test_every_file_is_in_the_wheel(wheel):
    """Code, pages, scenes, configs and the network's weights."""
    of_package = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "galileo_jax").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    of_data = {
        f"galileo_jax/_data/{folder}/{path.name}"
        for folder in ("scenes", "configs")
        for path in (ROOT / folder).iterdir()
        if path.is_file()
    }
    with zipfile.ZipFile(wheel) as archive:
        packaged = {name for name in archive.namelist() if name.startswith("galileo_jax/")}
    assert packaged == of_package | of_data


@pytest.mark.slow
def test_its_programs_run_outside_the_checkout(wheel, tmp_path):
    """Installed beside the packages that are here; in a folder with blanks and umlauts."""
    installed = tmp_path / "installed"
    subprocess.run([*INSTALL, "--target", str(installed), str(wheel)], check=True)
    work = tmp_path / "Über Reibung"
    work.mkdir()
    program = [sys.executable, str(installed / "bin" / "galileo")]

    def said(*call: str) -> str:
        environment = os.environ | {"PYTHONPATH": str(installed)}
        done = subprocess.run(call, cwd=work, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    code = "import galileo_jax.files.package_data as d; print(d.config_path('README.md'))"
    assert said(sys.executable, "-c", code).startswith(str(installed))
    assert said(*program, "--version") == f"galileo {galileo_jax.__version__}\n"
    assert "\nspring " in said(*program, "scenarios")
    assert "ä 1.csv" in said(
        *program, "simulate", "--seed", "7", "--track-only", "--out", "ä 1.csv"
    )
    assert "friction coefficient" in said(*program, "ä 1.csv")
    assert (work / "runs" / "ä 1" / "report.html").is_file()
    fitted = said(sys.executable, "-m", "galileo_jax.fit", "ä 1.csv", "--method", "grad")
    assert "mass_ratio" in fitted
    assert "mass_ratio" in said(*program, "fit", "ä 1.csv", "--method", "cnn", "--out", "Netz")
