"""Parameters: a name, a unit, a prior; and the space in which they are searched.

Inference works in `z`, where every prior is a standard normal: `theta = forward(z)` with
`z ~ N(0, 1)`. Bounds are then kept by construction, the log-prior is `-z.z / 2` for every
parameter, and a posterior standard deviation in `z` says directly how much of the prior's
ignorance the data have taken away.
"""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any, ClassVar, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import ndtr, ndtri
from scipy import special

Role = Literal["main", "nuisance", "effect", "latent", "given"]
STRETCHED_TO = 6.0  # z, by a long tail


Numbers = jax.Array | np.ndarray | np.floating


@dataclass(frozen=True)
class Prior:
    """A distribution of a number, given by one or two others, as a map from the standard normal."""

    kind: ClassVar[int]  # its row in a `PriorTable`

    @staticmethod
    def at(z: Any, a: Any, b: Any, xp: Any) -> Any:
        """The parameter at `z ~ N(0, 1)`: monotonic and differentiable; `xp` is NumPy or JAX."""
        raise NotImplementedError

    def forward(self, z: Numbers) -> Any:
        """The parameter at `z ~ N(0, 1)`, by JAX."""
        _, a, b = self.encode()
        return self.at(z, a, b, jnp)

    def inverse(self, theta: Any) -> Any:
        """The `z` of the parameter, an array of NumPy or JAX."""
        raise NotImplementedError

    def encode(self) -> tuple[int, float, float]:
        """Kind and two numbers, as `PriorTable` holds them."""
        a, b, *_ = *astuple(self), 0.0
        return self.kind, a, b


@dataclass(frozen=True)
class Normal(Prior):
    """A normal prior."""

    mean: float
    sd: float
    kind = 0

    @staticmethod
    def at(z: Any, a: Any, b: Any, xp: Any) -> Any:
        """`mean + sd z`."""
        return a + b * z

    def inverse(self, theta: Any) -> Any:
        """`(theta - mean) / sd`."""
        return (theta - self.mean) / self.sd


@dataclass(frozen=True)
class LogNormal(Prior):
    """A positive number known up to a factor of about `exp(sd)`."""

    median: float
    sd: float
    kind = 1

    @staticmethod
    def at(z: Any, a: Any, b: Any, xp: Any) -> Any:
        """`median exp(sd z)`."""
        # A wild proposal's may be infinite: its rollout fails, and it is refused.
        with np.errstate(over="ignore"):
            return a * xp.exp(b * z)

    def inverse(self, theta: Any) -> Any:
        """`log(theta / median) / sd`; NaN below 0."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return theta.__array_namespace__().log(theta / self.median) / self.sd


@dataclass(frozen=True)
class Uniform(Prior):
    """A uniform prior on `[low, high]`."""

    low: float
    high: float
    kind = 2

    @staticmethod
    def at(z: Any, a: Any, b: Any, xp: Any) -> Any:
        """`low + (high - low) Phi(z)`."""
        return a + (b - a) * _ndtr(z, xp)

    def inverse(self, theta: Any) -> Any:
        """`Phi^-1((theta - low) / (high - low))`, finite at the ends."""
        share = (theta - self.low) / (self.high - self.low)
        return _ndtri(share.clip(1e-9, 1 - 1e-9))


@dataclass(frozen=True)
class HalfNormal(Prior):
    """A non-negative number, most likely 0, of the size of `sd` at most."""

    sd: float
    kind = 3

    @staticmethod
    def at(z: Any, a: Any, b: Any, xp: Any) -> Any:
        """`sd Phi^-1((1 + Phi(z)) / 2)`."""
        return a * _ndtri(0.5 + 0.5 * xp.clip(_ndtr(z, xp), 0.0, 1 - 1e-12))

    def inverse(self, theta: Any) -> Any:
        """The `z` of `theta`, finite at 0."""
        xp = theta.__array_namespace__()
        return _ndtri((2 * _ndtr(theta / self.sd, xp) - 1).clip(1e-9, 1 - 1e-9))


@dataclass(frozen=True)
class LongTailed(Prior):
    """A positive number that is known up to a factor of about `exp(sd)`, unless all is otherwise.

    Johnson's S_U of the logarithm: near the median as good as normal, of 2 standard deviations
    3.6, of 4 27. What was declared may be wrong, and then data must be able to say so.

    Source: Johnson (1949), Biometrika 36, 149, doi:10.1093/biomet/36.1-2.149.
    """

    median: float
    sd: float
    kind = 4

    @staticmethod
    def at(z: Any, a: Any, b: Any, xp: Any) -> Any:
        """`median exp(sd sinh(z))`."""
        return LogNormal.at(_stretched(z), a, b, xp)

    def inverse(self, theta: Any) -> Any:
        """`arsinh(log(theta / median) / sd)`; NaN below 0."""
        xp = theta.__array_namespace__()
        with np.errstate(divide="ignore", invalid="ignore"):
            far = xp.log(theta / self.median) / self.sd
            near = xp.clip(far, -math.sinh(STRETCHED_TO), math.sinh(STRETCHED_TO))
            return xp.asinh(near) + (far - near)


KINDS: tuple[type[Prior], ...] = (Normal, LogNormal, Uniform, HalfNormal, LongTailed)


@dataclass(frozen=True)
class Parameter:
    """One unknown of the model."""

    name: str  # as it stands in result.json
    unit: str  # SI; "1" for a pure number
    prior: Prior  # what is known before the data
    absent: float  # the value at which what the parameter stands for is not there
    # "main" (what the user asks for), "nuisance" or "effect"; "latent": of a function that is told
    # as a whole; "given": a number that compiled code needs and nobody infers
    role: Role = "main"
    # A coarse step in `z` for the first finite differences, before the scale of the posterior is
    # known; None: no rollout depends on it (clock, camera)
    step: float | None = 0.02
    per_clip: bool = False  # whether each clip of a series has its own (nuisances always do)

    @property
    def is_positive(self) -> bool:
        """Whether it cannot be negative and is of no known size: 0 is at the end of its prior."""
        return isinstance(self.prior, HalfNormal | LogNormal | LongTailed) and self.absent == 0.0


def joined(one: Parameter, other: Parameter) -> Parameter:
    """`one`, with room for what `other` allows: two scenes may show different parts of a way."""
    a, b = one.prior, other.prior
    if isinstance(a, Uniform) and isinstance(b, Uniform):
        return replace(one, prior=Uniform(min(a.low, b.low), max(a.high, b.high)))
    return one


class PriorTable(NamedTuple):
    """Priors as numbers: one compiled program then serves clips whose priors differ."""

    kind: np.ndarray  # `[parameter]`, places in `KINDS`
    a: np.ndarray  # `[parameter]`, the prior's numbers in the order of its fields
    b: np.ndarray

    @classmethod
    def of(cls, parameters: Sequence[Parameter]) -> "PriorTable":
        """The table of these parameters' priors."""
        kind, a, b = zip(*(parameter.prior.encode() for parameter in parameters), strict=True)
        return cls(np.array(kind), np.array(a, float), np.array(b, float))

    def forward(self, z: Numbers) -> Any:
        """As the function `forward`: `z` `[..., parameter]` to the parameters' units."""
        theta = jnp.zeros_like(z)
        for kind, prior in enumerate(KINDS):
            chosen = self.kind == kind
            # Of a kind that is not chosen nothing may overflow: its derivative would be NaN.
            found = prior.at(jnp.where(chosen, z, 0.0), self.a, self.b, jnp)
            theta = jnp.where(chosen, found, theta)
        return theta

    def in_units(self, z: np.ndarray) -> np.ndarray:
        """What `forward` gives, in NumPy: no program to load, no call to dispatch."""
        z = np.asarray(z, float)
        theta = np.empty_like(z)
        for kind, prior in enumerate(KINDS):
            chosen = self.kind == kind
            if chosen.any():
                theta[..., chosen] = prior.at(z[..., chosen], self.a[chosen], self.b[chosen], np)
        return theta


def in_units(prior: Prior, z: Any) -> np.ndarray:
    """`prior.forward(z)` in NumPy, of z of any shape."""
    _, a, b = prior.encode()
    return np.asarray(prior.at(np.asarray(z, float), a, b, np))


def _stretched(z: Any) -> Any:
    """The hyperbolic sine; beyond all that is ever likely as slow as z, lest it overflows."""
    xp = z.__array_namespace__()
    near = xp.clip(z, -STRETCHED_TO, STRETCHED_TO)
    return xp.sinh(near) + (z - near)


def inverse(parameters: Sequence[Parameter], theta: Any) -> np.ndarray:
    """Maps `theta` `[..., parameter]` to `z`; in NumPy, where nothing is compiled."""
    columns = np.moveaxis(np.asarray(theta, float), -1, 0)
    found = [p.prior.inverse(column) for p, column in zip(parameters, columns, strict=True)]
    return np.stack(found, axis=-1)


def _ndtr(value: Any, xp: Any) -> Any:
    return ndtr(value) if xp is jnp else special.ndtr(value)


def _ndtri(share: Any) -> Any:
    return ndtri(share) if isinstance(share, jax.Array) else special.ndtri(share)


def absent(parameters: Sequence[Parameter]) -> np.ndarray:
    """The vector `[parameter]` at which nothing but the scene is there."""
    return np.array([p.absent for p in parameters])


def prior_deviations(parameters: Sequence[Parameter], z: np.ndarray) -> np.ndarray:
    """How many prior standard deviations nuisances are from what is expected of them.

    0 of all that are no nuisances, and of one that is most likely 0 and smaller than its prior's
    median.
    """
    is_nuisance = np.array([p.role == "nuisance" for p in parameters])
    is_one_sided = np.array([isinstance(p.prior, HalfNormal) for p in parameters])
    return np.where(is_nuisance, np.where(is_one_sided, np.maximum(z, 0.0), z), 0.0)
