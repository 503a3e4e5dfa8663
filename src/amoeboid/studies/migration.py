"""`migrate`: where a cell goes in an environment, for a state of any solver or a measured one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.display import html_table, shown
from amoeboid.forces import friction
from amoeboid.model.units import Units, customary_unit, in_unit, magnitude
from amoeboid.model.units import quantity as physical
from amoeboid.motility.balance import Motion, motion
from amoeboid.motility.cells import MeasuredCell, surface_of
from amoeboid.motility.environments import Environment
from amoeboid.motility.squirmer import squirmer_modes
from amoeboid.motility.surfaces import TANGENTIAL, front_of
from amoeboid.motility.words import environment
from amoeboid.observables import max_retrograde_speed, polarization
from amoeboid.studies.columns import Column, frame
from amoeboid.studies.recorded import Recorded
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput

NUMBERS = {
    "speed": "L/T",
    "velocity_over_max_retrograde_speed": "1",
    "velocity": "L/T",
    "angular_velocity": "1/T",
    "power": "M L^2/T^3",
    "efficiency": "1",
    "error": "L/T",
    "drag": "M/T",
    "rotational_drag": "M L^2/T",
    "coupling": "M L/T",
    "squirmer_modes": "L/T",
    "beta": "1",
}
"""The numbers of a `Migration` with their dimensions."""

ROUNDING = 1e-13
"""Components of vectors below this are shown as 0."""

UNPOLARIZED = "the cell is not polarized and does not move"

SHOWN = ("speed", "velocity_over_max_retrograde_speed", "angular_velocity", "power", "efficiency")


@dataclass(frozen=True, eq=False, repr=False)
class Migration:
    """A cell that is force- and torque-free in an environment; all numbers of docs/motility.md.

    Axes are those of the cell: z along the axis of an axisymmetric one, those of its nodes for one
    in 3D. With physical units, numbers are quantities. `motion` holds them as plain numbers, like
    `fastest`, the maximum of the retrograde speed, and `modes` (n,), those of a squirmer. `surface`
    says in words what migrates. `polarized`: whether the cell has a front; one without does not
    move.
    """

    environment: Environment
    motion: Motion
    fastest: float
    modes: Array
    units: Units | None
    surface: str
    polarized: bool = True

    @property
    def speed(self) -> Any:
        """Velocity of the center of volume towards the front [L/T]; negative if backwards."""
        return self._quantity("speed")

    @property
    def velocity(self) -> Any:
        """Velocity (3,) of the center of volume [L/T]."""
        return self._quantity("velocity")

    @property
    def angular_velocity(self) -> Any:
        """Angular velocity (3,) of the shape [1/T]."""
        return self._quantity("angular_velocity")

    @property
    def velocity_over_max_retrograde_speed(self) -> float:
        """`speed` over the maximum of the retrograde speed [1]."""
        return float(self.plain("velocity_over_max_retrograde_speed"))

    @property
    def front(self) -> Array:
        """Unit vector (3,) towards the front, where the concentration is low [1]."""
        return self.motion.front

    @property
    def drag(self) -> Any:
        """Resistance (3, 3) to translations of the cell without its flow [M/T]."""
        return self._quantity("drag")

    @property
    def rotational_drag(self) -> Any:
        """Resistance (3, 3) to rotations about the center of volume [M L^2/T]."""
        return self._quantity("rotational_drag")

    @property
    def coupling(self) -> Any:
        """Force (3, 3) per angular velocity: rows translations, columns rotations [M L/T]."""
        return self._quantity("coupling")

    @property
    def power(self) -> Any:
        """Power that the cell gives to its surroundings [M L^2/T^3].

        What is dissipated inside of it, in the cortex and by polymerization, is not counted.
        """
        return self._quantity("power")

    @property
    def efficiency(self) -> float:
        """Power that would tow the cell without its flow at this velocity, over `power` [1].

        Lighthill's efficiency, 1/2 for a flow u0 sin(theta) on a sphere in a fluid. It may exceed
        1, and is infinite where the surface slips nowhere against its surroundings.
        """
        return float(self.plain("efficiency"))

    @property
    def squirmer_modes(self) -> Any:
        """B_1 to B_5 of the retrograde flow, as seen from the front [L/T]."""
        return self._quantity("squirmer_modes")

    @property
    def beta(self) -> float:
        """B_2/|B_1| [1]: negative for a pusher, positive for a puller."""
        return float(self.plain("beta"))

    @property
    def error(self) -> Any:
        """Estimate of the error of the velocity by the method [L/T], without that of the flow."""
        return self._quantity("error")

    def plain(self, name: str) -> Any:
        """A number or array in the units of the solver; `name` is one of `NUMBERS`."""
        found, r = self.motion, self.motion.resistance
        values: dict[str, Any] = {
            "speed": found.speed,
            "velocity": found.velocity,
            "angular_velocity": found.angular_velocity,
            "velocity_over_max_retrograde_speed": (
                found.speed / self.fastest if self.fastest > 0.0 else 0.0
            ),
            "power": found.power,
            "efficiency": found.efficiency,
            "error": found.error,
            "drag": r[:3, :3],
            "rotational_drag": r[3:, 3:],
            "coupling": r[:3, 3:],
            "squirmer_modes": self.modes,
            "beta": self.modes[1] / abs(self.modes[0]) if self.modes[0] else 0.0,
        }
        return values[name]

    def number(self, name: str) -> Any:
        """The number or array `name` as programs read it, in the unit of `unit`."""
        found, dimension = np.asarray(self.plain(name)), NUMBERS[name]
        if self.units is not None and dimension != "1":
            found = found * in_unit(1.0, dimension, self.units, customary_unit(dimension))
        return found.tolist()

    def unit(self, name: str) -> str:
        """The unit of `number(name)`; "" for plain numbers."""
        dimension = NUMBERS[name]
        return "" if self.units is None or dimension == "1" else customary_unit(dimension)

    def _quantity(self, name: str) -> Any:
        value, dimension = self.plain(name), NUMBERS[name]
        if self.units is None or dimension == "1":
            return value
        return physical(value, dimension, self.units)

    @property
    def columns(self) -> dict[str, Column]:
        """All numbers as columns of one row, vectors by their components."""
        found: dict[str, Column] = {}
        for name in NUMBERS:
            values = np.asarray(self.number(name), dtype=float)
            for place in np.ndindex(values.shape):
                ending = "".join(_component(name, k) for k in place)
                label = f"{name}_{ending}" if ending else name
                found[label] = Column(np.array([values[place]]), self.unit(name))
        return found

    def recorded(self) -> dict[str, Recorded]:
        """What sweeps record: `columns`, a number each."""
        return {
            name: Recorded(c.values.item(), c.unit, name.replace("_", " "))
            for name, c in self.columns.items()
        }

    def to_pandas(self) -> Any:
        """A pandas.DataFrame of one row; its `attrs["units"]` holds the units."""
        return frame(self.columns)

    def __repr__(self) -> str:
        values = UNPOLARIZED
        if self.polarized:
            values = ", ".join(f"{name} = {_text(self, name)}" for name in SHOWN)
        return f"Migration(in {_short(self.environment)}: {values}; {self.surface})"

    def _repr_html_(self) -> str:
        rows = [(name, _text(self, name)) for name in (*SHOWN, "error", "beta")]
        note = "" if self.polarized else f"<p>{UNPOLARIZED}</p>"
        return html_table(f"Migration in {_short(self.environment)}", rows) + note


def _component(name: str, k: int) -> str:
    return str(k + 1) if name == "squirmer_modes" else "xyz"[k]


def _text(found: Migration, name: str) -> str:
    value = found._quantity(name)
    if np.ndim(getattr(value, "magnitude", value)) == 0:
        return shown(value)
    numbers = ", ".join(f"{x if abs(x) > ROUNDING else 0.0:.4g}" for x in found.number(name))
    return f"({numbers}) {found.unit(name)}".rstrip()


def _short(environment: Environment) -> str:
    text = repr(environment)
    return text if len(text) <= 300 else f"{text[:296]} ..."


def migrate(
    state: Any,
    environment: Environment | str = "fluid",
    *,
    flow: ArrayLike | None = None,
    c: ArrayLike | None = None,
    front: ArrayLike | None = None,
) -> Migration:
    """The velocity of a cell in an environment, without force and torque.

    `state`: an axisymmetric steady state, a steady cell in 3D, a frame or the end of a run, or a
    `MeasuredCell`; a `Surface` with its `flow` (V, 3) is made one, with `c` (V,) and `front` (3,).
    `environment`: `Fluid()`, `Matrix()`, `Patch(30)`, ..., or a text such as "patch:30+fluid". The
    cell feels no force of its surroundings on its cortex: flow and shape are those of the state.

    Raises InvalidInput.

    >>> import amoeboid as am
    >>> state = am.steady_states(am.Parameters(D=0.4, v_p0=6.0), (1,)).fastest_stable
    >>> round(am.migrate(state, "fluid").speed, 6)
    1.158803
    """
    return migrations(state, [environment], flow=flow, c=c, front=front)[0]


@one_thread
def migrations(
    state: Any,
    environments: Iterable[Environment | str],
    *,
    flow: ArrayLike | None = None,
    c: ArrayLike | None = None,
    front: ArrayLike | None = None,
) -> list[Migration]:
    """`migrate` for several environments, with the equations of the fluid solved once."""
    wanted = [_environment(one) for one in environments]
    cell = _cell(state, flow, c, front)
    units = _units(cell)
    surface = surface_of(cell)
    if isinstance(cell, MeasuredCell):
        lengths = np.linalg.norm(surface.everywhere.ways[TANGENTIAL], axis=1)
        fastest = float(lengths.max())
    else:
        fastest = max_retrograde_speed(cell)
    polarized = isinstance(cell, MeasuredCell) or front_of(polarization(cell)) is not None
    modes = squirmer_modes(surface)
    return [
        Migration(
            one, motion(surface, one.of(units)), fastest, modes, units, repr(surface), polarized
        )
        for one in wanted
    ]


def friction_speed(state: Any) -> float:
    """Speed towards the front by the friction of the force balance, as `Migration.number` gives it.

    Raises InvalidInput without friction.
    """
    cell = _cell(state, None, None, None)
    units, found = _units(cell), float(friction.velocity(cell) @ surface_of(cell).front)
    return found if units is None else in_unit(found, "L/T", units, customary_unit("L/T"))


def _environment(given: Any) -> Environment:
    if isinstance(given, str):
        return environment(given)
    if isinstance(given, Environment):
        return given
    raise InvalidInput(
        "an environment must be an object such as amoeboid.Fluid(), with parentheses, or a text "
        f"such as 'patch:30', got {given!r}"
    )


def _cell(state: Any, flow: Any, c: Any, front: Any) -> Any:
    """The cell of a state as observables see it, or a measured one."""
    if flow is not None:
        path = getattr(state, "path", None)
        if not hasattr(state, "faces") or not hasattr(state, "r") or path is not None:
            raise InvalidInput(
                "a flow needs nodes and faces, as in amoeboid.Surface(r, faces), got "
                f"{str(state)[:100]}"
            )
        return MeasuredCell(state.r, state.faces, np.asarray(flow), None if c is None else
                            np.asarray(c), front)  # fmt: skip
    if c is not None or front is not None:
        raise InvalidInput(
            "c and front are used only with a flow, a state has its own; leave them out"
        )
    for name in ("solution", "final"):
        inner = getattr(state, name, None)
        if inner is not None and hasattr(inner, "cell"):
            state = inner
    if hasattr(state, "r") and hasattr(state, "faces") and not hasattr(state, "v_c"):
        if isinstance(state, MeasuredCell):
            return state
        raise InvalidInput("a surface needs its flow (V, 3); write migrate(surface, flow=...)")
    return getattr(state, "cell", state)


def _units(cell: Any) -> Units | None:
    if not isinstance(cell, MeasuredCell):
        return cell.parameters.units if hasattr(cell, "parameters") else None
    if cell.length is None or cell.time is None:
        return None
    sizes = magnitude(f"1 {cell.length}", "m"), magnitude(f"1 {cell.time}", "s")
    return Units(length=sizes[0], time=sizes[1], mass=1.0, filaments=1.0)
