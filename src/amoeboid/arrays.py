"""Types of arrays: C order, float64 unless a docstring says otherwise."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
"""Numbers, float64; complex where a derivative is taken by a complex step."""

Index = NDArray[np.int64]
"""Numbers of nodes, faces, rows."""
