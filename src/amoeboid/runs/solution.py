"""`simulate`: a run from its parameters to its end, and the solution that it gives."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from amoeboid.config import Config, configured, resolved
from amoeboid.meshes.cells import InitialCell
from amoeboid.model.changes import Changes
from amoeboid.model.parameters import Parameters
from amoeboid.output.folder import RunFolder, new_folder, new_run
from amoeboid.runs.advance import (
    INTERRUPTED,
    FramesInMemory,
    Record,
    advance,
    advance_in_folder,
    summary,
)
from amoeboid.runs.continuing import check_continues, ended_by
from amoeboid.runs.interruption import Interrupted, interruptible_from_python
from amoeboid.runs.meshes import Icosphere, placed_on
from amoeboid.runs.progress import check_progress, wanted
from amoeboid.runs.run import Run
from amoeboid.runs.snapshot import Snapshot
from amoeboid.runs.stored import StoredRun
from amoeboid.sections import Initial, Noise, Output, Time, checked_noise
from amoeboid.simulation.dense_output import Schedule
from amoeboid.simulation.events import times_of
from amoeboid.simulation.loop import start
from amoeboid.simulation.path import recorded
from amoeboid.simulation.rows import Row, Rows
from amoeboid.simulation.step import Step
from amoeboid.simulation.timeseries import TimeSeries
from amoeboid.surface.initial import Adaptation
from amoeboid.validation import InvalidInput, path_of


@dataclass(frozen=True, eq=False, repr=False)
class Solution(Run):
    """A run that has been made, see `Run`; `config` is what it was made with.

    `status` and `ended` say how and why it ended, `rows` are the time series in plain numbers, of
    the observables `observe` (of all if None), and `last` is the step that it can be continued
    from.

    >>> import amoeboid as am
    >>> sol = am.simulate(mesh=am.Icosphere(1), until=am.time(1.0))
    >>> sol
    Solution(end of time at t = 1, 20 steps, 42 nodes)
    """

    config: Config
    rows: Sequence[Row]
    units: Mapping[str, str | None]
    frames: Sequence[Snapshot]
    last: Step
    status: str
    ended: str
    observe: tuple[str, ...] | None = None
    cell: InitialCell | None = None
    adapted: Adaptation | None = None
    """What was done to a given shape before the cell could start as it."""

    @property
    def parameters(self) -> Parameters:
        """The parameters of the cell."""
        return self.config.parameters

    def __repr__(self) -> str:
        return f"Solution({self._end})"

    def resume(
        self, until: Any = None, *, progress: Any = None, writers: Iterable[Any] = ()
    ) -> Solution:
        """The run continued in memory until other events, exactly as if it had not stopped.

        `until` and `writers` are those of `simulate`. Raises InvalidInput where it would end at
        once.
        """
        check_progress(progress)
        config, events = ended_by(self.config, until)
        check_continues(self.last, resolved(config).time, events)
        record = _record(config, self.observe, writers, self.frames)
        record.series.rows, record.series.units = Rows(self.rows), dict(self.units)
        record.continued(self.last)
        return _solved(config, self.last, record, events, progress, self.observe, self.cell)

    def save(self, folder: str | os.PathLike[str]) -> StoredRun:
        """Write the run into a folder, new or empty, as `amoeboid run` does; gives the stored run.

        Raises InvalidInput for a folder that holds something and a law that no file can hold.
        """
        path = new_folder(path_of(folder, "the folder of a run"))
        run = new_run(path, self.config, self.adapted, (), self.observe, self.cell)
        run.series.rows, run.series.units = Rows(self.rows), dict(self.units)
        for frame in self.frames:
            run.frames.write(
                replace(self.last, model=frame.model, history=(frame.state,), flow=frame.flow)
            )
        run.checkpoint.write(self.last)
        found = summary(self.rows, self.last) | {"output": str(path)}
        t = self.last.state.t
        run.write_manifest(self.status, ended=self.ended, t=t, summary=found)
        return StoredRun(path)


def simulate(
    parameters: Parameters | Config | None = None,
    *,
    mesh: Any = None,
    until: Any = None,
    initial: Any = None,
    time: Time | None = None,
    times: Sequence[Any] | None = None,
    output: Output | None = None,
    folder: str | os.PathLike[str] | None = None,
    writers: Iterable[Any] = (),
    observe: Iterable[str] | None = None,
    progress: Any = None,
    changes: Mapping[str, Any] | None = None,
    cue: Any = None,
    environment: Any = None,
    noise: Noise | None = None,
) -> Solution:
    """Simulate the 3D cell; without arguments the run of figure 3D, as `amoeboid run` does.

    `parameters`: those of the cell, or a whole `Config` to start from. `mesh`: `Icosphere(3)`,
    or `Surface(...)`, a shape of your own. `until`: an event or a list of them, `steady()`,
    `time(100)`, `when("polarity > 0.5")`, or any function of a step; without it the run ends once
    it is steady, after 200/rate at the latest. `initial`: a section `Initial(...)`, or a cell to
    start as, such as a steady state, the `final` of a solution, or `InitialCell`. `time` and
    `output` are sections of the configuration. `times`: of the frames, [T] or quantities.
    `folder`: where to write the run, as the command does. `writers`: your own, see
    `amoeboid.simulation.writers`. `observe`: names of the observables of the time series, all of
    them if None. `changes`: parameters that change in time, such as `{"v_p0": steps((5, 0))}`;
    `cue`: a `Cue`, or any object with its `factor`; see docs/inputs.md. `environment`: where the
    cell migrates, such as `Fluid()` or "patch:30"; its path is recorded there, see
    docs/motility.md. `noise`: shot noise of the filaments, such as `Noise(filaments=1e5, seed=1)`,
    see docs/noise.md. `progress`: None shows a
    line on a terminal or in a notebook after two seconds, True at once, False never; a function is
    called with each row of the time series.

    The solution of a run that cannot continue has the status "diverged"; its steps are good. Ctrl-C
    ends a run after the present step with a KeyboardInterrupt that has the run up to there as
    `solution`; a second one ends it at once. Raises InvalidInput.
    """
    check_progress(progress)
    config = parameters if isinstance(parameters, Config) else Config()
    if isinstance(parameters, Parameters):
        config = replace(config, parameters=parameters)
    elif parameters is not None and not isinstance(parameters, Config):
        raise InvalidInput(f"parameters must be Parameters or a Config, got {parameters!r}")
    config = replace(config, time=time or config.time, output=output or config.output)
    if changes is not None:
        config = replace(config, changes=Changes(changes))
    if cue is not None:
        config = replace(config, cue=cue)
    if environment is not None:
        config = replace(config, environment=environment)
    if noise is not None:
        config = replace(config, noise=checked_noise(noise))
    if recorded(config.environment):
        settled = config.environment.settled(config.parameters.units)
        config = replace(config, environment=settled)
    if times is not None:
        at = times_of(times, config.parameters, "times")
        config = replace(config, output=replace(config.output, times=at))
    config, cell = _started_from(config, mesh, initial)
    config, events = ended_by(config, until)
    names = None if observe is None else tuple([observe] if isinstance(observe, str) else observe)
    record = _record(config, names, writers)
    first = start(config, cell)
    if folder is None:
        return _solved(config, first, record, events, progress, names, cell)
    path = new_folder(path_of(folder, "the folder of a run"))
    run = new_run(path, config, first.adapted, writers, names, cell)
    return _solved(config, first, run, events, progress, names, cell)


def _started_from(config: Config, mesh: Any, initial: Any) -> tuple[Config, InitialCell | None]:
    """The configuration with a mesh and an initial condition, and the cell to start as, if any."""
    if isinstance(initial, Initial):
        config = replace(config, initial=initial)
    changes, cell = ({}, None) if mesh is None else placed_on(mesh, config)
    if initial is not None and not isinstance(initial, Initial):
        given = initial
        if not isinstance(given, InitialCell):
            if not callable(getattr(given, "as_initial", None)):
                raise InvalidInput(
                    "initial must be amoeboid.Initial(...), a steady state, a snapshot or an "
                    f"InitialCell, got {given!r}"
                )
            given = given.as_initial(mesh or Icosphere(config.mesh.subdivisions))
        if cell is not None or "initial.surface" in changes:
            raise InvalidInput(
                "a run must have one initial shape, got a surface and a cell; leave one out"
            )
        changes, cell = {"initial.perturbation": config.initial.perturbation or 0.0}, given
    sections: dict[str, dict[str, Any]] = {}
    for name, value in changes.items():
        section, field = name.split(".")
        sections.setdefault(section, {})[field] = value
    return configured(config, sections), cell


def _record(
    config: Config,
    observe: tuple[str, ...] | None,
    writers: Iterable[Any],
    frames: Iterable[Snapshot] = (),
) -> Record:
    output = resolved(config).output
    schedule = Schedule(output.interval, output.times)
    return Record(TimeSeries(observe, config), FramesInMemory(schedule, frames), writers)


def _solved(
    config: Config,
    first: Step,
    into: Record | RunFolder,
    events: Sequence[Any],
    progress: Any,
    observe: tuple[str, ...] | None,
    cell: InitialCell | None,
) -> Solution:
    """The solution of a run that is made now. Raises Interrupted, which has it, after Ctrl-C."""
    time = resolved(config).time
    with (
        interruptible_from_python() as interruption,
        wanted(progress, first.state.t, time.end, config.parameters) as report,
    ):
        events = [*events, interruption]
        if isinstance(into, RunFolder):
            outcome, _ = advance_in_folder(into, first, events, report)
            rows, units = into.rows, into.units
            frames: Sequence[Snapshot] = StoredRun(into.folder).frames
        else:
            outcome = advance(into, first, time, events, report)
            rows, units, frames = into.series.rows, into.series.units, into.frames.kept
    solution = Solution(
        config, rows, units, frames, outcome.last, outcome.status, outcome.ended, observe, cell,
        first.adapted,
    )  # fmt: skip
    if solution.status == INTERRUPTED:
        raise Interrupted(solution)
    return solution
