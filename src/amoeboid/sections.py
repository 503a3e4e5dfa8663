"""The sections of a configuration: the fields that CONFIG.toml and `--set` can change."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from amoeboid.conditions import condition
from amoeboid.display import short_repr
from amoeboid.model.parameters import Parameters
from amoeboid.validation import (
    InvalidInput,
    automatic,
    choice,
    file,
    flag,
    harmonics,
    integer,
    number,
    numbers,
    texts,
    validate,
    vector,
)

SCHEMES = ("semi-implicit", "explicit")
FINISHES = ("wait", "solve")


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """Section [mesh]."""

    subdivisions: int = integer(
        3, "subdivisions n of the icosahedron: 10 * 4**n + 2 nodes (3: 642)", ge=1, le=6
    )

    def __post_init__(self) -> None:
        validate(self, "mesh")


@dataclass(frozen=True, kw_only=True)
class Initial:
    """Section [initial]: the shape, and c = c0 + perturbation cos(theta) + harmonics + noise.

    theta is the angle between `direction` and r - r_cm (on the sphere: perturbation
    (r - r_cm).direction/R0). The shape is that of `surface`, shape and c0 are those of
    `from_frame`; without either the cell is the sphere of section [mesh].
    """

    __repr__ = short_repr

    perturbation: float = automatic(
        "amplitude of the initial polarization; automatic: c0, c0/5 if the law needs c > 0, 0 "
        "with from_frame",
        "N/L^2",
    )
    direction: tuple[float, float, float] = vector(
        (0.0, 0.0, 1.0), "axis of the initial polarization, towards the rear"
    )
    harmonics: tuple[tuple[int, int, float], ...] = harmonics(
        "real spherical harmonics added to c, polar axis z; [1, 0, a] is a cos(theta)", "N/L^2"
    )
    noise: float = number(0.0, "rms of seeded random noise added to c", "N/L^2", ge=0)
    seed: int = integer(0, "seed of initial.noise", ge=0, le=2**63 - 1)
    surface: str | None = file("closed triangulated surface to start from: stl, ply, obj, vtp")
    repair: bool = flag(
        False,
        "repair initial.surface: join and reorient triangles, and remesh a poor mesh to about "
        "the number of nodes of mesh.subdivisions",
    )
    from_frame: str | None = file("frame (.vtp) of another run from which to start")

    def __post_init__(self) -> None:
        validate(self, "initial")
        if self.surface is not None and self.from_frame is not None:
            raise InvalidInput(
                f"a run must have only one initial shape, got initial.surface = {self.surface!r} "
                f"and initial.from_frame = {self.from_frame!r}; leave one out"
            )
        if self.repair and self.surface is None:
            raise InvalidInput(
                "initial.repair must be false without initial.surface, got true; give a surface "
                "or leave it out"
            )


@dataclass(frozen=True, kw_only=True)
class Time:
    """Section [time]."""

    __repr__ = short_repr

    end: float = automatic(
        "time at which the run ends; automatic: 200/rate after the last change of a parameter",
        "T",
        gt=0,
    )
    scheme: str = choice("semi-implicit", "time stepping", SCHEMES)
    tolerance: float = number(1e-3, "error tolerated in one step, relative to c0 and R0", gt=0)
    max_step: float = automatic(
        "longest time step; automatic: 0.5/rate, with shot noise 0.05/rate; explicit: the step "
        "itself, 1e-5/rate",
        "T",
        gt=0,
    )
    stop_when_steady: bool = flag(
        True, "end the run once the cell is steady: it does not change, and no perturbation grows"
    )
    finish: str = choice(
        "wait",
        "how a run reaches the steady cell: wait for it, or solve the steady equations once it "
        "is near",
        FINISHES,
    )
    until: tuple[str, ...] = texts(
        "further conditions that end the run, such as 'polarity > 0.5'", condition
    )

    def __post_init__(self) -> None:
        validate(self, "time")


@dataclass(frozen=True, kw_only=True)
class Output:
    """Section [output]."""

    __repr__ = short_repr

    interval: float = automatic(
        "time between two frames; automatic: 0.5/rate; frames are at its multiples and at the end",
        "T",
        gt=0,
    )
    times: tuple[float, ...] = numbers(
        "times of the frames in ascending order, instead of the interval", "T"
    )

    def __post_init__(self) -> None:
        validate(self, "output")


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Section [noise]: shot noise of turnover and diffusion, see docs/noise.md.

    Filaments are counted, so that the strength of the noise is no free parameter: `filaments` is
    their number on the homogeneous cell, 4 pi R0^2 c0 in numbers. 0: there is no noise.
    """

    __repr__ = short_repr

    filaments: float = number(
        0.0, "shot noise: filament number of the homogeneous cell, 4 pi R0^2 c0; 0: no noise", ge=0
    )
    seed: int = integer(0, "seed of the shot noise", ge=0, le=2**63 - 1)

    def __post_init__(self) -> None:
        validate(self, "noise")

    @classmethod
    def counted(cls, parameters: Parameters, seed: int = 0) -> Noise:
        """The noise of a cell in physical units, whose filaments are counted: 4 pi R0^2 c0.

        `seed`: that of its random numbers. Raises InvalidInput for parameters without units.

        >>> print(f"{Noise.counted(Parameters.physical()).filaments:.4g}")
        1.722e+06
        """
        p = parameters
        if p.units is None:
            raise InvalidInput(
                "counting the filaments of a cell needs parameters with units, these have none; "
                "start from Parameters.physical, or give Noise(filaments=...)"
            )
        return cls(filaments=4.0 * math.pi * p.R0**2 * p.c0 * p.units.of("N"), seed=seed)

    @property
    def acts(self) -> bool:
        """Whether there is noise."""
        return self.filaments > 0.0


def checked_noise(given: Any) -> Noise:
    """The noise that is given. Raises InvalidInput for another object."""
    if isinstance(given, Noise):
        return given
    raise InvalidInput(f"noise must be amoeboid.Noise(filaments=..., seed=...), got {given!r:.100}")
