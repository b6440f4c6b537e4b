# SPDX-License-Identifier: Apache-2.0
"""What the readers of files share: columns of numbers without numpy, and numpy when it is asked for."""

from __future__ import annotations

import array
import sys
from typing import Any

from .errors import MeshwrightError


def require_numpy() -> Any:
    """The module numpy. MeshwrightError when it is not installed."""
    try:
        import numpy
    except ImportError as error:
        raise MeshwrightError("numpy is not installed (pip install numpy, apt-get install python3-numpy)") from error
    return numpy


def column_from(typecode: str, data: bytes, little_endian: bool = True) -> "array.array[Any]":
    """Numbers of one type that lie one behind the other."""
    values = array.array(typecode)
    values.frombytes(data)
    if little_endian != (sys.byteorder == "little"):
        values.byteswap()
    return values
