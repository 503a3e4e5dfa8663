"""Arrays of another library, such as JAX, in the arithmetic and functions of NumPy.

NumPy hands its functions over to an argument that asks for it (NEP 13 and 18): a Python function
made of arithmetic and functions of NumPy can then be called with a `Traced` in place of an array.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from amoeboid.numerics.taylor import Taylor


class NotTraceable(TypeError):
    """What is called with a Traced needs the numbers themselves."""


class Traced(NDArrayOperatorsMixin):
    """An array whose numbers are not known yet, of the library `functions`."""

    def __init__(self, array: Any, functions: Any) -> None:
        self.array = array
        self.functions = functions

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """The function of the same name of the library."""
        if method != "__call__" or options or any(isinstance(x, Taylor) for x in inputs):
            return NotImplemented
        return self._called(ufunc.__name__, inputs, {})

    def __array_function__(self, function: Any, _: Any, inputs: Any, options: Any) -> Any:
        """The function of the same name of the library."""
        return self._called(function.__name__, inputs, options)

    def _called(self, name: str, inputs: Any, options: dict[str, Any]) -> Any:
        function = getattr(self.functions, name, None)
        if function is None:
            raise NotTraceable(f"numpy.{name} has no counterpart there")
        return Traced(function(*map(untraced, inputs), **options), self.functions)

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        """Raises NotTraceable."""
        raise NotTraceable("it is converted to an array before its values are known")

    def __bool__(self) -> bool:
        raise NotTraceable("it branches on values before they are known; use np.where")

    __float__ = __int__ = __index__ = __bool__

    @property
    def real(self) -> Traced:
        """The real part."""
        return Traced(self.functions.real(self.array), self.functions)

    @property
    def shape(self) -> tuple[int, ...]:
        """As of arrays."""
        return tuple(self.array.shape)

    @property
    def ndim(self) -> int:
        """As of arrays."""
        return len(self.array.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """As of arrays."""
        return np.dtype(self.array.dtype)

    def __getitem__(self, at: Any) -> Traced:
        return Traced(self.array[at], self.functions)


def untraced(value: Any) -> Any:
    """The array of the library."""
    if isinstance(value, tuple | list):
        return type(value)(map(untraced, value))
    return value.array if isinstance(value, Traced) else value
