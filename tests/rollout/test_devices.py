"""A batch over two devices of one process gives what one device gives."""

import os
import subprocess
import sys

import numpy as np
import pytest

SCRIPT = """
import sys
import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)
from galileo_jax.runtime import jax_setup
from galileo_jax.model.parameters import PriorTable
from galileo_jax.rollout.engine_path import EnginePath
from tests.ramp_model import HIT, make_model

jax_setup.enable_cache()
engine = EnginePath(make_model(HIT, 1.2))
z = np.random.default_rng(0).standard_normal((20, len(engine.model.parameters)))
theta = np.asarray(PriorTable.of(engine.model.parameters).forward(jnp.asarray(z)))
position, _ = engine.traceable(jnp.asarray(theta[:16]))
print(len(position.sharding.device_set))
np.save(sys.argv[1], np.stack(engine.simulate(theta)))
"""


@pytest.mark.slow
def test_two_devices_give_what_one_gives(tmp_path):
    found, used = [], []
    for count in (1, 2):
        flags = f"--xla_force_host_platform_device_count={count}"
        path = tmp_path / f"{count}.npy"
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, str(path)],
            env=os.environ | {"XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        used.append(int(done.stdout))
        found.append(np.load(path))
    assert used == [1, 2]
    assert found[0].shape[:2] == (2, 20)
    np.testing.assert_array_equal(found[1], found[0])
