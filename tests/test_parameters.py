import math
import pickle
import subprocess
import sys
from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from amoeboid.model.parameters import (
    DIMENSIONS,
    Parameters,
    parameters_from,
    parameters_from_toml,
    parameters_to_toml,
)
from amoeboid.model.polymerization import Custom, Exponential, Inverse
from amoeboid.validation import InvalidInput

NUMBERS = tuple(DIMENSIONS)
POSITIVE = ("R0", "eta_s", "c_r")


def test_defaults_are_the_parameter_table():
    # SI, table `tab_params`, column "simulation"
    table = dict(R0=1, delta_P=300, eta_s=1, eta_b=1, c0=3, c_r=1, beta=1, D=0.03, v_p0=3.8)
    p = Parameters()
    assert {name: getattr(p, name) for name in table} == table
    assert p.alpha == 0
    assert p.law.name == "exponential"


def test_parameters_are_frozen():
    with pytest.raises(FrozenInstanceError):
        Parameters().D = 1.0


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize(
    "bad", [-1.0, math.nan, math.inf, -math.inf, True, "1", None, [1.0], 1j, 10**400]
)
def test_bad_values_are_refused_with_field_rule_and_value(name, bad):
    with pytest.raises(InvalidInput) as refusal:
        Parameters(**{name: bad})
    message = str(refusal.value)
    assert name in message
    assert "must be" in message
    assert repr(bad) in message


@pytest.mark.parametrize("name", NUMBERS)
def test_zero_is_refused_only_where_the_model_breaks(name):
    if name in POSITIVE:
        with pytest.raises(InvalidInput, match=f"{name} must be a finite number > 0"):
            Parameters(**{name: 0})
    else:
        assert getattr(Parameters(**{name: 0}), name) == 0.0


def test_a_cell_with_units_is_changed_by_quantities():
    cell = Parameters.physical(D="1 um^2/s")
    assert cell.replace(v_p0="2 um/s") == Parameters.physical(D="1 um^2/s", v_p0="2 um/s")
    assert cell.replace(v_p0=cell.quantity(2.0, "L/T")).v_p0 == pytest.approx(2.0, rel=1e-12)
    assert cell.replace(v_p0=2.0).v_p0 == 2.0  # in the units of the cell
    with pytest.raises(InvalidInput, match="v_p0 must have the dimension L/T"):
        cell.replace(v_p0="2 um")
    with pytest.raises(InvalidInput, match="v_p0 must be a finite number"):
        Parameters().replace(v_p0="2 um/s")


def test_a_format_of_numbers_keeps_short_units():
    assert f"{Parameters.physical().quantity(1.0, 'L/T'):.2f}".replace(" ", "") == "1.00µm/s"


def test_unknown_names_are_refused_with_a_suggestion():
    with pytest.raises(InvalidInput, match="did you mean eta_s"):
        parameters_from({"eta_S": 1.0})
    with pytest.raises(InvalidInput, match="unknown parameter 'viscosity'"):
        Parameters().replace(viscosity=1.0)


def test_numpy_numbers_are_taken_as_plain_floats():
    p = Parameters(D=np.float64(0.1), c0=np.int64(2))
    assert type(p.D) is float
    assert type(p.c0) is float


@given(
    st.fixed_dictionaries(
        {
            n: st.floats(min_value=1e-300, max_value=1.0 if n == "gamma_share" else 1e300)
            for n in NUMBERS
        },
        optional={"law": st.sampled_from(["exponential", "inverse", "v_p0/(1 + (c/c_r)**2)"])},
    )
)
def test_toml_reads_back_equal(values):
    p = parameters_from(values)
    assert parameters_from_toml(parameters_to_toml(p)) == p


def test_broken_toml_is_refused():
    with pytest.raises(InvalidInput, match="valid TOML"):
        parameters_from_toml("D = ")


def test_a_law_is_given_by_name_or_expression_and_read_as_a_law():
    assert Parameters(law="inverse").law == Inverse()
    assert Parameters(law=Inverse()) == Parameters(law=" inverse ")
    assert Parameters(law="v_p0/(1+c)").law == Custom("v_p0/(1+c)")
    assert Parameters().law == Parameters.law == Exponential()
    p = Parameters(law="inverse")
    assert p.replace(D=1.0).law is p.law
    assert pickle.loads(pickle.dumps(p)) == p  # noqa: S301
    with pytest.raises(FrozenInstanceError):
        p.law = "exponential"
    with pytest.raises(InvalidInput, match="law must be a name or an expression in c, got 3"):
        Parameters(law=3)


USER = """
from amoeboid import Custom, Inverse, Law, Parameters

points = [
    Parameters(law="inverse"),
    Parameters(law="v_p0/(1 + c/c_r)", D=0.1),
    Parameters(law=Inverse()),
    Parameters(),
]
laws: list[Law] = [p.law for p in points]
names: list[str] = [p.law.name for p in points]
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "problem"),
    [("", None), ("Parameters(law=3)", '"int"; expected "str | Law | Callable[..., Any]"')],
)
def test_programs_of_users_pass_strict_type_checks(more, problem, tmp_path):
    pytest.importorskip("mypy", reason="the type checker is not installed")
    (tmp_path / "program.py").write_text(USER + more)
    check = [sys.executable, "-m", "mypy", "--strict", "program.py"]
    done = subprocess.run(check, cwd=tmp_path, capture_output=True, text=True, check=False)
    if problem is None:
        assert done.returncode == 0, done.stdout
    else:
        assert problem in done.stdout


def test_every_field_has_a_meaning():
    for f in fields(Parameters):
        assert f.name in ("law", "stress", "units") or f.metadata["doc"]
