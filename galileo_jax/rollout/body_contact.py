"""What a plane does to the corners of a body: impulses that only push, with Coulomb friction.

For every corner that touches, with p its impulse over the mass and u its velocity afterwards:

    0 <= p_n,  u_n >= least,  p_n (u_n - least) = 0
    |p_t| <= mu p_n, and where it slips  p_t = -mu p_n u_t / |u_t|

found by going round the corners, each time with the others' impulses given (projected
Gauss-Seidel). `least` says what the contact is: 0 where it lasts, -e u_n where it is hit.

Source: Moreau (1988), Unilateral contact and dry friction in finite freedom dynamics; Jourdan,
Alart and Jean (1998), A Gauss-Seidel like algorithm to solve frictional contact problems, Comput.
Methods Appl. Mech. Eng. 155, 31.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Bool, Float

SWEEPS = 40  # at most; a corner alone needs some ten
CONVERGED_M_S = 1e-11
TINY = 1e-30  # keeps the derivative of a length finite at 0


def after_impulses(
    velocity: Float[jax.Array, " 3"],
    spin: Float[jax.Array, " 3"],
    levers_m: Float[jax.Array, "contact 3"],
    mobility: Float[jax.Array, "3 3"],
    least_m_s: Float[jax.Array, " contact"],
    touches: Bool[jax.Array, " contact"],
    friction: jax.Array,
) -> tuple[Float[jax.Array, " 3"], Float[jax.Array, " 3"]]:
    """What the impulses at the corners add to velocity and to angular momentum over the mass.

    Args:
      velocity: of the centre before them, m/s.
      spin: before them, rad/s.
      levers_m: from the centre to the corners.
      mobility: from angular momentum over the mass to spin.
      least_m_s: least speed at which a corner may rise afterwards.
      touches: of which corners anything is asked.
      friction: its coefficient.
    """
    count = levers_m.shape[0]
    normals, across = jax.vmap(_response, (0, None))(levers_m, mobility)

    def corner(i: jax.Array, carry):
        impulses, velocity, spin = carry
        u = velocity + jnp.cross(spin, levers_m[i])
        push = jnp.maximum(impulses[i, 2] - (u[2] - least_m_s[i]) / normals[i], 0.0)
        wanted = impulses[i, :2] - u[:2] / across[i]
        size = jnp.sqrt(jnp.sum(wanted**2) + TINY)
        rub = wanted * jnp.minimum(1.0, friction * push / size)
        new = jnp.where(touches[i], jnp.append(rub, push), 0.0)
        change = new - impulses[i]
        velocity = velocity + change
        spin = spin + mobility @ jnp.cross(levers_m[i], change)
        return impulses.at[i].set(new), velocity, spin

    def sweep(carry):
        done, _, state = carry
        after = jax.lax.fori_loop(0, count, corner, state)
        changed = jnp.max(jnp.abs(after[0] - state[0]))
        return done + 1, changed, after

    def goes_on(carry) -> jax.Array:
        done, changed, _ = carry
        return (done < SWEEPS) & (changed > CONVERGED_M_S)

    asked = jnp.where(jnp.any(touches), 1.0, 0.0)  # in flight there is nothing to sweep
    start = (jnp.zeros_like(levers_m), velocity, spin)
    _, _, (impulses, _, _) = jax.lax.while_loop(goes_on, sweep, (0, asked, start))
    return jnp.sum(impulses, axis=0), jnp.sum(jnp.cross(levers_m, impulses), axis=0)


def _response(lever: jax.Array, mobility: jax.Array) -> tuple[jax.Array, jax.Array]:
    """How fast a unit impulse makes a corner: upwards, and the most along the plane."""
    x, y, z = lever
    skew = jnp.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = jnp.eye(3) - skew @ mobility @ skew
    a, b, c = matrix[0, 0], matrix[1, 1], matrix[0, 1]
    return matrix[2, 2], 0.5 * (a + b) + jnp.sqrt(0.25 * (a - b) ** 2 + c**2 + TINY)
