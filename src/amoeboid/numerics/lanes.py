"""Recorded equations for many sets of inputs side by side, in lanes, with the functions of JAX.

Rows of a program are arrays (lanes, n) here, (lanes, 1) where all n numbers are the same.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from amoeboid.numerics.jacobians import Equations
from amoeboid.numerics.programs import CODES, Program


def rows_of(program: Program, inputs: Any, jnp: Any, barrier: Any) -> list[Any]:
    """All rows of a program for `inputs[name]`, arrays (lanes, n) or (lanes, 1)."""
    unary = {CODES["neg"]: jnp.negative, CODES["sin"]: jnp.sin, CODES["cos"]: jnp.cos,
             CODES["sqrt"]: jnp.sqrt}  # fmt: skip
    binary = {CODES["add"]: jnp.add, CODES["sub"]: jnp.subtract, CODES["mul"]: jnp.multiply,
              CODES["truediv"]: jnp.divide}  # fmt: skip
    uses = np.bincount(program.steps[:, 1:].ravel(), minlength=len(program.row))
    rows: list[Any] = [constant[None, :] for constant in program.constants]
    rows += [inputs[name] for name in program.inputs]
    begin = len(rows)
    given: dict[int, Any] = {}
    for k, (code, a, b) in enumerate(program.steps.tolist()):
        for relation in program.relations:
            if relation.before != k:
                continue
            found = inputs[relation.name](rows[relation.argument], len(relation.results) - 1)
            given |= dict(zip(relation.results, found, strict=True))
        if code == CODES["matmul"]:
            row = rows[b] @ program.matrices[a]
        elif code == CODES["total"]:
            row = jnp.sum(rows[a] * rows[b], axis=1, keepdims=True)
        elif code == CODES["relation"]:
            row = given.get(begin + k)
        elif code in unary:
            row = unary[code](rows[a])
        else:
            row = binary[code](rows[a], rows[b])
        # else it would be computed again wherever it is used
        rows.append(barrier(row) if row is not None and uses[begin + k] > 1 else row)
    return rows


def residual(of: Equations, inputs: Any, jnp: Any, barrier: Any = lambda row: row) -> Any:
    """The values of all equations, (lanes, equations)."""
    return _values(of, of.values, rows_of(of.values, inputs, jnp, barrier), jnp)


def residual_and_jacobian(
    of: Equations, inputs: Any, jnp: Any, barrier: Any = lambda row: row
) -> tuple[Any, Any]:
    """The same and their derivatives (lanes, equations, unknowns)."""
    rows = rows_of(of.everything, inputs, jnp, barrier)
    n = of.maps.shape[1]
    lanes = max(row.shape[0] for row in rows if row is not None)
    groups = _groups(of)
    maps: list[dict[tuple[int, int], Any]] = [
        {span: block[None, :, span[0] : span[1]] for span in groups if _within(span, whole)}
        for block, whole in zip(of.maps, of.spans.tolist(), strict=False)
    ]
    lines: list[Any] = []
    for matrix, count, begin, end, _ in of.fields.tolist():
        total: dict[tuple[int, int], Any] = {}
        for row, which in of.terms[begin:end].tolist():
            diagonal = rows[row][:, :count, None]
            for span, block in maps[which].items():
                part = diagonal * block[:, :count]
                total[span] = total[span] + part if span in total else part
        if matrix < 0:
            shapes = {span: (lanes, count, span[1] - span[0]) for span in groups}
            parts = [jnp.broadcast_to(total.get(span, 0.0), shapes[span]) for span in groups]
            lines.append(jnp.concatenate(parts, axis=2))
        else:
            wide = {span: jnp.broadcast_to(block, (*block.shape[:1], n, block.shape[2]))
                    for span, block in total.items()}  # fmt: skip
            maps.append({span: of.matrices[matrix].T @ block for span, block in wide.items()})
    return _values(of, of.everything, rows, jnp), jnp.concatenate(lines, axis=1)


def _groups(of: Equations) -> list[tuple[int, int]]:
    """The columns between all ends of the maps of inputs."""
    ends = sorted(set(of.spans[: len(of.maps)].ravel().tolist()))
    return list(pairwise(ends))


def _within(span: tuple[int, int], whole: list[int]) -> bool:
    return whole[0] <= span[0] and span[1] <= whole[1]


def _values(of: Equations, program: Program, rows: list[Any], jnp: Any) -> Any:
    n = of.maps.shape[1]
    lanes = max(row.shape[0] for row in rows if row is not None)
    return jnp.concatenate(
        [jnp.broadcast_to(rows[program.row[k]], (lanes, n))[:, :count] for k, count in of.results],
        axis=1,
    )
