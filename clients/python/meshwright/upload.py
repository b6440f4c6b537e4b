# SPDX-License-Identifier: Apache-2.0
"""Sending the files of a scene: what is there already stays, and what broke off goes on."""

from __future__ import annotations

import hashlib
import json
import os
import urllib.parse
from pathlib import Path
from typing import Any, Dict, Iterator, List, Tuple

from .errors import MeshwrightError, ServiceError
from .transport import Transport, quote

_PART_BYTES = 64 << 20
_READ_BYTES = 1 << 20
_DEEPEST = 8  # links may go in circles
_WRONG_OFFSET = 409
_WRONG_DIGEST = 422


def files_of_scene(folder: Path) -> List[str]:
    """Paths below the folder that a scene may consist of, with "/": neither hidden files nor meshes."""
    if not folder.is_dir():
        raise MeshwrightError(f"{folder}: no such folder")
    paths = sorted(_walk(folder, "", 0))
    if not paths:
        raise MeshwrightError(f"{folder}: has no files, expected photographs and their cameras")
    return paths


def _walk(folder: Path, prefix: str, depth: int) -> Iterator[str]:
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith("."):
                continue
            if entry.is_dir():
                if depth < _DEEPEST:
                    yield from _walk(Path(entry.path), f"{prefix}{entry.name}/", depth + 1)
            elif entry.is_file() and not entry.name.endswith(".ply"):
                yield prefix + entry.name


class SceneUpload:
    """The files of one folder, looked at before anything is asked of the coordinator."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._paths = files_of_scene(folder)

    def send(self, transport: Transport, id: str) -> None:
        """Sends what the reconstruction does not have."""
        files = transport.json("GET", f"/v1/reconstructions/{quote(id)}/files")["files"]
        known = {file["path"]: file for file in files}
        for path in self._paths:
            size, digest = _measure(self._folder / path)
            before = known.get(path)
            is_same = before is not None and before["sha256"] == digest and int(before["sizeBytes"]) == size
            if is_same and before["complete"]:
                continue
            offset = int(before["offsetBytes"]) if is_same else 0
            _FileUpload(transport, id, path, self._folder / path, size, digest).send(offset)


def _measure(path: Path) -> Tuple[int, str]:
    """Bytes and SHA-256 of a file."""
    digest = hashlib.sha256()
    size = 0
    with open(path, "rb") as file:
        while piece := file.read(_READ_BYTES):
            digest.update(piece)
            size += len(piece)
    return size, digest.hexdigest()


class _FileUpload:
    def __init__(self, transport: Transport, id: str, path: str, local: Path, size: int, digest: str) -> None:
        self._transport = transport
        self._id = id
        self._path = path
        self._target = f"/v1/reconstructions/{quote(id)}/files/{urllib.parse.quote(path)}"
        self._local = local
        self._size = size
        self._digest = digest

    def send(self, offset: int) -> None:
        """Sends what follows `offset`; begins anew once when what lies there turns out to be other bytes."""
        may_begin_anew = offset > 0
        with open(self._local, "rb") as file:
            while True:
                file.seek(offset)
                part = file.read(min(_PART_BYTES, self._size - offset))
                try:
                    state = self._send_part(part, offset)
                except ServiceError as error:
                    if error.status not in (_WRONG_OFFSET, _WRONG_DIGEST) or not may_begin_anew:
                        raise
                    may_begin_anew = False
                    offset = self._offset_there() if error.status == _WRONG_OFFSET else 0
                    continue
                may_begin_anew = True
                if state["complete"]:
                    return
                offset = int(state["offsetBytes"])

    def _send_part(self, part: bytes, offset: int) -> Dict[str, Any]:
        query = {
            "size": self._size,
            "sha256": self._digest,
            "offset": offset,
            "partSha256": hashlib.sha256(part).hexdigest(),
        }
        headers = {"Content-Type": "application/octet-stream"}
        return json.loads(self._transport.repeat("PUT", self._target, part, query, headers)[1])

    def _offset_there(self) -> int:
        for file in self._transport.json("GET", f"/v1/reconstructions/{quote(self._id)}/files")["files"]:
            if file["path"] == self._path and file["sha256"] == self._digest:
                return int(file["offsetBytes"])
        return 0
