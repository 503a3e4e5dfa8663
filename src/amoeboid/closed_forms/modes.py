"""Modes l of the homogeneous sphere: tension, drive, flow and shape, with friction and bending.

Notation is that of `amoeboid.closed_forms.linear`, whose results follow from these (docs/theory.md,
docs/forces.md). Results have the shape that all arguments broadcast to.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.closed_forms.points import AnyPoints, Points, finite_result, points
from amoeboid.validation import InvalidInput

SURROUNDINGS = ("gamma_t", "gamma_n", "gamma_c", "kappa")
"""Parameters of friction and bending, which the closed forms beyond third order do not know."""


@finite_result
def base_tension(p: Points) -> Array:
    """Membrane tension zeta_0 of the homogeneous sphere [M/T^2]; main text, force balance.

    Half the pressure times the radius, plus the treadmilling, less the isotropic stress. Friction
    of the cortex, which flows inwards with v_p, acts as a pressure gamma_c v_p.
    """
    v_p = p.v_p(p.c0)
    held = p.delta_P + p.gamma_c * v_p
    return held * p.R0 / 2 + 2 * v_p * (p.eta_s + p.eta_b) / p.R0 - p.tau(p.c0)


def stress_derivatives(p: Points, order: int) -> tuple[Array, ...]:
    """K_k, the k-th derivative of -R0 tau/(2S) at c0, to `order` [L/T over powers of N/L^2]."""
    twice = 2 * (p.eta_s + p.eta_b)
    return tuple(-t * p.R0 / twice for t in p.tau_derivatives(p.c0, order))


def driving_derivatives(p: Points, order: int) -> tuple[Array, ...]:
    """w_k = f_k + K_k, the k-th derivative at c0 of w = v_p - R0 tau/(2S), to `order`.

    What drives the flow [L/T over powers of N/L^2].
    """
    speeds, stresses = p.v_p_derivatives(p.c0, order), stress_derivatives(p, order)
    return tuple(f + K for f, K in zip(speeds, stresses, strict=True))


@finite_result
def stress_slope(p: Points) -> Array:
    """K_1 = -R0 tau'(c0)/(2S), what the isotropic stress adds to v_p'(c0) [L^3/(T N)].

    alpha R0/(2S) of the elastic resistance.
    """
    return stress_derivatives(p, 1)[1]


@finite_result
def driving_slope(p: Points) -> Array:
    """w_1 = v_p'(c0) + K_1 [L^3/(T N)], the slope that drives the flow; < 0 where it polarizes."""
    return driving_derivatives(p, 1)[1]


@finite_result
def effective_friction(p: Points) -> Array:
    """gamma_eff, the friction of a moving cell of mode l = 1 [M/(L^2 T)].

    Gamma (gamma_n + gamma_c)/(2 Gamma + gamma_n + gamma_c) with Gamma = gamma_t + gamma_c: the
    motion of the cell, at which no force is left, takes the rest. gamma_t for gamma_n -> infinity,
    a cell that is held.
    """
    along, across = p.gamma_t + p.gamma_c, p.gamma_n + p.gamma_c
    total = 2 * along + across
    return np.where(total > 0, along * across / np.where(total > 0, total, 1.0), 0.0)


def flow_response(p: AnyPoints, l: ArrayLike) -> Array:
    """G_l: the flow potential of mode l is -R0 G_l times the speed of mode l [1].

    G_1 = 1/(1 + gamma_eff R0^2/(2S)), 1 without friction. Raises InvalidInput unless l is a whole
    number >= 1.
    """
    L = degree(l)
    p = points(p)
    S = p.eta_s + p.eta_b
    if np.all(L == 2):
        return 1 / (1 + effective_friction(p) * p.R0**2 / (2 * S)) + np.zeros(L.shape)
    resisted = L * (2 * p.eta_s + p.eta_b) - 2 * p.eta_s + (p.gamma_t + p.gamma_c) * p.R0**2
    if np.any(L == 2):
        return np.where(L == 2, flow_response(p, 1), 2 * S / resisted)
    return 2 * S / resisted


def mode_derivatives(
    p: Points, l: ArrayLike, order: int, driving: tuple[Array, ...] | None = None
) -> tuple[Array, ...]:
    """What drives the flow of mode l: derivatives at c0, to `order` [L/T over powers of N/L^2].

    w_k, and in mode l = 1 `push_share` times those of m v_p, with m(c) of `forces.friction`.
    `driving`: the w_k, where they are known.
    """
    L, w = degree(l), driving or driving_derivatives(p, order)
    if not np.any(p.gamma_c):
        return w
    share = np.where(L == 2, push_share(p), 0.0)
    f = p.v_p_derivatives(p.c0, order)
    more = [0.0, *(k * density_slope(p) * f[k - 1] for k in range(1, order + 1))]
    pushed = (share * (f_k + m_k) for f_k, m_k in zip(f, more, strict=True))
    return tuple(w_k + q for w_k, q in zip(w, pushed, strict=True))


@finite_result
def push_share(p: Points) -> Array:
    """What friction of the cortex adds to the drive of mode l = 1, as a share of v_p [1].

    Treadmilling against it pushes the cell by gamma_c v_p along the normal. 0 without gamma_c.
    """
    along, across = p.gamma_t + p.gamma_c, p.gamma_n + p.gamma_c
    total = 2 * along + across
    push = p.gamma_c * along * p.R0**2 / (2 * (p.eta_s + p.eta_b))
    return push / np.where(total > 0, total, 1.0)


def density_slope(p: Points) -> Array:
    """m'(c0), what the friction of the cortex changes by with c [L^2/N]."""
    return p.gamma_share / np.where(p.c0 > 0, p.c0, 1.0)


def refuse_surroundings(p: AnyPoints, what: str) -> None:
    """Raise InvalidInput where there is friction or bending, which `what` does not know."""
    given = [n for n in SURROUNDINGS if np.any(getattr(p, n) != 0)]
    if given:
        raise InvalidInput(
            f"{what} is available only without friction and bending, got {', '.join(given)} > 0; "
            "set them to 0, or follow the axisymmetric branch (`amoeboid branch`)"
        )


def refuse_nonlinear_friction(p: Points) -> None:
    """Raise InvalidInput for friction beyond what the amplitude equation knows."""
    if np.any((p.gamma_share != 0) & (p.gamma_t + p.gamma_n + p.gamma_c != 0)):
        raise InvalidInput(
            "the amplitude equation needs uniform friction, got gamma_share > 0; set gamma_share "
            "to 0, or follow the axisymmetric branch (`amoeboid branch`)"
        )
    if np.any((p.gamma_c != 0) & np.isfinite(p.delta_P)):
        raise InvalidInput(
            "the amplitude equation at finite delta_P needs gamma_c = 0, got gamma_c > 0; use "
            "infinite_pressure(p), or follow the axisymmetric branch (`amoeboid branch`)"
        )


@finite_result
def shape_response(p: Points, l: ArrayLike) -> Array:
    """kappa_l: a steady shape has rho_l = kappa_l times the speed of mode l [T/L], for l >= 2.

    The speed is that of w(c); 0 for delta_P -> infinity. Raises InvalidInput unless l is a
    whole number >= 2, where nothing holds the shape (delta_P, kappa and v_p(c0) are 0), and with
    friction of the cortex, which drives the shape as well, or friction proportional to c.
    """
    refuse_nonlinear_friction(p)
    L = degree(l, lowest=2)
    S = p.eta_s + p.eta_b
    f0, held = p.v_p(p.c0), held_pressure(p, L)
    friction = (p.gamma_t + p.gamma_c) * p.R0**2
    pull = 8 * p.eta_s * S
    stiffness = held * p.R0**2 * (L * (2 * p.eta_s + p.eta_b) - 2 * p.eta_s + friction)
    stiffness = stiffness + (pull - 4 * S * friction) * f0
    if np.any(stiffness == 0):
        raise InvalidInput("delta_P or v_p(c0) must be > 0: nothing holds the shape of the cell")
    return (pull + 8 * S * friction / (L - 2)) / stiffness


def held_pressure(p: Points, L: ArrayLike) -> Array:
    """What holds the shape of a mode L = l(l+1) as a pressure would [M/(L T^2)].

    delta_P, friction of the treadmilling cortex, and bending: gamma_c v_p(c0) + 2 kappa L/R0^3.
    """
    return p.delta_P + p.gamma_c * p.v_p(p.c0) + 2 * p.kappa * np.asarray(L) / p.R0**3


def degree(l: ArrayLike, lowest: int = 1) -> Array:
    """L = l(l+1) of whole numbers l >= `lowest` [1]. Raises InvalidInput for others."""
    given = np.asarray(l)
    good = given.dtype.kind in "iu" and bool((given >= lowest).all())
    if not good:
        raise InvalidInput(f"l must be a whole number >= {lowest}, got {l!r}")
    return given.astype(float) * (given + 1)
