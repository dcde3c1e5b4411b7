"""MJX's constraint solver with derivatives that are finite: for `gradient_check.py --mended`.

With elliptic friction cones the line search takes the root of a squared tangential force that is
zero for a contact that does not slip. Its derivative, 1 / 0, is masked by a factor of zero
afterwards, and infinity times zero is not a number. The same happens once more where a body comes
to rest and that force underflows. Both are put right here in a copy of the source; motions stay
as they are.
"""

from pathlib import Path

LEAST = "1e-15"  # mjMINVAL: what MJX itself takes for nothing
ROOT = "t = jp.sqrt(tsqr)  # tangential force"
NORM = "mu, n, t = ctx.fri[:, 0], u[:, 0], jax.vmap(math.norm)(u[:, 1:])"


def mend() -> None:
    """Puts the mended functions in place of MJX's own, in this process.

    Raises:
      RuntimeError: this version of MJX has other lines.
    """
    from mujoco.mjx._src import solver

    text = Path(solver.__file__).read_text()
    if text.count(ROOT) != 1 or text.count(NORM) != 1:
        raise RuntimeError(f"{solver.__file__}: not the lines that are mended here")
    is_slipping = f"tsqr > {LEAST} ** 2"
    root = (
        f"tsqr = jp.where({is_slipping}, tsqr, 0.0); "
        f"t = jp.where({is_slipping}, jp.sqrt(jp.where({is_slipping}, tsqr, 1.0)), 0.0)"
    )
    slips = f"jp.where(jp.abs(u[:, 1:]) > {LEAST}, u[:, 1:], 0.0)"
    norm = f"u = jp.concatenate([u[:, :1], {slips}], axis=1); {NORM}"
    mended = text.replace(ROOT, root).replace(NORM, norm)
    exec(compile(mended, solver.__file__, "exec"), solver.__dict__)
