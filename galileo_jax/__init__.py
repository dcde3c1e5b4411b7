"""From a video of sliding objects to their masses and friction coefficients.

    import galileo_jax as gx

    said = gx.explain("clip.mp4").paragraph         # all of what follows, in words
    track = gx.track("clip.mp4")                    # where the objects are, in metres
    fit = gx.fit(track)                             # masses and frictions, with intervals
    check = gx.compare(fit)                         # is the model adequate, and where does it fail?
    found = gx.diagnose(track)                      # which effect is missing?
    better = gx.fit(track, effects=found.verdict.effects)
    ahead = gx.predict(better, seconds=2.0)

The names below are public, and nothing else in the package is. None of the functions prints, and
none depends on the JAX precision of its caller. Errors that a user can mend are `InputError`.
Everything is imported when it is first used.
"""
# ruff: noqa: F401

import ast
import sys
from importlib import import_module
from importlib.abc import InspectLoader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from galileo_jax.api.catalogue import effects, scenarios
    from galileo_jax.api.clips import load
    from galileo_jax.api.compare import Comparison, compare
    from galileo_jax.api.diagnose import Diagnosis, diagnose
    from galileo_jax.api.discover import Discovery, discover
    from galileo_jax.api.explain import Explanation, explain
    from galileo_jax.api.export import export
    from galileo_jax.api.fit import fit
    from galileo_jax.api.fit_result import Fit, load_run
    from galileo_jax.api.fit_tosses import TossFit, fit_tosses
    from galileo_jax.api.label import label
    from galileo_jax.api.look import Look, look
    from galileo_jax.api.motion import Motion
    from galileo_jax.api.next_experiment import NextExperiment, next_experiment
    from galileo_jax.api.predict import Prediction, predict
    from galileo_jax.api.propose import Proposal, propose
    from galileo_jax.api.simulate import Simulated, simulate
    from galileo_jax.api.track import Track, track
    from galileo_jax.api.train import train
    from galileo_jax.clip.schema import Clip
    from galileo_jax.model.effects.effect import (
        Array,
        Effect,
        Force,
        Friction,
        State,
        Surroundings,
        Theta,
    )
    from galileo_jax.model.effects.registry import register as register_effect
    from galileo_jax.model.parameters import HalfNormal, LogNormal, Normal, Parameter, Uniform
    from galileo_jax.runtime.errors import InputError
    from galileo_jax.runtime.progress import Cancelled
    from galileo_jax.sweeping.sweep import Sweep, sweep


def _places() -> dict[str, tuple[str, str]]:
    """Module of each public name, and its name there: the imports above, read and not made."""
    tree = ast.parse(Path(__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    imports = (node for node in block.body if isinstance(node, ast.ImportFrom))
    return {
        one.asname or one.name: (str(node.module), one.name)
        for node in imports
        for one in node.names
    }


PLACES = _places()

__all__ = ["__version__", *PLACES]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    """Imports a public name when it is first asked for."""
    if name not in PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, own_name = PLACES[name]
    value = globals()[name] = getattr(import_module(module), own_name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


class _Verbs(MetaPathFinder, InspectLoader):
    """`python -m galileo_jax.VERB`: a module for each command, where no other has its name.

    Imported, it is the public function of that name, which must not be hidden by a module.
    """

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> ModuleSpec | None:
        package, _, verb = fullname.rpartition(".")
        command = Path(__file__).parent / f"commands/{verb}.py"
        is_verb = package == __name__ and command.is_file()
        return ModuleSpec(fullname, self, origin=str(command)) if is_verb else None

    def get_source(self, fullname: str) -> str:
        verb = fullname.rpartition(".")[2]
        run = f"from galileo_jax.__main__ import cli; cli({verb!r})"
        return f"if __name__ == '__main__': {run}"  # and not in a worker, which imports it

    def exec_module(self, module: ModuleType) -> None:
        sys.modules[module.__name__] = __getattr__(module.__name__.rpartition(".")[2])


sys.meta_path.append(_Verbs())
