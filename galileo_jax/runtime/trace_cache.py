"""Stores traced programs on disk: a function is traced once per machine, not once per process.

JAX's persistent cache stores compiled programs, but each process still has to trace them in Python
(seconds for a Levenberg-Marquardt step). A function decorated with `trace_cached` writes its traced
program (`jax.export`) beside that cache; later processes load it in tens of milliseconds.

A program is found by its name, its static arguments, the shapes of the others, and a hash of all
code that it could depend on: this package's sources and the versions of the libraries below.
"""

import contextlib
import functools
import hashlib
import threading
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from galileo_jax.runtime import call_merging
from galileo_jax.runtime.atomic_write import replacing

FOLDER = "traces"  # in that of JAX's cache
LIBRARIES = ("jax", "jaxlib", "numpy", "equinox", "lineax", "optimistix")
# Compiled programs that one function holds. Each takes a hundred memory mappings, of which Linux
# gives a process 65,530; one that was dropped is read again in tens of milliseconds.
MOST_PROGRAMS = 24
# LAPACK's routines may change with jaxlib; programs of another jaxlib are not read.
LAPACK = tuple(
    jax.export.DisabledSafetyCheck.custom_call(name)
    for name in ("lapack_dormqr_ffi", "lapack_sormqr_ffi")
)


def trace_cached(num_static: int) -> Callable[[Callable[..., Any]], "TraceCached"]:
    """Decorates a function of `num_static` static arguments, then PyTrees of arrays.

    It returns arrays, or tuples of them, and is jitted as it is where its program cannot be kept:
    inside another trace, on several devices, with JAX's cache off, or where a static argument
    comes from outside this package (a user's effect, which may change unseen).
    """
    return lambda function: TraceCached(function, num_static)


class TraceCached:
    """See `trace_cached`."""

    def __init__(self, function: Callable[..., Any], num_static: int):
        functools.update_wrapper(self, function)
        self._function, self._num_static = function, num_static
        self._jitted = jax.jit(function, static_argnums=tuple(range(num_static)))
        self._programs = functools.lru_cache(MOST_PROGRAMS)(self._program)
        self._lock = threading.RLock()

    def __call__(self, *args: Any) -> Any:
        """Runs the function."""
        leaves, key = self._split(args)
        if any(isinstance(leaf, Tracer) for leaf in leaves):
            return self._jitted(*args)
        group = call_merging.current()
        if group is not None:
            return group.call(self, args)
        return self._held(key)(leaves)

    def key_of(self, args: tuple[Any, ...]) -> Any:
        """What calls have in common that can be made together."""
        return self._split(args)[1]

    def of_many(self, calls: Sequence[tuple[Any, ...]]) -> Sequence[Any]:
        """The results of several calls of the same shapes, made in one."""
        split = [self._split(args) for args in calls]
        key = split[0][1]
        if len(calls) == 1:
            return [self._held(key)(split[0][0])]
        # Few sizes: every one of them costs a compilation. The first call fills what is empty.
        many = 1 << (len(calls) - 1).bit_length()
        rows = [leaves for leaves, _ in split] + [split[0][0]] * (many - len(calls))
        found = self._held(key, many)([jnp.stack(own) for own in zip(*rows, strict=True)])
        return [jax.tree.map(lambda leaf, i=i: leaf[i], found) for i in range(len(calls))]

    def _split(self, args: tuple[Any, ...]) -> tuple[list[Any], Any]:
        """The arrays of a call, and what its program is found by."""
        static, traced = args[: self._num_static], args[self._num_static :]
        given, tree = jax.tree.flatten(traced)
        leaves = [leaf if isinstance(leaf, jax.Array) else np.asarray(leaf) for leaf in given]
        shapes = tuple((leaf.shape, leaf.dtype) for leaf in leaves)
        # The setting may be the calling thread's own; dtypes of constants follow it.
        return leaves, (static, tree, shapes, _setting("jax_enable_x64"))

    def _held(self, key: Any, many: int | None = None) -> Callable[..., Any]:
        """The program of a key; of `many` calls at once."""
        with self._lock:  # parts of a batch come on threads: one of them traces
            return self._programs((*key, many))

    def _program(self, key: Any) -> Callable[..., Any]:
        """Reads the program, or traces and writes it; maps leaves to the function's result."""
        static, tree, shapes, is_64_bit, many = key

        def flat(leaves: list[Any]) -> Any:
            return self._function(*static, *jax.tree.unflatten(tree, leaves))

        if many is not None:
            flat, shapes = jax.vmap(flat), [((many, *shape), dtype) for shape, dtype in shapes]
        folder, text = _folder(), _text(static)
        if folder is None or text is None:
            return jax.jit(flat)
        names = (self._function.__module__, self._function.__qualname__, text, str(tree), many)
        wanted = repr((*names, [(s, str(d)) for s, d in shapes], is_64_bit, _code()))
        path = (
            folder / f"{self._function.__name__}-{hashlib.sha256(wanted.encode()).hexdigest()[:32]}"
        )
        program = _read(path) or _write(path, flat, shapes)

        def call(leaves: list[Any]) -> Any:
            return program(leaves)

        call.__name__ = self._function.__name__  # for JAX's logs and profiles
        return jax.jit(call)


def _folder() -> Path | None:
    """Where programs are kept; None: nowhere."""
    cache = _setting("jax_compilation_cache_dir")
    if not cache or not _setting("jax_enable_compilation_cache") or jax.device_count() > 1:
        return None
    return Path(cache) / FOLDER


def _setting(name: str) -> Any:
    return getattr(jax.config, name)  # also what a thread has set for itself


def _read(path: Path) -> Callable[..., Any] | None:
    try:
        return jax.export.deserialize(bytearray(path.read_bytes())).call
    except Exception:  # not there, or damaged, which raises anything: it is made again
        return None


def _write(path: Path, flat: Callable[..., Any], shapes: Any) -> Callable[..., Any]:
    described = [jax.ShapeDtypeStruct(shape, dtype) for shape, dtype in shapes]
    program = jax.export.export(jax.jit(flat), disabled_checks=LAPACK)(described)
    # A cache that cannot be written is no reason to stop.
    with contextlib.suppress(OSError), replacing(path) as temporary:
        temporary.write_bytes(program.serialize())
    return program.call


def _text(static: Any) -> str | None:
    """A static argument's name, the same in every process; None where it has none."""
    if isinstance(static, tuple):
        parts = [_text(part) for part in static]
        return None if None in parts else f"({', '.join(filter(None, parts))})"
    if isinstance(static, str | int | float | bool) or static is None:
        return repr(static)
    owner = static if hasattr(static, "__qualname__") else type(static)
    is_ours = owner.__module__.split(".")[0] == __name__.split(".")[0]
    return f"{owner.__module__}.{owner.__qualname__}" if is_ours else None


@functools.cache
def _code() -> str:
    """Hash of all that a program's text may depend on, but for its arguments."""
    package = Path(__file__).parents[1]
    found = hashlib.sha256(jax.default_backend().encode())
    for name in LIBRARIES:
        found.update(f"{name} {version(name)}".encode())
    for path in sorted(package.rglob("*.py")):
        found.update(str(path.relative_to(package)).encode() + b"\0" + path.read_bytes())
    return found.hexdigest()
