"""A posterior: draws with their names, where they came from and whether to trust them."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from galileo_jax.inference.convergence import arviz, convergence
from galileo_jax.runtime.atomic_write import replacing
from galileo_jax.runtime.errors import InputError

if TYPE_CHECKING:
    from arviz import InferenceData


ESS = "ess"  # of the provenance: what weighed draws are worth


class Status(StrEnum):
    """How a sampling ended; the value is the sentence for the user."""

    CONVERGED = "R-hat and effective sample size reached their targets"
    STEP_LIMIT = (
        "the chains did not converge within the step limit; allow more steps or fix parameters"
    )
    STUCK_CHAIN = "a chain never moved; check its start and the scale of the proposals"
    FIXED_LENGTH = "ran its fixed number of steps; convergence was not tested"


@dataclass(frozen=True)
class Posterior:
    """Draws of named parameters."""

    names: tuple[str, ...]  # of the parameters
    draws: np.ndarray  # `[chain, draw, parameter]`
    log_density: np.ndarray  # `[chain, draw]`, unnormalized, in the space that was sampled
    status: Status  # how the sampling ended
    # numbers about the sampling (steps, evaluations, acceptance rate)
    stats: Mapping[str, float] = field(default_factory=dict)
    # settings, seed and versions; anything that JSON can hold
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.draws.ndim != 3 or self.draws.shape[2] != len(self.names):
            raise ValueError(f"draws {self.draws.shape} are not [chain, draw, {len(self.names)}]")
        if self.log_density.shape != self.draws.shape[:2]:
            raise ValueError(
                f"log_density {self.log_density.shape} does not match draws {self.draws.shape}"
            )

    @property
    def is_converged(self) -> bool:
        """True where R-hat and effective sample size reached their targets."""
        return self.status is Status.CONVERGED

    def __getitem__(self, name: str) -> np.ndarray:
        """The draws `[chain, draw]` of one parameter."""
        if name not in self.names:
            raise ValueError(f"unknown parameter {name!r}; known: {', '.join(self.names)}")
        return self.draws[:, :, self.names.index(name)]

    def flat(self) -> np.ndarray:
        """All draws `[chain * draw, parameter]`, chain after chain."""
        return self.draws.reshape(-1, len(self.names))

    def mapped(
        self, function: Callable[[np.ndarray], np.ndarray], names: tuple[str, ...]
    ) -> "Posterior":
        """The posterior of `function` of the parameters (such as z to theta).

        `function`: `[..., parameter]` to `[..., len(names)]`.
        """
        return replace(self, draws=np.asarray(function(self.draws)), names=tuple(names))

    def chosen(self, columns: np.ndarray, names: tuple[str, ...]) -> "Posterior":
        """The marginal of some parameters, under other names."""
        return replace(self, draws=self.draws[..., columns], names=tuple(names))

    def mixed_with(self, other: "Posterior", share: float) -> "Posterior":
        """Draws of two posteriors of the same parameters, one of which is right, in any order.

        `other`: as many draws. `share`: the probability of the other.
        """
        count = self.draws.shape[1]
        num_other = round(share * count)
        order = np.random.default_rng(0).permutation(count)
        both = [
            np.concatenate([own[:, num_other:], more[:, :num_other]], axis=1)[:, order]
            for own, more in ((self.draws, other.draws), (self.log_density, other.log_density))
        ]
        worth = [one.provenance.get(ESS, count) for one in (self, other)]
        notes = {**self.provenance, ESS: (1 - share) * worth[0] + share * worth[1]}
        return replace(self, draws=both[0], log_density=both[1], provenance=notes)

    def worth(self, values: np.ndarray) -> float:
        """How many independent draws the posterior's are worth for a function of them.

        `values`: `[chain * draw]`, the function at each draw, chain after chain.
        """
        if ESS in self.provenance:
            return float(self.provenance[ESS])
        if "sampler" not in self.provenance:  # drawn one by one, not by a chain
            return float(len(values))
        found = convergence(values.reshape(self.draws.shape[:2]))
        worth = float(np.fmin(found.ess_bulk, found.ess_tail))
        return worth if np.isfinite(worth) else 1.0

    def _notes(self) -> dict[str, Any]:
        """What is not draws, as JSON can hold it."""
        return {
            "names": list(self.names),
            "status": self.status.name,
            "stats": dict(self.stats),
            "provenance": dict(self.provenance),
        }

    def to_inference_data(self) -> "InferenceData":
        """As ArviZ's InferenceData: groups `posterior` and `sample_stats` (`lp`)."""
        return arviz().from_dict(
            posterior={name: self[name] for name in self.names},
            sample_stats={"lp": self.log_density},
            posterior_attrs={"galileo_jax": json.dumps(self._notes())},
        )

    def to_netcdf(self, path: Path) -> None:
        """Writes what `to_inference_data().to_netcdf` writes, in one step.

        Through h5netcdf alone: importing ArviZ costs more than most fits, and xarray half a second.
        """
        import h5netcdf

        axes = dict(zip(("chain", "draw"), self.draws.shape, strict=False))
        groups = {
            "posterior": {name: self[name] for name in self.names},
            "sample_stats": {"lp": self.log_density},
        }
        with replacing(path) as temporary, h5netcdf.File(temporary, "w") as file:
            for group_name, variables in groups.items():
                group = file.create_group(group_name)
                group.dimensions = axes
                for name, size in axes.items():
                    group.create_variable(name, (name,), data=np.arange(size))
                for name, values in variables.items():
                    group.create_variable(name, tuple(axes), data=np.asarray(values))
            file["posterior"].attrs["galileo_jax"] = json.dumps(self._notes())

    @classmethod
    def from_netcdf(cls, path: Path) -> "Posterior":
        """Reads what `to_netcdf` wrote.

        Raises:
          InputError: missing, unreadable, or of another origin; names the file.
        """
        if not Path(path).is_file():
            raise InputError(f"{path}: no such file")
        try:
            return cls._read(Path(path))
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
        except (OSError, ValueError, KeyError) as error:
            raise InputError(f"{path}: not a netCDF file of draws ({error})") from error

    @classmethod
    def _read(cls, path: Path) -> "Posterior":
        import h5netcdf

        with h5netcdf.File(path, "r") as file:
            groups = set(file.groups)
            if not {"posterior", "sample_stats"} <= groups:
                found = ", ".join(sorted(groups)) or "none"
                raise InputError(f"no groups posterior and sample_stats, but {found}")
            posterior = file["posterior"]
            if "galileo_jax" not in posterior.attrs:
                raise InputError("the posterior group has no attribute galileo_jax: not ours")
            notes = json.loads(str(posterior.attrs["galileo_jax"]))
            names = tuple(notes["names"])
            return cls(
                names=names,
                draws=np.stack([np.asarray(posterior[name][...]) for name in names], axis=-1),
                log_density=np.asarray(file["sample_stats"]["lp"][...]),
                status=Status[notes["status"]],
                stats=notes["stats"],
                provenance=notes["provenance"],
            )
