# SPDX-License-Identifier: Apache-2.0
"""Depth and normal maps in COLMAP's layout (stereo/depth_maps/NAME.geometric.bin)."""

from __future__ import annotations

import array
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Union

from .arrays import column_from, require_numpy
from .errors import FormatError

_HEADER = re.compile(rb"(\d{1,9})&(\d{1,9})&(\d{1,9})&")
_FLOAT_BYTES = 4


@dataclass(frozen=True)
class DepthMap:
    """A map of numbers.

    Depth is z in the camera's frame, 0 where there is none. values: float32, `channels` planes, each row by row. Pixel
    (column, row) of plane c: values[(c * height + row) * width + column].
    """

    width: int
    height: int
    channels: int
    values: "array.array[float]"

    def numpy(self) -> Any:
        """float32 (height, width), or (height, width, channels) when there are several. Needs numpy."""
        numpy = require_numpy()
        planes = numpy.array(self.values, dtype=numpy.float32).reshape(self.channels, self.height, self.width)
        return planes[0] if self.channels == 1 else planes.transpose(1, 2, 0)


def read_depth_map(path: Union[str, "os.PathLike[str]"]) -> DepthMap:
    """FormatError when it is none."""
    data = Path(path).read_bytes()
    header = _HEADER.match(data)
    if not header:
        raise FormatError(f"{path}: begins with {data[:16]!r}, expected WIDTH&HEIGHT&CHANNELS&")
    width, height, channels = (int(number) for number in header.groups())
    expected = header.end() + _FLOAT_BYTES * width * height * channels
    if len(data) != expected:
        raise FormatError(f"{path}: has {len(data)} bytes, expected {expected} for {width} x {height} x {channels}")
    return DepthMap(width, height, channels, column_from("f", data[header.end() :]))


def write_depth_map(depth_map: DepthMap, path: Union[str, "os.PathLike[str]"]) -> None:
    """As COLMAP reads it."""
    values = array.array("f", depth_map.values)
    if sys.byteorder != "little":
        values.byteswap()
    header = f"{depth_map.width}&{depth_map.height}&{depth_map.channels}&".encode()
    Path(path).write_bytes(header + values.tobytes())
