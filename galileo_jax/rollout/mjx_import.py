"""MJX, without the two lines it prints where NVIDIA Warp is not installed."""

import contextlib
import io

with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
    from mujoco import mjx

__all__ = ["mjx"]
