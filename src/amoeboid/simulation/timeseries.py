"""The time series of a run: one row a step, with its observables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from amoeboid.arrays import Array
from amoeboid.config import Config
from amoeboid.motility.environments import Environment
from amoeboid.observables import observed, selected
from amoeboid.observables import units as observable_units
from amoeboid.simulation.changes import input_units, input_values
from amoeboid.simulation.path import MIGRATION, PATH_UNITS, OwnFriction, path_values, recorded
from amoeboid.simulation.rows import Row, Rows
from amoeboid.simulation.step import Step
from amoeboid.validation import InvalidInput, refuse_unknown

# Columns of `State.position`: the way of a cell with all drag on its cortex.
POSITION = ("cortex_drag_x", "cortex_drag_y", "cortex_drag_z")
# Columns of a step beside its observables, and their dimensions; `rate` is in units of
# Parameters.rate.
STEP_UNITS: dict[str, str | None] = {
    "step": "1",
    "t": "T",
    "dt": "T",
    "rejected": "1",
    "rate": "1",
    **dict.fromkeys(POSITION, "L"),
}

FRICTIONS = ("gamma_t", "gamma_n", "gamma_c")

# Of a run with shot noise: the share of it in a step that the nodes had filaments enough for.
NOISE_KEPT = "noise_kept"
NOISE_UNITS: dict[str, str | None] = {NOISE_KEPT: "1"}


def column_units(
    observe: Iterable[str] | None = None, config: Config | None = None
) -> dict[str, str | None]:
    """The columns of the time series and their dimensions; `observe` as of `selected`.

    With those of the parameters that change in time by `config`, and of the path in its
    environment. Raises InvalidInput for an
    observable that has the name of another column.
    """
    changing = {} if config is None else input_units(config)
    if config is not None and config.noise.acts:
        changing = changing | NOISE_UNITS
    if environment_of(config) is not None:
        changing = PATH_UNITS | changing
    columns = [*STEP_UNITS, *(c for name, o in selected(observe).items() for c in o.columns(name))]
    columns += changing
    twice = [name for name in columns if columns.count(name) > 1]
    if twice:
        raise InvalidInput(
            f"observable names must differ from the columns of the time series, got {twice[0]!r}; "
            "rename it"
        )
    return STEP_UNITS | observable_units(observe) | changing


def environment_of(config: Config | None) -> Environment | None:
    """The environment in which a run records its path; None if that is in every run.

    If none is set, a cell with friction moves by that. Raises InvalidInput for quantities that the
    parameters have no units for.
    """
    if config is None:
        return None
    if not recorded(config.environment):
        lasting = not any(name in config.changes for name in FRICTIONS)
        return OwnFriction() if config.parameters.has_friction and lasting else None
    return config.environment.settled(config.parameters.units)


def position_columns(columns: Iterable[str]) -> tuple[str, ...]:
    """The columns of the position of a run: in its environment, or with drag on the cortex."""
    return MIGRATION if set(MIGRATION) <= set(columns) else POSITION


def row_of(step: Step, observe: Iterable[str] | None = None) -> Row:
    """The row of a step. Raises InvalidInput for an observable that fails."""
    return {
        "step": step.number,
        "t": step.state.t,
        "dt": step.dt,
        "rejected": step.rejected,
        "rate": step.rate,
        **dict(zip(POSITION, (float(x) for x in step.state.position), strict=True)),
        **observed(step.cell, observe),
        **input_values(step.model),
        **({} if step.model.noise is None else {NOISE_KEPT: step.noise_kept}),
    }


def column(rows: Sequence[Row], units: Mapping[str, str | None], name: str) -> Array:
    """A column (T,) of the rows; a vector (T, 3) by the name of its observable.

    Where a column came later or ended earlier than the run, a masked array: no number stands for
    one that is missing. Raises InvalidInput for an unknown name.
    """
    parts = [f"{name}_{axis}" for axis in "xyz"]
    if name not in units and all(part in units for part in parts):
        columns = [column(rows, units, part) for part in parts]
        masked = any(np.ma.isMaskedArray(part) for part in columns)
        return np.ma.stack(columns, axis=1) if masked else np.stack(columns, axis=1)
    refuse_unknown([name], units, "column", "of the time series")
    values = np.array([row.get(name, 0.0) for row in rows])
    missing = np.array([name not in row for row in rows])
    return np.ma.masked_array(values, missing) if missing.any() else values


class TimeSeries:
    """The rows of a run, kept in memory: a writer.

    `observe`: names of the observables, all if None. `config`: that of the run, if it is to have
    columns for parameters that change in time.
    """

    def __init__(self, observe: Iterable[str] | None = None, config: Config | None = None) -> None:
        self.observe = None if observe is None else tuple(selected(observe))
        self.environment = environment_of(config)
        self.units = column_units(self.observe, config)
        self.rows = Rows()

    def due(self, step: Step) -> bool:
        """Every step has a row."""
        return True

    def write(self, step: Step) -> None:
        """Append the row of a step."""
        row = row_of(step, self.observe)
        if self.environment is not None:
            before = self.rows[-1] if self.rows else None
            row |= path_values(step, self.environment, before)
        self.rows.append(row)

    def finish(self, step: Step) -> None:
        """Append the last step unless it has its row."""
        if not self.rows or self.rows[-1]["step"] < step.number:
            self.write(step)

    def __getitem__(self, name: str) -> Array:
        return column(self.rows, self.units, name)
