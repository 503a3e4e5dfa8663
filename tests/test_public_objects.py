"""Every public object shows itself in a few lines and pickles."""

import pickle

import numpy as np
import pytest

import amoeboid as am
from amoeboid.model.stress import CustomStress
from amoeboid.surface.stability import Growth

MAX_REPR = 1000
P = am.Parameters(D=0.4, v_p0=6.0)
CELL = am.Parameters.physical()
OWN = P.replace(law="v_p0/(1 + (c/c_r)**n)", stress="chi*c", **{"law.n": 3.0, "stress.chi": 0.1})
SMALL = am.Icosphere(1)


@pytest.fixture(scope="module")
def objects(tmp_path_factory):
    """What public functions return: {a word: the object}."""
    folder = tmp_path_factory.mktemp("runs")
    changes = {"v_p0": am.steps((0.1, 5.0), (0.2, 6.0)), "D": am.ramp((0, 0.4), (0.1, 0.3))}
    sol = am.simulate(P, mesh=SMALL, until=am.time(0.3), changes=changes, cue=am.Cue(strength=0.1))
    stored = sol.save(folder / "run")
    physical = am.simulate(CELL, mesh=SMALL, until=am.time("3 s"))
    states = am.steady_states(P, (1,))
    branch = am.branch(P, "v_p0", 0, 6.5, max_step=0.4)
    config = am.Config(parameters=P, changes=sol.config.changes)
    measured = am.measurements(am.synthetic(P, {"u": 0.04}))
    fit = am.fit(measured, ["v_p0"], P, starts=1)
    return {
        "parameters": P,
        "physical parameters": CELL,
        "units": CELL.units,
        "config": config,
        "config of a run": sol.config,
        "config again": am.config_from_toml(am.config_to_toml(config)),
        "sections": (config.mesh, config.initial, config.time, config.output, config.cue),
        "changes": config.changes,
        "change": am.steps((5, 0.0), (20, 3.8)),
        "long change": am.steps(*((k + 1.0, float(k)) for k in range(500))),
        "ramp": am.ramp((0, 0.4), (10, 0.1)),
        "smooth": am.smooth(np.sqrt, until=3),
        "cue": am.Cue(strength=0.2),
        "laws": (P.law, am.Inverse(), OWN.law),
        "stress": OWN.stress,
        "parameters of law and stress": OWN,
        "surface": am.Surface(sol.final.r, sol.final.faces),
        "icosphere": SMALL,
        "solution": sol,
        "physical solution": physical,
        "stored run": stored,
        "frames": stored.frames,
        "snapshot": sol.final,
        "physical snapshot": physical.final,
        "stored snapshot": stored.frames[0],
        "kymograph": sol.kymograph(),
        "physical kymograph": physical.kymograph(),
        "spectrum": sol.spectrum("shape"),
        "noise": am.Noise(filaments=1e5),
        "persistence": sol.persistence(lag=0.02, after=0.0),
        "step": sol.last,
        "first step": am.start(am.Config(mesh=am.Mesh(subdivisions=1))),
        "growth": Growth(-1.0, 0.01),
        "state": sol.last.state,
        "flow": sol.last.flow,
        "model": sol.last.model,
        "events": (am.steady(), am.time(3), am.time("5 min"), am.when("polarity > 0.5 and t > 1")),
        "steady states": states,
        "steady state": states[-1],
        "initial cell": states[-1].as_initial(SMALL),
        "branch": branch,
        "fold": branch.folds[0],
        "phase diagram": am.phase_diagram(P, "D", 0.3, 0.4, speeds=(5.0, 5.6), columns=2, rows=2),
        "theory": am.theory(CELL),
        "grid": am.grid(OWN, D=[0.1, 0.2], **{"law.n": [1, 2]}),
        "refinement": am.refine(am.grid(D=[0.1, 0.2]), "value"),
        "sweep": am.sweep(am.grid(P, D=[0.1, -0.2]), am.theory),
        "measurements": measured,
        "fit": fit,
        "interval": fit.interval("v_p0"),
        "growth rate": am.growth_rate(P, l=1),
        "thresholds": am.thresholds(P),
        "points": am.points(P, v_p0=np.linspace(5, 7, 1000)),
        "prediction": am.prediction(P),
        "observables": am.OBSERVABLES["c_rear"],
        "observed": am.observed(sol.final.cell),
        "cell": sol.final.cell,
        "migration": am.migrate(sol.final, "fluid:coupled=0.5+patch:30"),
        "physical migration": am.migrate(physical.final, am.Fluid("0.7 mPa s")),
        "measured cell": am.MeasuredCell(sol.final.r, sol.final.faces, sol.final.v),
        "environments": (
            am.Fluid(),
            am.Matrix(1.0, 2.0, per_filament=True),
            am.Patch(30),
            am.Plates(20.0),
            am.Channel(10),
            am.CortexDrag(),
        ),
        "mixed environment": am.Mixed(am.Fluid(coupled=0.2), am.Patch(20, axis=(1, 0, 0))),
    }


def test_every_object_has_a_short_repr(objects):
    long = {name: len(repr(x)) for name, x in objects.items() if len(repr(x)) >= MAX_REPR}
    assert long == {}
    addresses = {name for name, x in objects.items() if " object at 0x" in repr(x)}
    assert addresses == set()


def test_parameters_of_law_and_stress_are_made_again_from_their_repr():
    names = {"Parameters": am.Parameters, "Custom": am.Custom, "CustomStress": CustomStress}
    assert eval(repr(OWN), names) == OWN  # noqa: S307


def test_every_object_pickles_and_shows_the_same(objects):
    for name, x in objects.items():
        again = pickle.loads(pickle.dumps(x))  # noqa: S301
        assert type(again) is type(x), name
        assert repr(again) == repr(x), name


def test_every_public_name_has_a_short_repr():
    for name in am.__all__:
        assert len(repr(getattr(am, name))) < MAX_REPR, name
