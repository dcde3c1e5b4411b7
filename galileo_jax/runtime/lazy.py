"""Libraries that take long to import, each imported when something of it is first used."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go
    import xarray as xr
else:

    class _Lazy:
        """A module that is not there before it is asked for something."""

        def __init__(self, name: str):
            self._name = name

        def __getattr__(self, name: str) -> Any:
            return getattr(import_module(self._name), name)

    pd, go, xr = _Lazy("pandas"), _Lazy("plotly.graph_objects"), _Lazy("xarray")

__all__ = ["go", "pd", "xr"]
