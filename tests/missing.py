"""What a test needs and this machine may not have: skipped on a stranger's, a failure in CI."""

import importlib
import os
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import NoReturn

import pytest

CI = "CI"
NO_SHARED_DATA = "GALILEO_JAX_NO_SHARED_DATA"
SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def is_required(environ: Mapping[str, str], waiver: str | None = None) -> bool:
    """Whether what is missing is a failure: in CI, unless the waiver's variable says otherwise.

    Args:
      environ: environment variables; set is what is neither empty, "0" nor "false".
      waiver: the variable with which CI says that it goes without.
    """
    return _is_set(environ, CI) and not (waiver and _is_set(environ, waiver))


def is_missing(what: str, waiver: str | None = None) -> NoReturn:
    """Ends the test: failed where what it needs is required, skipped elsewhere."""
    if is_required(os.environ, waiver):
        excuse = f"; {waiver}=1 goes without" if waiver else ""
        pytest.fail(f"{what}, and this is CI ({CI} is set){excuse}", pytrace=False)
    pytest.skip(what)


def find_shared_data() -> Path:
    """The development data beside the checkout."""
    if not SHARED_DATA.is_dir():
        is_missing("no ../shared/data beside this checkout", NO_SHARED_DATA)
    return SHARED_DATA


def needed_module(name: str) -> ModuleType:
    """Imports a module of the extra `dev`."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        is_missing(f"no {name.partition('.')[0]} here (pip install -e '.[dev]')")


def _is_set(environ: Mapping[str, str], name: str) -> bool:
    return environ.get(name, "").lower() not in ("", "0", "false")
