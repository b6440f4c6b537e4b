# SPDX-License-Identifier: Apache-2.0
"""Calls over a network that breaks: a coordinator that the test plays."""

import json
import tempfile
import threading
import time
import unittest
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlsplit

import meshwright

DESCRIPTION = b"openapi: 3.1.0\ninfo:\n  title: Meshwright\n  version: 1.0.0\n  summary: x\n"
DONE = {"id": "c7", "state": "RECONSTRUCTION_STATE_DONE"}
RUNNING = {
    "id": "c7",
    "state": "RECONSTRUCTION_STATE_RUNNING",
    "progress": {"camerasTotal": 4, "camerasCommitted": 1},
}


class Played:
    """A coordinator that answers what the test says. answers: path -> list of functions, one a call, the last repeated."""

    def __init__(self, answers):
        self.requests = []
        played = self

        class Handler(BaseHTTPRequestHandler):
            def answer(self):
                path = urlsplit(self.path).path
                played.requests.append((self.command, self.path, dict(self.headers)))
                if path == "/v1/openapi.yaml" and path not in answers:
                    return say(self, 200, DESCRIPTION, "application/yaml")
                queue = answers[path]
                return (queue.pop(0) if len(queue) > 1 else queue[0])(self)

            do_GET = do_POST = do_DELETE = do_PUT = answer

            def log_message(self, *_):
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))
        self._thread.start()
        self.client = meshwright.Client(self.url, "secret", retry_seconds=5)

    @property
    def url(self):
        return f"http://127.0.0.1:{self._server.server_address[1]}"

    def calls_of(self, path):
        return [headers for _, target, headers in self.requests if urlsplit(target).path == path]

    def stop(self):
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


def say(handler, status, body, kind="application/json", **headers):
    data = body if isinstance(body, bytes) else json.dumps(body).encode()
    handler.send_response(status)
    handler.send_header("Content-Type", kind)
    handler.send_header("Content-Length", str(len(data)))
    for name, value in headers.items():
        handler.send_header(name.replace("_", "-"), value)
    handler.end_headers()
    handler.wfile.write(data)


def saying(status, body, kind="application/json", **headers):
    return lambda handler: say(handler, status, body, kind, **headers)


def problem(status, code, detail, field=None):
    body = {"type": "about:blank", "title": "x", "status": status, "detail": detail, "code": code}
    return saying(status, {**body, "field": field} if field else body, "application/problem+json")


def hang_up(handler):
    handler.close_connection = True
    handler.connection.close()


class TransportTest(unittest.TestCase):
    def play(self, **answers):
        played = Played({"/v1/" + name.replace("__", "/"): queue for name, queue in answers.items()})
        self.addCleanup(played.stop)
        return played

    def test_repeats_while_the_coordinator_is_away(self):
        html = saying(502, b"<html>Bad Gateway</html>", "text/html")
        played = self.play(workers=[hang_up, html, problem(503, "UNAVAILABLE", "going down"), saying(200, {"workers": []})])
        self.assertEqual(played.client.workers(), [])
        self.assertEqual(len(played.calls_of("/v1/workers")), 4)
        self.assertEqual(played.calls_of("/v1/workers")[0]["Authorization"], "Bearer secret")

    def test_says_why_and_does_not_repeat_what_is_refused(self):
        played = self.play(
            reconstructions=[problem(400, "INVALID_ARGUMENT", "weight is -1, expected 0..1000", "weight")],
            workers=[problem(401, "UNAUTHENTICATED", "no token")],
        )
        with self.assertRaises(meshwright.ServiceError) as raised:
            played.client.submit("file:x", weight=-1)
        self.assertEqual(str(raised.exception), "weight is -1, expected 0..1000")
        self.assertEqual(
            (raised.exception.code, raised.exception.status, raised.exception.field), ("INVALID_ARGUMENT", 400, "weight")
        )
        self.assertEqual(len(played.calls_of("/v1/reconstructions")), 1)
        with self.assertRaises(meshwright.ServiceError) as raised:
            played.client.workers()
        self.assertEqual(raised.exception.status, 401)

    def test_nobody_there_is_said_after_a_while(self):
        played = self.play()
        played.stop()
        begin = time.monotonic()
        with self.assertRaises(meshwright.UnreachableError) as raised:
            meshwright.Client(played.url, retry_seconds=0.5).workers()
        self.assertIn(played.url, str(raised.exception))
        self.assertLess(time.monotonic() - begin, 3)

    def test_another_version_of_the_interface_is_refused(self):
        for version, expected in ((b"2.3.1", "version 2 .* expected 1"), (b"x", "no Meshwright")):
            description = DESCRIPTION.replace(b"1.0.0", version)
            played = self.play(**{"openapi.yaml": [saying(200, description, "application/yaml")]})
            with self.assertRaisesRegex(meshwright.MeshwrightError, expected):
                played.client.workers()

    def test_events_go_on_where_they_broke(self):
        def stream(*events):
            def answer(handler):
                handler.send_response(200)
                handler.send_header("Content-Type", "text/event-stream")
                handler.end_headers()
                handler.wfile.write(b"retry: 2000\n\n:\n\n")
                for id, kind, data in events:
                    handler.wfile.write(f"id: {id}\nevent: {kind}\ndata: {json.dumps(data)}\n\n".encode())
                handler.wfile.write(b"id: 9\nevent: pa")  # broken in the middle

            return answer

        played = self.play(
            reconstructions__c7=[saying(200, RUNNING)],
            reconstructions__c7__events=[
                stream((0, "reconstruction", RUNNING), (1, "part", {"sequence": 1})),
                hang_up,
                stream((1, "reconstruction", RUNNING), (2, "part", {"sequence": 2})),
                stream((2, "reconstruction", DONE), (2, "end", {})),
            ],
        )
        events = list(played.client.get("c7").events())
        self.assertEqual([event.data["sequence"] for event in events if event.kind == "part"], [1, 2])
        self.assertEqual((events[0].state, events[0].fraction), ("running", 0.25))
        self.assertEqual((events[-1].state, events[-1].fraction), ("done", 1.0))
        known = [headers["Last-Event-ID"] for headers in played.calls_of("/v1/reconstructions/c7/events")]
        self.assertEqual(known, ["0", "1", "1", "2"])

    def test_downloads_go_on_where_they_broke(self):
        content = bytes(range(256)) * 4000

        def broken(handler):
            handler.send_response(200)
            handler.send_header("Content-Length", str(len(content)))
            handler.send_header("ETag", '"one"')
            handler.end_headers()
            handler.wfile.write(content[:300_000])
            handler.close_connection = True

        def rest(handler):
            first = int(handler.headers["Range"].removeprefix("bytes=").removesuffix("-"))
            say(handler, 206, content[first:], "model/ply", ETag='"one"')

        played = self.play(reconstructions__c7=[saying(200, DONE)], reconstructions__c7__mesh=[broken, hang_up, rest])
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "mesh.ply"
            played.client.get("c7").download(path)
            self.assertEqual(path.read_bytes(), content)
            self.assertEqual([item.name for item in Path(folder).iterdir()], ["mesh.ply"])
            calls = played.calls_of("/v1/reconstructions/c7/mesh")
            self.assertEqual([call.get("If-Range") for call in calls], [None, '"one"', '"one"'])

    def test_a_mesh_with_other_bytes_than_its_digest_is_refused(self):
        wrong = saying(200, b"ply", "model/ply", ETag='"' + 64 * "0" + '"')
        played = self.play(reconstructions__c7=[saying(200, DONE)], reconstructions__c7__mesh=[wrong])
        with tempfile.TemporaryDirectory() as folder:
            with self.assertRaises(meshwright.FormatError):
                played.client.get("c7").download(Path(folder) / "mesh.ply")
            self.assertEqual(list(Path(folder).iterdir()), [])

    def test_a_deletion_whose_answer_was_lost_is_one(self):
        gone = problem(404, "NOT_FOUND", "there is none")
        played = self.play(reconstructions__c7=[saying(200, DONE), hang_up, gone])
        played.client.get("c7").delete()

    def test_the_end_of_a_reconstruction_is_said(self):
        failed = {"id": "c7", "state": "RECONSTRUCTION_STATE_FAILED", "failure": "no camera overlaps another"}
        for state, error, words in (
            (failed, meshwright.ReconstructionFailed, "no camera overlaps another"),
            ({**failed, "state": "RECONSTRUCTION_STATE_CANCELLED"}, meshwright.ReconstructionCancelled, "cancelled"),
        ):
            played = self.play(reconstructions__c7=[saying(200, state)])
            with self.assertRaisesRegex(error, words):
                played.client.get("c7").wait()
        played = self.play(reconstructions__c7=[saying(200, RUNNING)])
        with self.assertRaisesRegex(meshwright.WaitTimeout, "running after 0.3 s"):
            played.client.get("c7").wait(0.3)


if __name__ == "__main__":
    unittest.main()
