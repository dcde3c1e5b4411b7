"""What a cell does with its clips: a method and its options, typed and checked."""

from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from galileo_jax.clip.fields import wrong
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.registry import entry_names

Whole = Annotated[int, Field(strict=True, ge=0)]
Count = Annotated[int, Field(strict=True, ge=1)]
Name = Annotated[str, Field(strict=True)]
NoiseModel = Literal["camera", "bodies", "tracker"]


def _known_sampler(name: str) -> str:
    known = entry_names("galileo_jax.inference.samplers.library")
    if name not in known:
        raise wrong(f"unknown value; known: {', '.join(known)}")
    return name


class _Settings(BaseModel):
    """Common to all methods; an option means what `fit` or `diagnose` means by its name."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    seed: Whole = 0
    engine: Literal["auto", "rigid", "c", "mjx"] = "auto"


class Grad(_Settings):
    """The gradient fit."""

    method: Literal["grad"] = "grad"
    effects: tuple[Name, ...] = ()
    noise: NoiseModel | None = None


class Mh(_Settings):
    """Metropolis-Hastings, started from the gradient fit."""

    method: Literal["mh"]
    effects: tuple[Name, ...] = ()
    noise: NoiseModel | None = None
    sampler: Annotated[Name, AfterValidator(_known_sampler)] = "mixture"
    chains: Annotated[int, Field(strict=True, ge=2)] = 8
    max_steps: Annotated[int, Field(strict=True, ge=25, multiple_of=25)] = 4000


class Cnn(_Settings):
    """The trained network."""

    method: Literal["cnn"]


class Thesis(_Settings):
    """The thesis's sampler on our rollouts; chains of 75 steps."""

    method: Literal["thesis"]
    similarity: Literal["earth_mover", "root_mean", "thesis_gaussian"] = "thesis_gaussian"
    acceptance: Literal["coin", "metropolis"] = "coin"
    selection: Literal["best", "least_variance"] = "best"
    chains: Count = 16


class Diagnose(_Settings):
    """Which effect is missing?"""

    method: Literal["diagnose"]
    add: Name = "auto"


class Explain(_Settings):
    """What `galileo FILE` does: a fit, a test of the model, and a diagnosis where it fails."""

    method: Literal["explain"]


Settings = Grad | Mh | Cnn | Thesis | Diagnose | Explain
KINDS: dict[str, type[Settings]] = {
    get_args(kind.model_fields["method"].annotation)[0]: kind for kind in get_args(Settings)
}
Model = TypeVar("Model", bound=BaseModel)


def checked(kind: type[Model], content: dict[str, Any], known: str = "") -> Model:
    """A model of `content`; `known` is what there is in place of an unknown key.

    Raises:
      InputError: a value is wrong; the message begins with its key, with dots.
    """
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        parts = (p for p in first["loc"] if isinstance(p, int) or p.isidentifier())
        is_unknown = first["type"] == "extra_forbidden"
        said = f"unknown; known: {known}" if is_unknown else first["msg"]
        key = ".".join(map(str, parts))
        raise InputError(f"{key}: {said}; got {first['input']!r}") from None


def make_settings(content: dict[str, Any]) -> Settings:
    """The settings of a cell.

    Raises:
      InputError: an unknown method, an option that the method does not have, or a wrong value;
        the message begins with the key.
    """
    content = {"method": "grad"} | content
    method = content["method"]
    if not isinstance(method, str) or method not in KINDS:
        raise InputError(f"method: unknown value {method!r}; known: {', '.join(KINDS)}")
    known = KINDS[method].model_fields
    for key in content:
        if key not in known:
            having = [name for name, kind in KINDS.items() if key in kind.model_fields]
            whose = f"; an option of {', '.join(having)}" if having else ""
            raise InputError(
                f"{key}: method {method} has no such option{whose}; "
                f"it has: {', '.join(name for name in known if name != 'method')}"
            )
    return checked(KINDS[method], content)
