"""What a call does not need is not imported: start-up is most of a short fit."""

import subprocess
import sys

import pytest

# Each takes a tenth of a second and more of the processor.
OF_OTHERS = {
    *("arviz", "blackjax", "cv2", "equinox", "flax", "matplotlib", "mujoco", "optimistix"),
    *("pandas", "plotly", "rich", "scipy.interpolate", "scipy.stats", "xarray"),
}


@pytest.mark.parametrize("function", ["fit", "compare", "diagnose", "explain", "track"])
def test_importing_a_function_imports_nothing_that_it_may_not_need(function):
    code = f"import sys, galileo_jax as gx; gx.{function}; print(' '.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert OF_OTHERS & set(done.stdout.split()) == set()
