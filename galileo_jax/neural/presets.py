"""The presets by name."""

from galileo_jax.neural.config import TrainConfig
from galileo_jax.neural.task import Task
from galileo_jax.runtime.errors import InputError


def make_task(config: TrainConfig) -> Task:
    """The task of a config.

    Raises:
      InputError: the preset's data need the rigid engine.
    """
    if config.preset == "thesis":
        from galileo_jax.neural.thesis_task import ThesisTask

        return ThesisTask(config)
    if config.engine not in ("auto", "rigid"):
        raise InputError(
            f"engine: {config.engine}: preset galileo has another scene in every sample, "
            "which the rigid engine alone rolls out in batches"
        )
    from galileo_jax.neural.galileo_task import GalileoTask

    return GalileoTask(config)
