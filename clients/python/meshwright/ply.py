# SPDX-License-Identifier: Apache-2.0
"""PLY 1.0 (Turk, 1994): ascii and binary of either byte order, any properties."""

from __future__ import annotations

import array
import os
import re
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, Iterator, List, Optional, Sequence, Tuple, Union

from .arrays import require_numpy
from .errors import FormatError

# Name in a header -> code of struct and array, and of numpy.
_TYPES = {
    **dict.fromkeys(("char", "int8"), ("b", "i1")),
    **dict.fromkeys(("uchar", "uint8"), ("B", "u1")),
    **dict.fromkeys(("short", "int16"), ("h", "i2")),
    **dict.fromkeys(("ushort", "uint16"), ("H", "u2")),
    **dict.fromkeys(("int", "int32"), ("i", "i4")),
    **dict.fromkeys(("uint", "uint32"), ("I", "u4")),
    **dict.fromkeys(("float", "float32"), ("f", "f4")),
    **dict.fromkeys(("double", "float64"), ("d", "f8")),
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_END_OF_HEADER = re.compile(rb"end_header(\r\n|\n|\r)")


@dataclass(frozen=True)
class Property:
    """name, and struct's code of the values; count_type: of a list's length, None when it is no list."""

    name: str
    type: str
    numpy_type: str
    count_type: Optional[str] = None


@dataclass(frozen=True)
class Element:
    """name, number of rows, and what a row has."""

    name: str
    count: int
    properties: Tuple[Property, ...]

    @property
    def has_lists(self) -> bool:
        return any(item.count_type is not None for item in self.properties)


class Ply:
    """A PLY file in memory. Rows are decoded when they are asked for."""

    def __init__(self, name: str, order: str, elements: Tuple[Element, ...], body: memoryview) -> None:
        self._name = name
        self._order = order  # struct's; "" for ascii
        self._body = body
        self.elements = elements

    @staticmethod
    def parse(data: bytes, name: str = "ply") -> "Ply":
        """FormatError when the bytes are no PLY. `name` stands for them in messages."""
        end = _END_OF_HEADER.search(data, 0, 1 << 20)
        if not data.startswith(b"ply") or not end:
            raise FormatError(f"{name}: begins with {data[:16]!r}, expected a PLY header")
        order, elements = _parse_header(data[: end.start()].decode("latin-1").splitlines(), name)
        return Ply(name, order, elements, memoryview(data)[end.end() :])

    def element(self, name: str) -> Element:
        """FormatError when there is none."""
        for element in self.elements:
            if element.name == name:
                return element
        raise FormatError(f"{self._name}: has no element {name}")

    def rows(self, name: str) -> List[Tuple[Any, ...]]:
        """All rows of an element: a tuple each, lists as tuples. Without numpy."""
        rows: List[Tuple[Any, ...]] = []
        words = iter(self._body.tobytes().split()) if not self._order else iter(())
        offset = 0
        for element in self.elements:
            try:
                if not self._order:
                    rows = [_ascii_row(element, words) for _ in range(element.count)]
                else:
                    rows, offset = self._binary_rows(element, offset)
            except (struct.error, ValueError) as error:
                raise FormatError(f"{self._name}: element {element.name} breaks off ({error})") from error
            if element.name == name:
                return rows
        raise FormatError(f"{self._name}: has no element {name}")

    def column(self, element: str, name: str) -> "array.array[Any]":
        """One property of all rows, which is no list. Without numpy."""
        properties = self.element(element).properties
        for place, item in enumerate(properties):
            if item.name == name and item.count_type is None:
                return array.array(item.type, (row[place] for row in self.rows(element)))
        raise FormatError(f"{self._name}: element {element} has no property {name} that is a number")

    def triangles(self) -> List[Tuple[int, int, int]]:
        """Corners of all faces; polygons become fans. Without numpy."""
        place = self._place_of_corners()
        triangles = []
        for row in self.rows("face"):
            corners = row[place]
            triangles += [(corners[0], corners[i], corners[i + 1]) for i in range(1, len(corners) - 1)]
        return triangles

    def mesh(self) -> Dict[str, Any]:
        """numpy arrays: vertices (V, 3), triangles (F, 3), and those of normals (V, 3), colors (V, 3) uint8, quality and

        camera (V,) that the file has. Needs numpy.
        """
        numpy = require_numpy()
        vertices = self._table(self.element("vertex"))
        mesh = {"vertices": _stacked(numpy, vertices, ("x", "y", "z"))}
        if any(element.name == "face" for element in self.elements):
            mesh["triangles"] = self._triangle_array(numpy)
        else:
            mesh["triangles"] = numpy.zeros((0, 3), numpy.int64)
        names = vertices.dtype.names
        for key, properties in (("normals", ("nx", "ny", "nz")), ("colors", ("red", "green", "blue"))):
            if all(name in names for name in properties):
                mesh[key] = _stacked(numpy, vertices, properties)
        for key, name in (("quality", "quality"), ("camera", "camera_index")):
            if name in names:
                mesh[key] = numpy.ascontiguousarray(vertices[name])
        return mesh

    def _place_of_corners(self) -> int:
        for place, item in enumerate(self.element("face").properties):
            if item.name in ("vertex_indices", "vertex_index") and item.count_type is not None:
                return place
        raise FormatError(f"{self._name}: element face has no list vertex_indices")

    def _binary_rows(self, element: Element, offset: int) -> Tuple[List[Tuple[Any, ...]], int]:
        if not element.has_lists:
            row = struct.Struct(self._order + "".join(item.type for item in element.properties))
            end = offset + row.size * element.count
            if end > len(self._body):
                raise ValueError(f"{len(self._body) - offset} bytes, expected {end - offset}")
            return list(row.iter_unpack(self._body[offset:end])), end
        rows = []
        for _ in range(element.count):
            values: List[Any] = []
            for item in element.properties:
                if item.count_type is None:
                    code = self._order + item.type
                    values += struct.unpack_from(code, self._body, offset)
                else:
                    count_code = self._order + item.count_type
                    (count,) = struct.unpack_from(count_code, self._body, offset)
                    offset += struct.calcsize(count_code)
                    code = f"{self._order}{count}{item.type}"
                    values.append(struct.unpack_from(code, self._body, offset))
                offset += struct.calcsize(code)
            rows.append(tuple(values))
        return rows, offset

    def _table(self, element: Element) -> Any:
        """A structured numpy array of an element without lists."""
        numpy = require_numpy()
        if element.has_lists:
            raise FormatError(f"{self._name}: element {element.name} has a list, expected numbers")
        order = self._order or "="
        kind = numpy.dtype([(item.name, order + item.numpy_type) for item in element.properties])
        is_first = self.elements[0] is element
        if not self._order or not is_first:
            return numpy.array(self.rows(element.name), dtype=kind)
        if kind.itemsize * element.count > len(self._body):
            raise FormatError(f"{self._name}: element {element.name} breaks off")
        return numpy.frombuffer(self._body, dtype=kind, count=element.count)

    def _triangle_array(self, numpy: Any) -> Any:
        faces = self.element("face")
        before = self.elements[: self.elements.index(faces)]
        is_plain = self._order and len(faces.properties) == 1 and not any(item.has_lists for item in before)
        if is_plain:  # as all writers of triangles leave it
            corners = faces.properties[self._place_of_corners()]
            offset = sum(
                struct.calcsize(self._order + "".join(item.type for item in element.properties)) * element.count
                for element in before
            )
            row = struct.Struct(f"{self._order}{corners.count_type}3{corners.type}")
            if offset + row.size * faces.count <= len(self._body):
                count_type = numpy.dtype(self._order + corners.count_type)
                kind = numpy.dtype([("count", count_type), ("corner", self._order + corners.numpy_type, 3)])
                table = numpy.frombuffer(self._body, dtype=kind, count=faces.count, offset=offset)
                if (table["count"] == 3).all():
                    return table["corner"].astype(numpy.int64)
        return numpy.array(self.triangles(), dtype=numpy.int64).reshape(-1, 3)


def read_ply(path: Union[str, "os.PathLike[str]"]) -> Ply:
    """A PLY file. FormatError when it is none."""
    return Ply.parse(Path(path).read_bytes(), str(path))


def _stacked(numpy: Any, table: Any, names: Sequence[str]) -> Any:
    missing = [name for name in names if name not in table.dtype.names]
    if missing:
        raise FormatError(f"vertices have no property {missing[0]}")
    return numpy.stack([table[name] for name in names], axis=1)


def _parse_header(lines: List[str], name: str) -> Tuple[str, Tuple[Element, ...]]:
    order: Optional[str] = None
    elements: List[Element] = []
    for number, line in enumerate(lines, start=1):
        words = line.split()
        try:
            if not words or words[0] in ("ply", "comment", "obj_info"):
                continue
            if words[0] == "format":
                order = _ORDERS[words[1]]
            elif words[0] == "element":
                elements.append(Element(words[1], int(words[2]), ()))
            elif words[0] == "property":
                last = elements[-1]
                elements[-1] = Element(last.name, last.count, (*last.properties, _parse_property(words)))
            else:
                raise ValueError
        except (KeyError, IndexError, ValueError) as error:
            raise FormatError(f"{name}: line {number} is {line[:80]!r}, expected one of a PLY header") from error
    if order is None:
        raise FormatError(f"{name}: has no line format")
    return order, tuple(elements)


def _parse_property(words: List[str]) -> Property:
    if words[1] == "list":
        return Property(words[4], *_TYPES[words[3]], count_type=_TYPES[words[2]][0])
    return Property(words[2], *_TYPES[words[1]])


def _ascii_row(element: Element, words: Iterator[bytes]) -> Tuple[Any, ...]:
    def number(code: str) -> Any:
        word = next(words, b"")  # which is no number
        return float(word) if code in "fd" else int(word)

    return tuple(
        number(item.type)
        if item.count_type is None
        else tuple(number(item.type) for _ in range(number(item.count_type)))
        for item in element.properties
    )
