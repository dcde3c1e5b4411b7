"""How a network is trained: one YAML file, kept inside every checkpoint."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.neural.task import PRESETS
from galileo_jax.runtime.errors import InputError

Share = Annotated[float, Field(gt=0, lt=1)]
Count = Annotated[int, Field(gt=0)]


class TrainConfig(BaseModel):
    """Everything that decides what is learned."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    # Which network, data and loss
    preset: Annotated[str, AfterValidator(lambda name: PRESETS[name] and name)]
    seed: Annotated[int, Field(ge=0)] = 0  # of data and weights
    # Simulated experiments; the last `validation_share` of them validate
    samples: Annotated[int, Field(ge=100)]
    validation_share: Share = 0.1
    batch: Count  # samples a step
    learning_rate: Annotated[float, Field(gt=0)]  # Adam's, to begin with
    # "plateau": the rate is multiplied by `cut` after `patience` epochs without a better validation
    # loss, `cuts` times, and the next plateau is the end; "cosine": it stays for a third of
    # `max_epochs`, and falls to zero along a cosine from there on
    schedule: Literal["plateau", "cosine"] = "plateau"
    # The next three are of schedule "plateau"
    cut: Share = 0.1
    patience: Count = 10
    cuts: Annotated[int, Field(ge=0)] = 3
    max_epochs: Count  # the end at the latest
    engine: Literal["auto", "rigid", "c", "mjx"] = "auto"  # that makes the data
    frames: Annotated[int, Field(ge=25, le=400)] = 60  # displacements in a profile (thesis)


def load_config(path: Path, **overrides: object) -> TrainConfig:
    """Reads a config; `overrides` that are not None replace its values.

    Raises:
      InputError: unreadable, or a key is unknown, missing or out of range.
    """
    given = {key: value for key, value in overrides.items() if value is not None}
    try:
        return TrainConfig.model_validate(read_mapping(path) | given)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise InputError(f"{path}: {key}: {first['msg']}; got {first['input']!r}") from error
