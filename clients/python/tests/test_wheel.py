# SPDX-License-Identifier: Apache-2.0
"""The wheel: made and installed without any network, and of the project's version."""

import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from . import service

PACKAGE = service.REPOSITORY / "clients/python"


class WheelTest(unittest.TestCase):
    def test_it_is_made_and_installed_offline(self):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            wheel = self.make_wheel(folder)
            again = self.make_wheel(folder / "again")
            self.assertEqual(wheel.read_bytes(), again.read_bytes())
            self.assertRegex(wheel.name, r"^meshwright-[0-9.]+-py3-none-any\.whl$")
            installed = folder / "installed"
            self.pip(folder, "install", "--no-index", "--no-deps", "--target", str(installed), str(wheel))
            self.assertTrue((installed / "meshwright/py.typed").exists())
            names = {path.name for path in (installed / "meshwright").glob("*.py")}
            self.assertEqual(names, {path.name for path in (PACKAGE / "meshwright").glob("*.py")})
            said = subprocess.run(
                [sys.executable, "-I", "-S", "-c", f"import sys; sys.path.insert(0, {str(installed)!r})\n"
                 "import meshwright; print(meshwright.Client('https://example:1/'))"],
                check=True, cwd=folder, stdout=subprocess.PIPE, text=True,
            ).stdout  # fmt: skip
            self.assertEqual(said, "Client('https://example:1')\n")

    def make_wheel(self, folder):
        subprocess.run([str(service.REPOSITORY / "scripts/build-wheel"), str(folder)], check=True)
        (wheel,) = folder.glob("*.whl")
        return wheel

    def pip(self, folder, *arguments):
        command = [sys.executable, "-m", "pip", "--isolated", "--disable-pip-version-check", *arguments]
        ended = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.assertEqual(ended.returncode, 0, ended.stdout)

    def test_its_version_is_the_projects(self):
        of_package = re.search(r'^version = "(.*)"$', (PACKAGE / "pyproject.toml").read_text(), re.MULTILINE)[1]
        of_project = re.search(r"project\(meshwright VERSION (\S+)", (service.REPOSITORY / "CMakeLists.txt").read_text())[1]
        self.assertEqual(of_package, of_project)


if __name__ == "__main__":
    unittest.main()
