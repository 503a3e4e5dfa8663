"""What the closed forms say about a cell: thresholds, growth rates, bifurcation, predicted flow."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from amoeboid.closed_forms.branch import Prediction
from amoeboid.closed_forms.summary import Summary, Weakly, summaries, summary
from amoeboid.display import html_table
from amoeboid.model.parameters import Parameters, refuse_no_parameters
from amoeboid.studies.columns import physical_number, quantity, shortened, text, unit
from amoeboid.studies.recorded import Recorded, texts


class Number:
    """An entry of `Theory`: its dimension, its title and where the summary has it.

    An attribute of the class; on an object it is the value, a quantity where the cell has units.
    """

    def __init__(self, dimension: str, title: str, of: Callable[[Summary], Any]) -> None:
        self.dimension = dimension
        self.title = title
        self.of = of
        self.__doc__ = f"{title} [{dimension or '1'}]"

    def __get__(self, theory: Theory | None, owner: type) -> Any:
        if theory is None:
            return self
        return _converted(
            self.of(theory.summary), lambda v: quantity(theory.parameters, v, self.dimension)
        )


def _converted(value: Any, convert: Callable[[Any], Any]) -> Any:
    """`convert` applied to a number or an array, or to the entries of a dict or list of them."""
    if isinstance(value, dict):
        return {key: _converted(v, convert) for key, v in value.items()}
    if isinstance(value, list):
        return [_converted(v, convert) for v in value]
    return value if value is None or isinstance(value, str | bool) else convert(value)


def _weakly(of: Callable[[Weakly], Any]) -> Callable[[Summary], Any]:
    """What the amplitude equation says; None where there is none."""
    return lambda s: None if s.weakly is None else of(s.weakly)


def _polarized(of: Callable[[Weakly], Any]) -> Callable[[Summary], Any]:
    """What it says of the polarized state; None where there is no such state."""
    return _weakly(lambda w: of(w) if w.state.exists else None)


def _predicted(of: Callable[[Prediction], Any]) -> Callable[[Summary], Any]:
    """What the comparison with the next order says of it; None where that is not known."""
    return _polarized(lambda w: None if w.prediction is None else of(w.prediction))


@dataclass(frozen=True, eq=False, repr=False)
class Theory:
    """The closed forms at one parameter point.

    Every number is an attribute, a quantity with its unit where the parameters have physical ones;
    None where the theory has no such number, and `notes` say why. Growth rates are dicts by the
    mode l. `numbers()` lists all names.
    """

    parameters: Parameters
    summary: Summary

    threshold = Number(
        "L/T",
        "lowest threshold v_p^c",
        lambda s: float(s.thresholds.v_p0[0]) if s.thresholds.v_p0.size else None,
    )
    thresholds = Number("L/T", "thresholds v_p^c (lambda_1 = 0)", lambda s: s.thresholds.v_p0)
    first_mode = Number(
        "",
        "mode that goes unstable first, l <= 6",
        lambda s: s.first_mode.l if s.first_mode else None,
    )
    first_mode_v_p0 = Number(
        "L/T", "... at v_p0 =", lambda s: s.first_mode.v_p0 if s.first_mode else None
    )
    delta_P_star = Number(
        "M/(L T^2)", "delta_P* (l = 2 leads below it)", _weakly(lambda w: w.delta_P_star)
    )
    zeta0 = Number("M/T^2", "membrane tension zeta_0 at rest", lambda s: s.zeta0)
    nu = Number("L^4/(T N^2)", "cubic coefficient nu at delta_P", _weakly(lambda w: w.nu))
    bifurcation = Number("", "bifurcation at delta_P", _weakly(lambda w: w.bifurcation))
    m_2 = Number("L^2/N", "second harmonic of c per a^2, m_2", _weakly(lambda w: w.m_2))
    r_2 = Number("L^4/N^2", "rho_2 per a^2, r_2", _weakly(lambda w: w.r_2))
    nu_infinite_pressure = Number(
        "L^4/(T N^2)", "nu for delta_P -> infinity", _weakly(lambda w: w.nu_infinite_pressure)
    )
    nu_5_infinite_pressure = Number(
        "L^8/(T N^4)",
        "fifth-order coefficient, delta_P -> infinity",
        _weakly(lambda w: w.nu_5_infinite_pressure),
    )
    bifurcation_infinite_pressure = Number(
        "",
        "bifurcation for delta_P -> infinity",
        _weakly(lambda w: w.bifurcation_infinite_pressure),
    )
    trusted_distance = Number(
        "L/T", "cubic amplitude good to 10 % within", _weakly(lambda w: w.trusted_distance)
    )
    amplitude = Number(
        "N/L^2",
        "amplitude of the polarized state",
        _polarized(lambda w: float(w.state.amplitude)),
    )
    amplitude_stable = Number("", "... is stable", _polarized(lambda w: bool(w.state.stable)))
    max_retrograde_speed_cubic = Number(
        "L/T",
        "its retrograde speed, prefactor at v_p^c",
        _polarized(lambda w: w.max_retrograde_speed),
    )
    max_retrograde_speed_at_v_p0 = Number(
        "L/T",
        "... with the prefactor at v_p0",
        _predicted(lambda q: float(q.max_retrograde_speed_at_v_p0)),
    )
    max_retrograde_speed_next_order = Number(
        "L/T",
        "... by the next order",
        _predicted(lambda q: float(q.next_order_speed) if q.next_order.exists else None),
    )
    relative_error = Number(
        "",
        "estimated relative error of the cubic speed",
        _predicted(lambda q: float(q.relative_error)),
    )
    in_reach = Number(
        "", "... the cubic theory reaches v_p0", _predicted(lambda q: bool(q.in_reach))
    )
    rho_2 = Number(
        "", "shape coefficient rho_2, r = R0 (1 + rho_2 P_2)", _polarized(lambda w: w.rho_2)
    )
    max_retrograde_speed = Number(
        "L/T", "predicted max_retrograde_speed", lambda s: s.max_retrograde_speed
    )
    growth_rates = Number(
        "1/T", "growth rate lambda_l, delta_P -> infinity", lambda s: dict(s.growth_rates)
    )
    growth_rates_finite_pressure = Number(
        "1/T",
        "slow and fast growth rate at delta_P",
        lambda s: {l: [rate.real for rate in pair] for l, pair in s.finite_pressure_rates.items()},
    )
    frequencies_finite_pressure = Number(
        "1/T",
        "their frequency",
        lambda s: {l: abs(pair[0].imag) for l, pair in s.finite_pressure_rates.items()},
    )

    @classmethod
    def numbers(cls) -> Iterator[tuple[str, Number]]:
        """All entries with their names."""
        return ((name, n) for name, n in vars(cls).items() if isinstance(n, Number))

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader must know about these numbers."""
        return self.summary.notes

    def plain(self, name: str) -> Any:
        """The entry `name` as programs read it: plain numbers in the unit of `unit`."""
        dimension = vars(type(self))[name].dimension

        def convert(value: Any) -> Any:
            whole = isinstance(value, int)
            return value if whole else physical_number(self.parameters, value, dimension)

        return _converted(self._listed(name), convert)

    def recorded(self) -> dict[str, Recorded]:
        """What sweeps record: every number, growth rates along the mode l."""
        notes = Recorded(texts(self.notes), title="what a reader must know")
        return {name: self._recorded(name, n.title) for name, n in self.numbers()} | {
            "notes": notes
        }

    def _recorded(self, name: str, title: str) -> Recorded:
        value = self.plain(name)
        physical = self.parameters.units is not None
        unit = self.unit(name) if physical or self.unit(name) != "1" else ""
        if isinstance(value, list):
            return Recorded(value, unit, title, (f"{name.removesuffix('s')}_number",))
        if not isinstance(value, dict):
            return Recorded(value, unit, title)
        degrees = tuple(self.summary.growth_rates)
        labels: dict[str, tuple[Any, ...]] = {"l": degrees}
        if name == "growth_rates_finite_pressure":
            labels["rate"] = ("slow", "fast")
            pairs = [value.get(l, [None, None]) for l in degrees]
            return Recorded(pairs, unit, title, ("l", "rate"), labels)
        return Recorded([value.get(l) for l in degrees], unit, title, ("l",), labels)

    def unit(self, name: str) -> str:
        """The unit of `plain(name)`; the dimension where the parameters have no physical units."""
        return unit(self.parameters, vars(type(self))[name].dimension)

    def text(self, name: str) -> str:
        """The entry `name` as it is printed, with its unit; "none" where there is none."""
        value, dimension = self._listed(name), vars(type(self))[name].dimension
        if value is None or value == []:
            return "none"
        if isinstance(value, bool):
            return "yes" if value else "no"
        if isinstance(value, list):
            return ", ".join(text(self.parameters, v, dimension) for v in value)
        if isinstance(value, float):
            return text(self.parameters, value, dimension)
        return str(value)

    def _listed(self, name: str) -> Any:
        """An entry in the units of the solver, arrays as lists."""
        value = vars(type(self))[name].of(self.summary)
        return value.tolist() if isinstance(value, np.ndarray) else value

    def __repr__(self) -> str:
        flow = self.text("max_retrograde_speed")
        lines = [
            f"Theory: threshold {self.text('threshold')}, bifurcation "
            f"{self.text('bifurcation')}; {self.parameters.description}",
            f"growth rate of l = 1: {text(self.parameters, self.summary.growth_rates[1], '1/T')}, "
            f"predicted max_retrograde_speed: {'unknown' if flow == 'none' else flow}",
        ]
        return "\n".join([*lines, *(f"- {note}" for note in shortened(self.notes, 3, "notes"))])

    def _repr_html_(self) -> str:
        rows = []
        for name, number in self.numbers():
            if isinstance(self._listed(name), dict):
                ending = self.unit(name) if self.parameters.units is not None else ""
                rows += [
                    (
                        f"{name}[{l}]",
                        f"{_short(value)} {ending}".rstrip(),
                        f"{number.title}, l = {l}",
                    )
                    for l, value in self.plain(name).items()
                ]
            elif self._listed(name) is not None:
                rows.append((name, self.text(name), number.title))
        heading = f"Theory; {self.parameters.description}"
        return html_table(heading, rows, ("name", "value", "meaning"), self.notes)


def _short(value: Any) -> str:
    values = value if isinstance(value, list) else [value]
    return ", ".join(f"{v:.6g}" for v in values)


def theory(p: Parameters) -> Theory:
    """What the closed forms say about a cell.

    Raises InvalidInput where the law is not defined at c0.

    >>> import amoeboid as am
    >>> cell = am.theory(am.Parameters())
    >>> f"{cell.threshold:.5f}", cell.bifurcation
    ('3.54844', 'supercritical')
    """
    refuse_no_parameters(p)
    return Theory(p, summary(p))


def theories(p: Parameters, speeds: Sequence[float]) -> list[Theory]:
    """What `theory` says about a cell at several v_p0 [L/T], in much less time than one by one.

    Raises InvalidInput where the law is not defined at c0.

    >>> import amoeboid as am
    >>> [f"{cell.growth_rates[1]:.3f}" for cell in theories(am.Parameters(), (3.0, 3.8))]
    ['-0.164', '0.075']
    """
    refuse_no_parameters(p)
    found = summaries(p, speeds)
    return [Theory(p.replace(v_p0=v), one) for v, one in zip(speeds, found, strict=True)]
