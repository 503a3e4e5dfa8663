"""Recorded equations for many sets of inputs side by side, in lanes, with the functions of JAX.

Rows of a program are arrays (lanes, n) here, (lanes, 1) where all n numbers are the same.
"""

from __future__ import annotations

from typing import Any

from amoeboid.numerics.jacobians import Equations
from amoeboid.numerics.programs import CODES, Program


def rows_of(program: Program, inputs: Any, jnp: Any) -> list[Any]:
    """All rows of a program for `inputs[name]`, arrays (lanes, n) or (lanes, 1)."""
    unary = {CODES["neg"]: jnp.negative, CODES["sin"]: jnp.sin, CODES["cos"]: jnp.cos,
             CODES["sqrt"]: jnp.sqrt}  # fmt: skip
    binary = {CODES["add"]: jnp.add, CODES["sub"]: jnp.subtract, CODES["mul"]: jnp.multiply,
              CODES["truediv"]: jnp.divide}  # fmt: skip
    rows: list[Any] = [constant[None, :] for constant in program.constants]
    rows += [inputs[name] for name in program.inputs]
    begin = len(rows)
    given: dict[int, Any] = {}
    relations = {relation.before: relation for relation in program.relations}
    for k, (code, a, b) in enumerate(program.steps.tolist()):
        if k in relations:
            relation = relations[k]
            found = inputs[relation.name](rows[relation.argument], len(relation.results) - 1)
            given |= dict(zip(relation.results, found, strict=True))
        if code == CODES["matmul"]:
            rows.append(rows[b] @ program.matrices[a])
        elif code == CODES["relation"]:
            rows.append(given.get(begin + k))
        elif code in unary:
            rows.append(unary[code](rows[a]))
        else:
            rows.append(binary[code](rows[a], rows[b]))
    return rows


def residual(of: Equations, inputs: Any, jnp: Any) -> Any:
    """The values of all equations, (lanes, equations)."""
    return _values(of, of.values, rows_of(of.values, inputs, jnp), jnp)


def residual_and_jacobian(of: Equations, inputs: Any, jnp: Any) -> tuple[Any, Any]:
    """The same and their derivatives (lanes, equations, unknowns)."""
    rows = rows_of(of.everything, inputs, jnp)
    n, size = of.maps.shape[1:]
    lanes = max(row.shape[0] for row in rows if row is not None)
    products: list[Any] = []
    lines: list[Any] = []
    for matrix, count, begin, end in of.fields.tolist():
        total: Any = 0.0
        for row, which in of.terms[begin:end].tolist():
            low, high = of.spans[which].tolist()
            diagonal = jnp.broadcast_to(rows[row], (lanes, n))[:, :count, None]
            if which < len(of.maps):
                part = diagonal * of.maps[which][None, :count, low:high]
            else:
                part = diagonal * products[which - len(of.maps)][:, :count, low:high]
            total = total + jnp.pad(part, ((0, 0), (0, 0), (low, size - high)))
        if matrix < 0:
            lines.append(total)
        else:
            products.append(jnp.matmul(of.matrices[matrix].T, total))
    return _values(of, of.everything, rows, jnp), jnp.concatenate(lines, axis=1)


def _values(of: Equations, program: Program, rows: list[Any], jnp: Any) -> Any:
    n = of.maps.shape[1]
    lanes = max(row.shape[0] for row in rows if row is not None)
    return jnp.concatenate(
        [
            jnp.broadcast_to(rows[program.row[k]], (lanes, n))[:, :count]
            for k, count in of.results
        ],
        axis=1,
    )
