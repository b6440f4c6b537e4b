# SPDX-License-Identifier: Apache-2.0
"""The coordinator as seen by its users."""

from __future__ import annotations

import json
import os
import re
import secrets
import ssl
from pathlib import Path
from typing import Any, Dict, Iterator, List, Mapping, Optional, Union

from .errors import MeshwrightError
from .reconstruction import Reconstruction
from .transport import Transport, quote
from .upload import SceneUpload

_MAJOR_VERSION = 1
_BY_REFERENCE = "file:"


class Client:
    """Calls to one coordinator, over REST.

    token: what it was started with (--api-token-file). retry_seconds: how long a coordinator that does not answer is
    waited for. ssl_context: for https, with certificates that the system does not know. Calls may be made from several
    threads at the same time.
    """

    def __init__(
        self,
        url: str = "http://127.0.0.1:7421",
        token: Optional[str] = None,
        *,
        timeout_seconds: float = 60.0,
        retry_seconds: float = 60.0,
        ssl_context: Optional[ssl.SSLContext] = None,
    ) -> None:
        self.transport = Transport(url, token, timeout_seconds, retry_seconds, ssl_context)
        self._is_checked = False

    def __repr__(self) -> str:
        return f"Client({self.transport.url!r})"

    def submit(
        self,
        scene: Union[str, "os.PathLike[str]"],
        options: Optional[Mapping[str, Any]] = None,
        *,
        id: Optional[str] = None,
        weight: float = 1.0,
        start: bool = True,
    ) -> Reconstruction:
        """Uploads a folder of photographs and their cameras and starts its reconstruction.

        scene: a folder, or "file:FOLDER" below one of the coordinator's --scene-root. options: those of "meshwright
        options", {"lattice-step": 2}. id: a-z, 0-9 and "-"; submitting again under the same id sends what is missing.
        weight: share of the workers against other reconstructions. start=False: upload alone.
        """
        self._check_version()
        reference = os.fspath(scene)
        is_uploaded = not reference.startswith(_BY_REFERENCE)
        upload = SceneUpload(Path(reference)) if is_uploaded else None
        request = {"id": id or _draw_id(reference), "optionsJson": json.dumps(dict(options or {})), "weight": weight}
        if upload is None:
            request["sceneReference"] = reference
        created = self.transport.json("POST", "/v1/reconstructions", request)
        if upload is not None and created["state"] == "RECONSTRUCTION_STATE_CREATED":
            upload.send(self.transport, created["id"])
        reconstruction = Reconstruction(self.transport, created["id"])
        if start:
            reconstruction.start()
        return reconstruction

    def get(self, id: str) -> Reconstruction:
        """A reconstruction that is there. ServiceError NOT_FOUND otherwise."""
        self._check_version()
        reconstruction = Reconstruction(self.transport, id)
        reconstruction.state()
        return reconstruction

    def list(self) -> Iterator[Dict[str, Any]]:
        """All reconstructions by id, as GET /v1/reconstructions/ID describes each."""
        self._check_version()
        page_token = ""
        while True:
            page = self.transport.json("GET", "/v1/reconstructions", query={"pageSize": 1000, "pageToken": page_token})
            yield from page["reconstructions"]
            page_token = page["nextPageToken"]
            if not page_token:
                return

    def workers(self) -> List[Dict[str, Any]]:
        """Cores, memory, last heartbeat of each, and what it does now."""
        self._check_version()
        return self.transport.json("GET", "/v1/workers")["workers"]

    def drain(self, worker: str) -> None:
        """No more cameras for it, until its process is started anew."""
        self._check_version()
        self.transport.json("POST", f"/v1/workers/{quote(worker)}:drain")

    def options(self) -> List[Dict[str, Any]]:
        """What `submit` takes: name, unit, default, minimum, maximum and documentation of each."""
        self._check_version()
        return self.transport.json("GET", "/v1/options")["options"]

    def formats(self) -> List[Dict[str, Any]]:
        """What a mesh can be downloaded as."""
        self._check_version()
        return self.transport.json("GET", "/v1/formats")["formats"]

    def _check_version(self) -> None:
        """Once: whether what answers there speaks this package's version of the interface."""
        if self._is_checked:
            return
        _, description = self.transport.repeat("GET", "/v1/openapi.yaml")
        found = re.search(rb"^info:\n(?:  .*\n)*?  version: (\d+)\.", description, re.MULTILINE)
        if not found:
            raise MeshwrightError(f"{self.transport.url} is no Meshwright coordinator: /v1/openapi.yaml has no version")
        if int(found[1]) != _MAJOR_VERSION:
            raise MeshwrightError(
                f"{self.transport.url} has version {int(found[1])} of the interface, expected {_MAJOR_VERSION}: "
                "take the package meshwright that belongs to it"
            )
        self._is_checked = True


def _draw_id(scene: str) -> str:
    """fountain-P11 -> fountain-p11-3f9a01"""
    folder = scene[len(_BY_REFERENCE) :] if scene.startswith(_BY_REFERENCE) else os.path.abspath(scene)
    name = os.path.basename(folder.rstrip("/"))
    plain = re.sub("[^a-z0-9]", "-", name.lower()).lstrip("-")[:50]
    return f"{plain or 'scene'}-{secrets.token_hex(3)}"
