# SPDX-License-Identifier: Apache-2.0
"""One reconstruction: what happens to it and what comes out of it."""

from __future__ import annotations

import hashlib
import http.client
import json
import os
import secrets
import socket
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, Iterator, List, Mapping, Optional, Tuple, Union

from .errors import (
    FormatError,
    ReconstructionCancelled,
    ReconstructionFailed,
    ServiceError,
    UnreachableError,
    WaitTimeout,
)
from .ply import Ply, read_ply
from .surface import Surface
from .transport import Patience, Transport, quote

_STATE_PREFIX = "RECONSTRUCTION_STATE_"
_PASSING_STATUSES = frozenset({429, 502, 503, 504})
_NOT_FOUND = 404


@dataclass(frozen=True)
class Event:
    """Something that happened.

    kind: "reconstruction", or "part" when a camera's surface was accepted. state: created, preparing, running, joining,
    done, failed or cancelled. fraction: of the cameras that are through, 0..1. data: what the coordinator said, as
    /v1/openapi.yaml describes it.
    """

    kind: str
    state: str
    fraction: float
    data: Dict[str, Any]


class Reconstruction:
    """A reconstruction of a coordinator, by its id. Made by Client.submit and Client.get."""

    def __init__(self, transport: Transport, id: str) -> None:
        self.id = id
        self._transport = transport
        self._path = f"/v1/reconstructions/{quote(id)}"

    def __repr__(self) -> str:
        return f"Reconstruction({self.id!r})"

    def describe(self) -> Dict[str, Any]:
        """State, options, progress, warnings."""
        return self._transport.json("GET", self._path)

    def state(self) -> str:
        """created, preparing, running, joining, done, failed or cancelled."""
        return _state_of(self.describe())

    def start(self) -> None:
        """No more files; processing begins. Repeating it is harmless."""
        self._transport.json("POST", self._path + ":start")

    def again(
        self, options: Optional[Mapping[str, Any]] = None, *, id: Optional[str] = None, start: bool = True
    ) -> "Reconstruction":
        """Another one of the same scene with other options; nothing is sent again."""
        request = {"id": id or f"{self.id[:57]}-{secrets.token_hex(3)}", "optionsJson": json.dumps(dict(options or {}))}
        created = self._transport.json("POST", self._path + ":again", request)
        other = Reconstruction(self._transport, created["id"])
        if start:
            other.start()
        return other

    def cancel(self) -> None:
        """Stops it. What is over stays as it is."""
        self._transport.json("POST", self._path + ":cancel")

    def delete(self) -> None:
        """Stops it and removes everything that belongs to it alone."""
        try:
            self._transport.json("DELETE", self._path)
        except ServiceError as error:
            # The answer to an earlier attempt may have been lost.
            if error.status != _NOT_FOUND:
                raise

    def events(self) -> Iterator[Event]:
        """What happens, until it is over; states that pass quickly may be left out, parts never.

        Connects again by itself; ends without error whatever the reconstruction's end is. Leaving the loop neither
        cancels the reconstruction nor leaves anything behind.
        """
        last_part = "0"
        state, fraction = "created", 0.0
        patience = Patience(self._transport.retry_seconds)
        while True:
            error: Exception = UnreachableError(f"the events of {self._transport.url} broke off")
            try:
                headers = {"Accept": "text/event-stream", "Last-Event-ID": last_part}
                with self._transport.open("GET", self._path + "/events", headers=headers) as answer:
                    for id, kind, text in _messages(answer.pieces()):
                        patience.progress()
                        last_part = id or last_part
                        if kind == "end":
                            return
                        data = json.loads(text)
                        if kind == "reconstruction":
                            state, fraction = _state_of(data), _fraction_of(data)
                        yield Event(kind, state, fraction, data)
            except ServiceError as refused:
                if refused.status not in _PASSING_STATUSES:
                    raise
                error = refused
            except (OSError, http.client.HTTPException) as broken:
                error = self._transport.unreachable(broken)
            patience.wait(error)

    def wait(self, timeout_seconds: Optional[float] = None) -> "Reconstruction":
        """Until the mesh is there. ReconstructionFailed or ReconstructionCancelled when there will be none, WaitTimeout."""
        deadline = None if timeout_seconds is None else time.monotonic() + timeout_seconds
        pause = 0.1
        while True:
            now = self.describe()
            state = _state_of(now)
            if state == "done":
                return self
            if state == "failed":
                raise ReconstructionFailed(f"{self.id}: {now.get('failure', '')}")
            if state == "cancelled":
                raise ReconstructionCancelled(f"{self.id} was cancelled")
            left = None if deadline is None else deadline - time.monotonic()
            if left is not None and left <= 0:
                raise WaitTimeout(f"{self.id} is {state} after {timeout_seconds:g} s")
            time.sleep(pause if left is None else min(pause, left))
            pause = min(1.5 * pause, 2.0)

    def download(
        self,
        path: Union[str, "os.PathLike[str]"],
        *,
        format: Optional[str] = None,
        partial: bool = False,
    ) -> None:
        """Writes the mesh. The ending of `path` says the format (Client.formats), unless `format` does.

        Goes on where a connection broke; the file appears whole or not at all. partial: while it runs, the surfaces
        accepted so far, side by side. ServiceError FAILED_PRECONDITION while it is not done otherwise.
        """
        target = Path(path)
        name = format or target.suffix.lstrip(".").lower() or "ply"
        query = {"format": name, "partial": "true" if partial else "false"}
        temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
        try:
            with open(temporary, "xb") as file:
                etag = self._transport_file(self._path + "/mesh", query, file)
            is_mesh_itself = name == "ply" and len(etag) == 64
            if is_mesh_itself and _sha256_of(temporary) != etag:
                raise FormatError(f"{target}: SHA-256 is {_sha256_of(temporary)}, expected {etag}")
            os.replace(temporary, target)
        finally:
            temporary.unlink(missing_ok=True)

    def mesh(self, *, partial: bool = False) -> Dict[str, Any]:
        """The mesh as numpy arrays: vertices (V, 3), triangles (F, 3), normals, colors, quality, camera.

        Needs numpy. vertices float32 in the scene's units, colors uint8 sRGB, camera the index of the reference camera.
        """
        with tempfile.TemporaryDirectory(prefix="meshwright-") as folder:
            path = os.path.join(folder, "mesh.ply")
            self.download(path, partial=partial)
            return read_ply(path).mesh()

    def cameras(self) -> List[Dict[str, Any]]:
        """Every camera with name, state, pose, and what its job reported."""
        cameras = self._transport.json("GET", self._path + "/cameras")["cameras"]
        for camera in cameras:
            camera["report"] = json.loads(camera.pop("reportJson") or "{}")
        return cameras

    def parts(self) -> List[Dict[str, Any]]:
        """sequence, camera, sha256 and patches of each accepted surface, in the order of the mesh."""
        return self._transport.json("GET", self._path + "/parts")["parts"]

    def part(self, camera: Union[int, str]) -> Dict[str, Any]:
        """The accepted surface of one camera, by index or name, as a mesh like mesh(). Needs numpy."""
        bytes_, name = self._part(camera, "")
        return Ply.parse(bytes_, name).mesh()

    def surface(self, camera: Union[int, str]) -> Surface:
        """The accepted surface of one camera, by index or name: depths and normals on the lattice of its rays."""
        return Surface.parse(*self._part(camera, "/surface"))

    def attempts(self) -> List[Dict[str, Any]]:
        """Which worker had which camera, from when to when, and how it ended."""
        return self._transport.json("GET", self._path + "/attempts", query={"maxAttempts": 100000})["attempts"]

    def log(self) -> List[Dict[str, Any]]:
        """What happened, failures with their reasons; the oldest first."""
        return self._transport.json("GET", self._path + "/log")["entries"]

    def _part(self, camera: Union[int, str], kind: str) -> Tuple[bytes, str]:
        index = camera
        if isinstance(camera, str):
            index = next((item["index"] for item in self.cameras() if item["name"] == camera), -1)
        for part in self.parts():
            if part["camera"] == index:
                path = f"{self._path}/parts/{part['sequence']}{kind}"
                return self._transport.repeat("GET", path)[1], f"surface of camera {camera}"
        raise ServiceError(f"camera {camera} of {self.id} has no accepted surface", "NOT_FOUND", _NOT_FOUND, "camera")

    def _transport_file(self, path: str, query: Dict[str, str], file: Any) -> str:
        """Writes the answer's body to `file`, over as many connections as it takes. Returns its ETag."""
        patience = Patience(self._transport.retry_seconds)
        etag = ""
        while True:
            headers = {"Range": f"bytes={file.tell()}-", "If-Range": f'"{etag}"'} if file.tell() else {}
            try:
                with self._transport.open("GET", path, query=query, headers=headers) as answer:
                    if answer.status != 206:  # all of it: other bytes than those that are here, or none are
                        file.seek(0)
                        file.truncate()
                    etag = (answer.header("ETag") or "").strip('"')
                    for piece in answer.pieces():
                        file.write(piece)
                        patience.progress()
                    return etag
            except ServiceError as refused:
                if refused.status not in _PASSING_STATUSES:
                    raise
                patience.wait(refused)
            except (ConnectionError, socket.timeout, http.client.HTTPException) as broken:
                patience.wait(self._transport.unreachable(broken))


def _state_of(reconstruction: Dict[str, Any]) -> str:
    return str(reconstruction["state"])[len(_STATE_PREFIX) :].lower()


def _fraction_of(reconstruction: Dict[str, Any]) -> float:
    if _state_of(reconstruction) == "done":
        return 1.0
    progress = reconstruction.get("progress", {})
    total = progress.get("camerasTotal", 0)
    return min(1.0, progress.get("camerasCommitted", 0) / total) if total else 0.0


def _messages(pieces: Iterator[bytes]) -> Iterator[Tuple[str, str, str]]:
    """id, event and data of server-sent events (WHATWG HTML, section 9.2), as our coordinator writes them."""
    buffered = b""
    for piece in pieces:
        buffered += piece
        *blocks, buffered = buffered.split(b"\n\n")
        for block in blocks:
            fields: Dict[str, str] = {}
            for line in block.decode().split("\n"):
                name, _, value = line.partition(":")
                if name:  # lines that begin with ":" keep the connection alive
                    fields[name] = value.removeprefix(" ")
            if "event" in fields:
                yield fields.get("id", ""), fields["event"], fields.get("data", "{}")


def _sha256_of(path: Path) -> str:
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while piece := file.read(1 << 20):
            digest.update(piece)
    return digest.hexdigest()
