# SPDX-License-Identifier: Apache-2.0
"""The local program: a reconstruction on this machine, without a service."""

from __future__ import annotations

import json
import os
import subprocess
from typing import Any, Dict, List, Union

from .errors import ProgramError

_PATH = Union[str, "os.PathLike[str]"]


def run(scene: _PATH, output: _PATH, *, program: _PATH = "meshwright", **options: Any) -> Dict[str, Any]:
    """Runs "meshwright reconstruct SCENE -o OUTPUT" and returns its report.

    options: those of the command with "_" for "-": lattice_step=2 is --lattice-step 2; True stands for a flag. What is there
    of a run that was stopped is used. ProgramError when it fails, with the program's own line.
    """
    command: List[str] = [os.fspath(program), "reconstruct", os.fspath(scene), "-o", os.fspath(output), "--json", "--quiet"]
    for name, value in options.items():
        flag = "--" + name.replace("_", "-")
        if value is True:
            command.append(flag)
        elif value is not False and value is not None:
            command += [flag, str(value)]
    try:
        ended = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, check=False)
    except FileNotFoundError as error:
        raise ProgramError(f"{os.fspath(program)}: there is no such program", 127) from error
    if ended.returncode != 0:
        lines = ended.stderr.decode(errors="replace").strip().splitlines()
        raise ProgramError(lines[-1] if lines else f"exit code {ended.returncode}", ended.returncode)
    return json.loads(ended.stdout)
