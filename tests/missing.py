"""What a test needs and this machine may not have.

A browser and the extras `dev` and `distributed` are installed by .ci/run: without them a test is
skipped on a stranger's machine and fails in CI. ../shared/data cannot be installed: without it a
test is skipped everywhere.
"""

import importlib
import os
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import NoReturn

import pytest

CI = "CI"
SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def is_ci(environ: Mapping[str, str]) -> bool:
    """Whether `CI` is set: to anything but nothing, "0" and "false"."""
    return environ.get(CI, "").lower() not in ("", "0", "false")


def is_missing(what: str) -> NoReturn:
    """Ends a test that needs what a set-up installs: failed in CI, skipped elsewhere."""
    if is_ci(os.environ):
        pytest.fail(f"{what}, and this is CI ({CI} is set)", pytrace=False)
    pytest.skip(what)


def find_shared_data() -> Path:
    """The development data beside the checkout; a test that needs them is skipped without."""
    if not SHARED_DATA.is_dir():
        pytest.skip("no ../shared/data beside this checkout")
    return SHARED_DATA


def needed_module(name: str, extra: str = "dev") -> ModuleType:
    """Imports a module of an extra that .ci/run installs."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        is_missing(f"no {name.partition('.')[0]} here (pip install -e '.[{extra}]')")
