# SPDX-License-Identifier: Apache-2.0
"""What docs/python.md shows runs as it stands there, one block behind the other."""

import contextlib
import importlib.util
import io
import os
import re
import unittest

import meshwright

from . import service

PAGE = service.REPOSITORY / "docs/python.md"
ADDRESS = "http://127.0.0.1:7421"
# A small scene, so that it takes seconds.
SCENE_OPTIONS = '{"lattice-step": 2}'


class DocumentationTest(unittest.TestCase):
    def test_every_block_runs(self):
        if importlib.util.find_spec("numpy") is None:
            self.skipTest("numpy is not installed (apt-get install python3-numpy)")
        one = service.Service(workers=1)
        self.addCleanup(one.stop)
        service.synthesize(one.folder / "my-scene")
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(one.folder)
        names = {}
        blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
        self.assertGreater(len(blocks), 4)
        self.assertIn(SCENE_OPTIONS, blocks[0])
        for block in blocks:
            foreign = re.findall(r"^import (open3d|trimesh)", block, re.MULTILINE)
            if foreign and importlib.util.find_spec(foreign[0]) is None:
                print(f"{foreign[0]} is not installed: its block was not run")
                continue
            code = block.replace(ADDRESS, one.url).replace('program="meshwright"', f"program={service.PROGRAM!r}")
            said = io.StringIO()
            with contextlib.redirect_stdout(said):
                exec(compile(code, str(PAGE), "exec"), names)
        self.assertTrue(meshwright.read_ply(one.folder / "mesh.ply").triangles())


if __name__ == "__main__":
    unittest.main()
