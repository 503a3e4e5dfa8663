import pytest
from hypothesis import given
from hypothesis import strategies as st

from amoeboid.config import (
    Config,
    Initial,
    Mesh,
    Output,
    Time,
    config_from_toml,
    config_to_toml,
    resolved,
    with_settings,
)
from amoeboid.model.parameters import Parameters
from amoeboid.validation import InvalidInput


def test_the_default_run_is_figure_3d():
    config = Config()
    assert (config.parameters.D, config.parameters.v_p0) == (0.4, 6.0)
    assert resolved(config).initial.perturbation == 3.0
    assert config.initial.direction == (0.0, 0.0, 1.0)
    assert config.mesh.subdivisions == 3


def test_settings_reach_parameters_and_sections():
    config = with_settings(
        Config(),
        [
            "D=0.03",
            "law=v_p0/(1+c/c_r)",
            "parameters.v_p0=4",
            "mesh.subdivisions=2",
            "initial.direction=[1, 0, 0.5]",
            "time.scheme=semi-implicit",
            "time.stop_when_steady=false",
        ],
    )
    assert config.parameters == Parameters(D=0.03, v_p0=4.0, law="v_p0/(1+c/c_r)")
    assert config.mesh.subdivisions == 2
    assert config.initial.direction == (1.0, 0.0, 0.5)
    assert not config.time.stop_when_steady


def test_the_last_setting_wins():
    assert with_settings(Config(), ["D=1", "D=2"]).parameters.D == 2.0


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("D", "name=value"),
        ("=3", "name=value"),
        ("D=", "name=value"),
        ("delta_p=3", "did you mean delta_P"),
        ("mesh.subdivision=3", "did you mean subdivisions"),
        ("meshes.subdivisions=3", "did you mean mesh"),
        ("subdivisions=3", "mesh.subdivisions"),
        ("mesh.subdivisions=3.5", "mesh.subdivisions must be a whole number"),
        ("mesh.subdivisions=9", "<= 6"),
        ("initial.direction=[0,0,0]", "not all zero"),
        ("initial.direction=3", "three finite numbers"),
        ("initial.seed=-1", "initial.seed"),
        ("time.scheme=euler", "semi-implicit"),
        ("time.stop_when_steady=1", "true or false"),
        ("time.end=0", "time.end must be a finite number > 0"),
        ("output.interval=nan", "output.interval"),
        ("D=1\nbeta=2", "D must be"),
        ("D={a=1}", "D must be"),
    ],
)
def test_wrong_settings_are_refused(setting, says):
    with pytest.raises(InvalidInput, match=says.replace(".", r"\.")):
        with_settings(Config(), [setting])


@given(
    st.builds(
        Config,
        parameters=st.builds(
            Parameters, D=st.floats(0, 1e3), law=st.sampled_from(["inverse", "c"])
        ),
        mesh=st.builds(Mesh, subdivisions=st.integers(1, 6)),
        initial=st.builds(
            Initial,
            perturbation=st.floats(-10, 10),
            direction=st.tuples(st.just(1.0), st.floats(-1, 1), st.floats(-1, 1)),
            seed=st.integers(0, 2**62),
        ),
        time=st.builds(Time, end=st.floats(1e-3, 1e3), stop_when_steady=st.booleans()),
        output=st.builds(Output, interval=st.floats(1e-3, 1e3)),
    )
)
def test_toml_reads_back_equal(config):
    assert config_from_toml(config_to_toml(config)) == config


def test_automatic_times_follow_the_rates_of_the_parameters():
    slow = Parameters(R0=10, beta=0.1, D=0.03, c0=1370, c_r=970, v_p0=1.7)  # micrometers, seconds
    config = resolved(Config(parameters=slow, time=Time(max_step=3)))
    assert slow.rate == pytest.approx(0.1)
    assert config.time.end == pytest.approx(2000)
    assert config.time.max_step == 3
    assert config.output.interval == pytest.approx(5)
    assert resolved(config) == config
    assert "automatic" not in config_to_toml(Config())
    assert config_from_toml(config_to_toml(Config())) == Config()


@pytest.mark.parametrize(
    ("times", "least"),
    [
        (Time(end=1e-8), r"time\.end must be > 1e-06, the shortest semi-implicit step, got 1e-08"),
        (
            Time(max_step=1e-300),
            r"time\.max_step must be > 1e-06, .* got 1e-300; raise it or leave",
        ),
        (
            Time(scheme="explicit", max_step=9e-10),
            r"max_step must be > 1e-09, the shortest explicit",
        ),
    ],
)
def test_times_below_the_shortest_step_are_refused(times, least):
    slow = Parameters(beta=0.1, D=0.0, v_p0=0.0)  # rate 0.1
    with pytest.raises(InvalidInput, match=least):
        resolved(Config(parameters=slow, time=times))
    resolved(Config(parameters=slow, time=Time(end=1.1e-6, max_step=1.1e-6)))
    resolved(Config(parameters=slow, time=Time(scheme="explicit", max_step=1.1e-9)))


def test_parameters_under_which_nothing_happens_have_no_rate():
    with pytest.raises(InvalidInput, match="nothing would ever change"):
        resolved(Config(parameters=Parameters(beta=0, D=0, v_p0=0)))
    for beta in (1e-61, 1e61):
        with pytest.raises(InvalidInput, match=r"must be 1e-60 to 1e.60, got 1e.61; choose"):
            resolved(Config(parameters=Parameters(beta=beta, D=0, v_p0=0)))


def test_an_empty_file_is_the_default_run():
    assert config_from_toml("") == Config()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[mesh", "valid TOML"),
        ("mesh = 3", "section"),
        ("[cell]\na = 1", "unknown section"),
        ("D = 1", "unknown section"),
    ],
)
def test_wrong_files_are_refused(text, says):
    with pytest.raises(InvalidInput, match=says):
        config_from_toml(text)


@pytest.mark.parametrize(
    ("settings", "perturbation"),
    [
        (["c0=2"], 2.0),
        (["c0=1370", "c_r=970"], 1370.0),
        (["c0=2", "law=inverse"], 0.4),
        (["c0=2", "law=v_p0/c"], 0.4),
        (["c0=2", "law=v_p0/(1 + c)"], 2.0),
        (["c0=2", "initial.perturbation=0.5"], 0.5),
        (["c0=2", "initial.from_frame=some.vtp"], 0.0),
    ],
)
def test_the_default_perturbation_is_that_of_the_concentration(settings, perturbation):
    found = resolved(with_settings(Config(), settings)).initial.perturbation
    assert found == pytest.approx(perturbation)


def test_intervals_of_frames_below_the_shortest_step_are_refused():
    with pytest.raises(InvalidInput, match=r"output\.interval must be > 1e-07"):
        resolved(with_settings(Config(), ["output.interval=1e-8"]))
