# SPDX-License-Identifier: Apache-2.0
"""A real coordinator with workers on this machine, and a small scene with exact ground truth."""

import os
import re
import signal
import subprocess
import tempfile
from pathlib import Path
from typing import List, Optional

REPOSITORY = Path(__file__).resolve().parents[3]
PROGRAM = os.environ.get("MESHWRIGHT", str(REPOSITORY / "build/release/bin/meshwright"))
TOKEN = "a-token-for-the-tests-alone"
# Quick, and enough for surfaces that several cameras agree on.
OPTIONS = {"lattice-step": 2, "window": 2, "min-component": 20}


def clean_environment() -> dict:
    """Without the settings that the tests themselves are given."""
    return {name: value for name, value in os.environ.items() if not name.startswith("MESHWRIGHT")}


def synthesize(folder: Path, cameras: int = 6) -> Path:
    size = ["--width", "240", "--height", "180", "--quiet"]
    command = [PROGRAM, "synthesize", "facade", "-o", str(folder), "--cameras", str(cameras), *size]
    subprocess.run(command, check=True, env=clean_environment(), stdout=subprocess.DEVNULL)
    return folder


class Service:
    """meshwright up, in a folder of its own; it can be killed and started anew at the same address."""

    def __init__(self, *, token: Optional[str] = None, workers: int = 1) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="meshwright-python-")
        self.folder = Path(self._folder.name)
        self._workers = workers
        self._rest = "127.0.0.1:0"
        self._arguments: List[str] = []
        if token is not None:
            file = self.folder / "token"
            file.write_text(token)
            self._arguments = ["--api-token-file", str(file)]
        self._process: Optional[subprocess.Popen] = None
        self.start()

    @property
    def url(self) -> str:
        return f"http://{self._rest}"

    def start(self) -> None:
        command = [PROGRAM, "up", "--data", str(self.folder / "data"), "--listen", "127.0.0.1:0"]
        command += ["--rest-listen", self._rest, "--workers", str(self._workers), *self._arguments]
        log = self.folder / "log"
        with open(log, "a") as errors:
            pipes = {"stdout": subprocess.PIPE, "stderr": errors}
            self._process = subprocess.Popen(command, **pipes, env=clean_environment(), text=True)
        said = ""
        while not (found := re.search(r"http://127\.0\.0\.1:(\d+)/", said)):
            line = self._process.stdout.readline()
            if not line:
                raise RuntimeError(f"meshwright up ended with {self._process.wait()}: {log.read_text()}")
            said += line
        self._rest = f"127.0.0.1:{found[1]}"

    def kill(self) -> None:
        self._end(signal.SIGKILL)

    def stop(self) -> None:
        if self._process is not None:
            self._end(signal.SIGTERM)
        self._folder.cleanup()

    def _end(self, how: int) -> None:
        self._process.send_signal(how)
        self._process.wait(timeout=60)
        self._process.stdout.close()
        self._process = None
