# SPDX-License-Identifier: Apache-2.0
"""Surfaces of single cameras, as they lie in the blob store (docs/formats/surface.md)."""

from __future__ import annotations

import array
import os
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Tuple, Union

from .arrays import column_from, require_numpy
from .depth_map import DepthMap
from .errors import FormatError

_MAGIC = b"MWSF"
_VERSION = 1
_HEADER = struct.Struct("<4sIQ6i2Q16dQ")
_CHECKSUM_BYTES = 4
_RUN_BYTES = 8
_PATCH_BYTES = 24
_MOST_NODES = 1 << 28


@dataclass(frozen=True)
class Surface:
    """Patches on a lattice of rays of one photograph.

    Node (column, row) has the index row * columns + column; its ray goes through pixel step * column + step // 2 + 0.5,
    likewise in y, where (0.5, 0.5) is the centre of the top-left pixel. All columns have one entry a patch, nodes
    ascending; `normal` and `rgb` have three.
    """

    camera_index: int
    width: int  # of the photograph, px
    height: int
    step: int  # px
    columns: int
    rows: int
    fx: float  # px; without distortion
    fy: float
    cx: float
    cy: float
    rotation: Tuple[float, ...]  # cam_from_world, row by row
    translation: Tuple[float, ...]
    node: "array.array[int]"
    depth: "array.array[float]"  # z in the camera's frame, scene units
    normal: "array.array[float]"  # unit vectors in world coordinates
    quality: "array.array[float]"  # photo-consistency, -1..1
    rgb: bytes  # sRGB
    links: bytes  # bit 0: connected with the node to the right, bit 1: with the one below

    @staticmethod
    def parse(data: bytes, name: str = "surface") -> "Surface":
        """FormatError when the bytes are damaged or of another version. `name` stands for them in messages."""
        fields = _read_header(data, name)
        camera_index, width, height, step, columns, rows, runs, patches = fields[:8]
        numbers = fields[8]
        offset = _HEADER.size + runs * _RUN_BYTES
        node = _nodes_of_runs(data[_HEADER.size : offset], columns * rows, patches, name)

        def take(size: int) -> bytes:
            nonlocal offset
            begin, offset = offset, offset + size * patches
            return data[begin:offset]

        return Surface(
            camera_index,
            width,
            height,
            step,
            columns,
            rows,
            *numbers[:4],
            rotation=numbers[4:13],
            translation=numbers[13:16],
            node=node,
            depth=column_from("f", take(4)),
            normal=column_from("f", take(12)),
            quality=column_from("f", take(4)),
            rgb=take(3),
            links=take(1),
        )

    @property
    def patches(self) -> int:
        """How many nodes have one."""
        return len(self.node)

    def depth_map(self) -> DepthMap:
        """Depths of all nodes, 0 where there is no patch: one pixel a node. intrinsics() belongs to it."""
        values = array.array("f", bytes(4 * self.columns * self.rows))
        for node, depth in zip(self.node, self.depth):
            values[node] = depth
        return DepthMap(self.columns, self.rows, 1, values)

    def intrinsics(self) -> Tuple[float, float, float, float]:
        """fx, fy, cx, cy for images with one pixel a node: the centre of the top-left pixel is (0.5, 0.5)."""
        first = self.step // 2 + 0.5  # pixel of node 0
        return (
            self.fx / self.step,
            self.fy / self.step,
            (self.cx - first) / self.step + 0.5,
            (self.cy - first) / self.step + 0.5,
        )

    def numpy(self) -> Dict[str, Any]:
        """numpy arrays over the patches: node (P,), depth (P,), normal (P, 3), quality (P,), rgb (P, 3), links (P,), and

        points (P, 3), float64 in world coordinates. Needs numpy.
        """
        numpy = require_numpy()
        arrays = {
            "node": numpy.array(self.node, dtype=numpy.int64),
            "depth": numpy.array(self.depth, dtype=numpy.float32),
            "normal": numpy.array(self.normal, dtype=numpy.float32).reshape(-1, 3),
            "quality": numpy.array(self.quality, dtype=numpy.float32),
            "rgb": numpy.frombuffer(self.rgb, dtype=numpy.uint8).reshape(-1, 3),
            "links": numpy.frombuffer(self.links, dtype=numpy.uint8),
        }
        x = arrays["node"] % self.columns * self.step + self.step // 2 + 0.5
        y = arrays["node"] // self.columns * self.step + self.step // 2 + 0.5
        z = arrays["depth"].astype(numpy.float64)
        in_cam = numpy.stack([(x - self.cx) / self.fx * z, (y - self.cy) / self.fy * z, z], axis=1)
        # x_in_world = rotation^T (x_in_cam - translation), a row each
        rotation = numpy.array(self.rotation).reshape(3, 3)
        arrays["points"] = (in_cam - numpy.array(self.translation)) @ rotation
        return arrays


def read_surface(path: Union[str, "os.PathLike[str]"]) -> Surface:
    """A surface file. FormatError when it is damaged."""
    return Surface.parse(Path(path).read_bytes(), str(path))


def _bad(name: str, field: str, value: object, expected: object) -> FormatError:
    return FormatError(f"{name}: {field} is {value}, expected {expected}")


def _read_header(data: bytes, name: str) -> Tuple[int, int, int, int, int, int, int, int, Tuple[float, ...]]:
    """camera_index, width, height, step, columns, rows, runs, patches, and the numbers of the camera."""
    least = _HEADER.size + _CHECKSUM_BYTES
    if len(data) < least:
        raise _bad(name, "length", len(data), f"at least {least} bytes")
    fields: List[Any] = list(_HEADER.unpack_from(data))
    magic, version, length = fields[:3]
    if magic != _MAGIC:
        raise _bad(name, "magic", magic, _MAGIC)
    if version != _VERSION:
        raise _bad(name, "version", version, _VERSION)
    if length != len(data):
        raise _bad(name, "length in the header", length, f"the number of bytes, {len(data)}")
    (said,) = struct.unpack_from("<I", data, len(data) - _CHECKSUM_BYTES)
    computed = zlib.crc32(memoryview(data)[:-_CHECKSUM_BYTES])
    if said != computed:
        raise _bad(name, "checksum", f"{said:08x}", f"{computed:08x}, that of the bytes")
    camera_index, width, height, step, columns, rows, runs, patches = fields[3:11]
    if step < 1 or width < 0 or height < 0:
        raise _bad(name, "lattice step and image size", (step, width, height), "at least 1 and no negative numbers")
    expected = tuple(max(0, (size - step // 2 - 1) // step + 1) for size in (width, height))
    if (columns, rows) != expected or columns * rows > _MOST_NODES:
        raise _bad(name, "lattice", (columns, rows), f"{expected}, at most {_MOST_NODES} nodes")
    if runs * _RUN_BYTES + patches * _PATCH_BYTES != len(data) - least:
        raise _bad(name, "number of runs and patches", (runs, patches), f"as many as fill {len(data) - least} bytes")
    return camera_index, width, height, step, columns, rows, runs, patches, tuple(fields[11:27])


def _nodes_of_runs(data: bytes, nodes: int, patches: int, name: str) -> "array.array[int]":
    node = array.array("l")
    next_node = 0  # at which the next run may begin
    for first, length in struct.iter_unpack("<II", data):
        if first < next_node or length == 0 or first + length > nodes or len(node) + length > patches:
            raise _bad(name, "run", f"{first} + {length}", f"nodes in {next_node}..{nodes - 1}, {patches} in all")
        node.extend(range(first, first + length))
        next_node = first + length + 1
    if len(node) != patches:
        raise _bad(name, "sum of the runs' lengths", len(node), f"the number of patches, {patches}")
    return node
