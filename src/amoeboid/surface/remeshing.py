"""The 3D cell on a better mesh; see `meshes.remeshing`."""

from __future__ import annotations

from dataclasses import replace

from amoeboid.arrays import Array
from amoeboid.meshes import remeshing
from amoeboid.meshes.connectivity import connectivity
from amoeboid.surface.model import Model
from amoeboid.surface.state import State


def due(model: Model, state: State, tried: Array | None) -> bool:
    """Whether to try remeshing; see `meshes.remeshing.due`."""
    return remeshing.due(state.r, model.mesh.faces, model.edge_length, tried)


def remeshed(model: Model, state: State) -> tuple[Model, State]:
    """`model` and `state` on a better mesh; the same objects if the mesh is not changed.

    The number of filaments and the area A0 are kept exactly, the shape up to the change of the
    polyhedron. Earlier states cannot be used on the new mesh, because the velocity of a discrete
    surface depends on its mesh.
    """
    new = remeshing.remeshed(state.r, state.c, model.mesh.faces, model.edge_length, model.A0)
    if new is None:
        return model, state
    r, c, faces = new
    changed = replace(state, r=r, c=c, angular_velocity=None)
    return model.on(connectivity(faces)), changed
