# SPDX-License-Identifier: Apache-2.0
"""Readers of files: what was written is what is read, and bytes that are not right say so."""

import array
import importlib.util
import struct
import tempfile
import unittest
import zlib
from pathlib import Path

import meshwright

HAS_NUMPY = importlib.util.find_spec("numpy") is not None


def encode_surface(patches, *, width=7, height=5, step=2):
    """A surface file, from docs/formats/surface.md. patches: {node: (depth, normal, quality, rgb, links)}"""
    columns, rows = (width - step // 2 - 1) // step + 1, (height - step // 2 - 1) // step + 1
    runs = []
    for node in sorted(patches):
        if runs and sum(runs[-1]) == node:
            runs[-1][1] += 1
        else:
            runs.append([node, 1])
    values = [patches[node] for node in sorted(patches)]
    camera = (100.0, 110.0, 3.5, 2.5, 0, -1, 0, 1, 0, 0, 0, 0, 1, 0.5, -0.25, 2.0)
    length = 192 + 8 * len(runs) + 24 * len(values) + 4
    data = struct.pack("<4sIQ6i2Q", b"MWSF", 1, length, 3, width, height, step, columns, rows, len(runs), len(values))
    data += struct.pack("<16dQ", *camera, 0)
    data += b"".join(struct.pack("<II", *run) for run in runs)
    data += b"".join(struct.pack("<f", value[0]) for value in values)
    data += b"".join(struct.pack("<3f", *value[1]) for value in values)
    data += b"".join(struct.pack("<f", value[2]) for value in values)
    data += b"".join(bytes(value[3]) for value in values)
    data += bytes(value[4] for value in values)
    return data + struct.pack("<I", zlib.crc32(data))


PATCHES = {
    0: (2.0, (0, 0, -1), 0.75, (10, 20, 30), 1),
    1: (2.5, (0, 1, 0), 0.5, (11, 21, 31), 0),
    4: (4.0, (1, 0, 0), -0.25, (12, 22, 32), 0),
}


class SurfaceTest(unittest.TestCase):
    def test_reads_what_the_format_says(self):
        surface = meshwright.Surface.parse(encode_surface(PATCHES))
        self.assertEqual((surface.camera_index, surface.width, surface.height, surface.step), (3, 7, 5, 2))
        self.assertEqual((surface.columns, surface.rows, surface.patches), (3, 2, 3))
        self.assertEqual(list(surface.node), [0, 1, 4])
        self.assertEqual(list(surface.depth), [2.0, 2.5, 4.0])
        self.assertEqual(list(surface.normal), [0, 0, -1, 0, 1, 0, 1, 0, 0])
        self.assertEqual(list(surface.quality), [0.75, 0.5, -0.25])
        self.assertEqual(surface.rgb, bytes([10, 20, 30, 11, 21, 31, 12, 22, 32]))
        self.assertEqual(surface.links, bytes([1, 0, 0]))
        self.assertEqual(surface.translation, (0.5, -0.25, 2.0))

    def test_depth_map_has_a_pixel_for_each_node(self):
        depths = meshwright.Surface.parse(encode_surface(PATCHES)).depth_map()
        self.assertEqual((depths.width, depths.height, depths.channels), (3, 2, 1))
        self.assertEqual(list(depths.values), [2.0, 2.5, 0, 0, 4.0, 0])

    @unittest.skipUnless(HAS_NUMPY, "numpy is not installed")
    def test_points_project_to_the_pixels_of_their_nodes(self):
        import numpy

        surface = meshwright.Surface.parse(encode_surface(PATCHES))
        arrays = surface.numpy()
        rotation = numpy.array(surface.rotation).reshape(3, 3)
        in_cam = arrays["points"] @ rotation.T + numpy.array(surface.translation)
        numpy.testing.assert_allclose(in_cam[:, 2], arrays["depth"], atol=1e-12)
        x = in_cam[:, 0] / in_cam[:, 2] * surface.fx + surface.cx
        y = in_cam[:, 1] / in_cam[:, 2] * surface.fy + surface.cy
        numpy.testing.assert_allclose(x, [1.5, 3.5, 3.5], atol=1e-12)
        numpy.testing.assert_allclose(y, [1.5, 1.5, 3.5], atol=1e-12)
        # The same in images with one pixel a node.
        fx, fy, cx, cy = surface.intrinsics()
        numpy.testing.assert_allclose(in_cam[:, 0] / in_cam[:, 2] * fx + cx, [0.5, 1.5, 1.5], atol=1e-12)
        numpy.testing.assert_allclose(in_cam[:, 1] / in_cam[:, 2] * fy + cy, [0.5, 0.5, 1.5], atol=1e-12)

    def test_every_damaged_byte_and_length_is_seen(self):
        data = encode_surface(PATCHES)
        for place in range(len(data)):
            damaged = bytearray(data)
            damaged[place] ^= 0x20
            with self.assertRaises(meshwright.FormatError, msg=f"byte {place}"):
                meshwright.Surface.parse(bytes(damaged))
        for length in range(len(data)):
            with self.assertRaises(meshwright.FormatError, msg=f"length {length}"):
                meshwright.Surface.parse(data[:length])

    def test_counts_that_lie_are_refused_although_the_checksum_is_right(self):
        data = bytearray(encode_surface(PATCHES)[:-4])
        for field, value in ((40, 1 << 60), (48, 1 << 60), (32, 1 << 30), (28, 0)):
            lying = bytearray(data)
            struct.pack_into("<Q" if field in (40, 48) else "<i", lying, field, value)
            with self.assertRaises(meshwright.FormatError, msg=f"field at {field}"):
                meshwright.Surface.parse(bytes(lying) + struct.pack("<I", zlib.crc32(lying)))


ASCII_PLY = b"""ply
format ascii 1.0
comment a square
element vertex 4
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 1
property list uchar int vertex_indices
property uchar flag
end_header
0 0 0 1 2 3
1 0 0 4 5 6
1 1 0 7 8 9
0 1 0.5 10 11 12
4 0 1 2 3 9
"""


def binary_ply(order, word):
    header = f"""ply
format {word} 1.0
element vertex 3
property double x
property double y
property double z
property float quality
element face 2
property list uchar uint vertex_indices
end_header
"""
    vertices = b"".join(struct.pack(order + "3df", i, 2 * i, 3 * i, i / 4) for i in range(3))
    return header.encode() + vertices + 2 * struct.pack(order + "B3I", 3, 0, 1, 2)


class PlyTest(unittest.TestCase):
    def test_ascii(self):
        ply = meshwright.Ply.parse(ASCII_PLY)
        self.assertEqual(list(ply.column("vertex", "z")), [0, 0, 0, 0.5])
        self.assertEqual(list(ply.column("vertex", "blue")), [3, 6, 9, 12])
        self.assertEqual(ply.rows("face"), [((0, 1, 2, 3), 9)])
        self.assertEqual(ply.triangles(), [(0, 1, 2), (0, 2, 3)])

    def test_both_byte_orders(self):
        for order, word in (("<", "binary_little_endian"), (">", "binary_big_endian")):
            ply = meshwright.Ply.parse(binary_ply(order, word))
            self.assertEqual(list(ply.column("vertex", "y")), [0, 2, 4])
            self.assertEqual(ply.triangles(), [(0, 1, 2)] * 2)

    @unittest.skipUnless(HAS_NUMPY, "numpy is not installed")
    def test_arrays_are_the_same_numbers(self):
        import numpy

        for data in (ASCII_PLY, binary_ply("<", "binary_little_endian"), binary_ply(">", "binary_big_endian")):
            ply = meshwright.Ply.parse(data)
            mesh = ply.mesh()
            columns = [ply.column("vertex", name) for name in "xyz"]
            numpy.testing.assert_array_equal(mesh["vertices"], numpy.array(columns).T)
            numpy.testing.assert_array_equal(mesh["triangles"], ply.triangles())
            self.assertEqual("colors" in mesh, data is ASCII_PLY)
            self.assertEqual("quality" in mesh, data is not ASCII_PLY)

    def test_what_breaks_off_or_lies_is_refused(self):
        for data in (ASCII_PLY, binary_ply("<", "binary_little_endian")):
            body = data.index(b"end_header\n") + len(b"end_header\n")
            for end in (0, 3, body - 3, body, body + 7, len(data) - 2):
                with self.assertRaises(meshwright.FormatError, msg=f"{end} of {data[:40]!r}"):
                    meshwright.Ply.parse(data[:end]).triangles()
        for was, becomes in ((b"vertex 3", b"vertex 9999999999"), (b"double x", b"quad x"), (b"uchar uint", b"uint uint")):
            data = binary_ply("<", "binary_little_endian").replace(was, becomes)
            with self.assertRaises(meshwright.FormatError, msg=becomes):
                ply = meshwright.Ply.parse(data)
                ply.column("vertex", "x")
                ply.triangles()


class DepthMapTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = Path(folder.name) / "a.jpg.geometric.bin"

    def test_what_is_written_is_read(self):
        written = meshwright.DepthMap(3, 2, 1, array.array("f", [0, 1, 2, 3, 4, 5.5]))
        meshwright.write_depth_map(written, self.path)
        self.assertTrue(self.path.read_bytes().startswith(b"3&2&1&\0\0\0\0"))
        self.assertEqual(meshwright.read_depth_map(self.path), written)

    @unittest.skipUnless(HAS_NUMPY, "numpy is not installed")
    def test_planes_become_channels(self):
        normals = meshwright.DepthMap(2, 1, 3, array.array("f", [1, 2, 3, 4, 5, 6]))
        self.assertEqual(normals.numpy().tolist(), [[[1, 3, 5], [2, 4, 6]]])

    def test_wrong_lengths_are_refused(self):
        for data in (b"", b"3&2&1", b"3&2&1&abc", b"999999999&999999999&1&", b"-3&2&1&"):
            self.path.write_bytes(data)
            with self.assertRaises(meshwright.FormatError, msg=data):
                meshwright.read_depth_map(self.path)


if __name__ == "__main__":
    unittest.main()
