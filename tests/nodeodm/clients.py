# SPDX-License-Identifier: Apache-2.0
"""NodeODM's clients as they behave on the wire, written from the protocol: PyODM, CloudODM and WebODM."""

import json
import mimetypes
import re
import time
from concurrent.futures import ThreadPoolExecutor

import requests
from requests_toolbelt.multipart import encoder

PIECE_BYTES = 64 << 10  # PyODM takes 10 MB; archives are smaller here


class NodeError(Exception):
    pass


class NoRetryError(NodeError):
    pass


class PyOdm:
    """Every answer is JSON with the status 200; errors have the key `error`."""

    def __init__(self, url, token):
        self.url = url
        self.token = token

    def get(self, path, query=None, **more):
        return requests.get(self.url + path, params={**(query or {}), "token": self.token}, timeout=30, **more)

    def get_json(self, path, query=None):
        return self.parse(self.get(path, query))

    def post_json(self, path, data=None, headers=None):
        return self.parse(
            requests.post(self.url + path, params={"token": self.token}, data=data, headers=headers, timeout=30)
        )

    @staticmethod
    def parse(response):
        if response.status_code == 401:
            raise NodeError("Unauthorized")
        if response.status_code not in (200, 403):
            raise NodeError(f"status {response.status_code}: {response.text}")
        assert response.headers["Content-Type"].startswith("application/json"), response.headers
        result = response.json()
        if isinstance(result, dict) and "error" in result:
            raise (NoRetryError if result.get("noRetry") else NodeError)(result["error"])
        return result

    def options(self):
        class Option:  # a sixth key breaks this
            def __init__(self, domain, help, name, value, type):
                self.domain, self.help, self.name, self.value, self.type = domain, help, name, value, type

        return [Option(**item) for item in self.get_json("/options")]

    def init(self, options=None, name=None, headers=None, **fields):
        listed = [{"name": key, "value": value} for key, value in (options or {}).items()]
        form = encoder.MultipartEncoder({"name": name or "", "options": json.dumps(listed), **fields})
        return self.post_json("/task/new/init", form, {"Content-Type": form.content_type, **(headers or {})})["uuid"]

    def upload(self, uuid, path, name=None):
        with open(path, "rb") as file:
            kind = mimetypes.guess_type(str(path))[0] or "image/jpg"
            form = encoder.MultipartEncoder({"images": (name or path.name, file, kind)})
            return self.post_json(f"/task/new/upload/{uuid}", form, {"Content-Type": form.content_type})

    def commit(self, uuid):
        return self.post_json(f"/task/new/commit/{uuid}")["uuid"]

    def create_task(self, paths, options=None, name=None, parallel=10, **fields):
        uuid = self.init(options, name, **fields)
        with ThreadPoolExecutor(parallel) as pool:
            for result in pool.map(lambda path: self.upload(uuid, path), paths):
                assert result == {"success": True}, result
        assert self.commit(uuid) == uuid
        return uuid

    def info(self, uuid, with_output=None):
        query = {} if with_output is None else {"with_output": with_output}
        return self.get_json(f"/task/{uuid}/info", query)

    def output(self, uuid, line=0):
        return self.get_json(f"/task/{uuid}/output", {"line": line})

    def act(self, what, uuid, **more):
        result = self.post_json(f"/task/{what}", {"uuid": uuid, **more})
        return result["success"]

    def wait(self, uuid, seconds=120):
        """Polls as WebODM does. Progress never falls, lines are only added."""
        deadline = time.monotonic() + seconds
        progress, lines = -1, []
        while True:
            info = self.info(uuid, with_output=len(lines))
            assert info["progress"] >= progress, (progress, info)
            progress = info["progress"]
            lines += info["output"]
            if info["status"]["code"] in (30, 40, 50):
                assert self.output(uuid)[: len(lines)] == lines
                return info
            assert time.monotonic() < deadline, info
            time.sleep(0.2)

    def download(self, uuid):
        """By ranges, 16 at a time, the length of each checked."""
        with self.get(f"/task/{uuid}/download/all.zip", stream=True) as head:
            assert head.status_code == 200, head.text
            assert head.headers["Content-Type"] == "application/zip", self.parse(head)
            assert head.headers["Accept-Ranges"] == "bytes"
            size = int(head.headers["Content-Length"])

        def piece(begin):
            end = min(begin + PIECE_BYTES, size) - 1
            answer = self.get(f"/task/{uuid}/download/all.zip", headers={"Range": f"bytes={begin}-{end}"})
            assert answer.status_code == 206 and len(answer.content) == end - begin + 1, answer.status_code
            assert answer.headers["Content-Range"] == f"bytes {begin}-{end}/{size}"
            return answer.content

        with ThreadPoolExecutor(16) as pool:
            return b"".join(pool.map(piece, range(0, size, PIECE_BYTES)))


class CloudOdm(PyOdm):
    """Streams its uploads without saying how long they are; knows a wrong token by its words."""

    def upload(self, uuid, path, name=None):
        boundary = "0f1e2d3c4b5a69788796a5b4c3d2e1f00f1e2d3c4b5a69788796a5b4c3d2e1f0"

        def chunks():
            yield (
                f'--{boundary}\r\nContent-Disposition: form-data; name="images"; filename="{name or path.name}"\r\n'
                "Content-Type: application/octet-stream\r\n\r\n"
            ).encode()
            data = path.read_bytes()
            for begin in range(0, len(data), 5000):
                yield data[begin : begin + 5000]
            yield f"\r\n--{boundary}--\r\n".encode()

        headers = {"Content-Type": f"multipart/form-data; boundary={boundary}"}
        return self.post_json(f"/task/new/upload/{uuid}", chunks(), headers)

    def create_at_once(self, paths, options):
        """--parallel-connections 1: the files, then the options, in one request; no name."""
        parts = [("images", (path.name, path.read_bytes(), "image/jpeg")) for path in paths]
        parts.append(("options", json.dumps([{"name": key, "value": value} for key, value in options.items()])))
        form = encoder.MultipartEncoder(parts)
        return self.post_json("/task/new", form, {"Content-Type": form.content_type})["uuid"]

    def is_unauthorized(self):
        answer = self.get("/info").json()
        return bool(re.match("Invalid authentication token", answer.get("error", "")))
