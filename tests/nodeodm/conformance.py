# SPDX-License-Identifier: Apache-2.0
"""Call sequences of NodeODM's clients against a coordinator with two workers, through a proxy."""

import io
import json
import os
import re
import shutil
import socket
import subprocess
import tempfile
import threading
import time
import unittest
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import urlsplit

import requests

from clients import CloudOdm, NodeError, NoRetryError, PyOdm

PROGRAM = os.environ["MESHWRIGHT"]
TOKEN = "the-token-of-the-coordinator"
OF_THE_PROXY = "of-the-proxy"
# Quick, and the same bytes wherever it runs.
OPTIONS = {"lattice-step": 2, "window": 4, "min-component": 10}
PHOTOGRAPHS = 50
MAX_IMAGES = 60
QUEUED, RUNNING, FAILED, COMPLETED, CANCELLED = 10, 20, 30, 40, 50
NO_TASK = "00000000-0000-4000-8000-000000000000"


def environment():
    return {name: value for name, value in os.environ.items() if not name.startswith("MESHWRIGHT")}


class Node:
    """meshwright up, which can be killed and started anew at the same address."""

    def __init__(self, folder):
        self.folder = folder
        self._address = "127.0.0.1:0"
        (folder / "token").write_text(TOKEN)
        self.start()

    def start(self):
        command = [PROGRAM, "up", "--data", str(self.folder / "data"), "--listen", "127.0.0.1:0", "--workers", "2"]
        command += ["--rest-listen", "127.0.0.1:0", "--nodeodm-listen", self._address]
        command += ["--api-token-file", str(self.folder / "token"), "--nodeodm-max-images", str(MAX_IMAGES)]
        with open(self.folder / "log", "a") as log:
            self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, env=environment(), text=True)
        for line in self.process.stdout:
            if found := re.match(r"listening on port (\d+)", line):
                self.grpc = f"127.0.0.1:{found[1]}"
            if found := re.search(r"NodeODM on port (\d+)", line):
                self._address = f"127.0.0.1:{found[1]}"
                self.url = f"http://{self._address}"
                return
        raise RuntimeError((self.folder / "log").read_text())

    def key_of(self, user):
        command = [PROGRAM, "token", "create", "--user", user, "--role", "submitter", "--coordinator", self.grpc]
        command += ["--token-file", str(self.folder / "token")]
        return subprocess.run(command, check=True, env=environment(), stdout=subprocess.PIPE, text=True).stdout.strip()

    def end(self, kill=False):
        self.process.kill() if kill else self.process.terminate()
        self.process.wait(timeout=60)
        self.process.stdout.close()


class Conformance(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="meshwright-nodeodm-")
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        cls.node = Node(cls.folder)
        cls.addClassCleanup(lambda: cls.node.end())
        command = ["node", str(Path(__file__).with_name("proxy.js")), cls.node.url, TOKEN]
        cls.proxy = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        cls.addClassCleanup(cls.end_proxy)
        cls.url = f"http://127.0.0.1:{int(cls.proxy.stdout.readline())}"
        cls.scene = cls.synthesize("ring", PHOTOGRAPHS)
        cls.small = cls.synthesize("facade", 4)

    @classmethod
    def end_proxy(cls):
        cls.proxy.terminate()
        cls.proxy.wait()
        cls.proxy.stdout.close()

    @classmethod
    def synthesize(cls, kind, cameras):
        """All files of a scene in one folder, as they are uploaded."""
        made, flat = cls.folder / f"{kind}-made", cls.folder / kind
        size = ["--cameras", str(cameras), "--width", "120", "--height", "90"]
        subprocess.run([PROGRAM, "synthesize", kind, "-o", str(made), *size, "--quiet"], check=True,
                       env=environment(), stdout=subprocess.DEVNULL)  # fmt: skip
        flat.mkdir()
        for path in [*made.glob("model/*"), *made.glob("images/*")]:
            shutil.copy(path, flat / path.name)
        return sorted(flat.iterdir())

    @staticmethod
    def photographs(paths):
        return [path for path in paths if path.suffix == ".png"]

    def pyodm(self):
        return PyOdm(self.url, OF_THE_PROXY)

    def refused(self, call, words, no_retry=None):
        with self.assertRaises(NodeError) as raised:
            call()
        self.assertRegex(str(raised.exception), words)
        if no_retry is not None:
            self.assertEqual(isinstance(raised.exception, NoRetryError), no_retry, raised.exception)

    # --- PyODM and WebODM

    def test_fifty_photographs_by_ten_uploads_some_of_which_break(self):
        client = self.pyodm()
        info = client.get_json("/info")
        self.assertTrue(all(part.isdigit() for part in info["version"].split(".")), info)
        self.assertGreaterEqual(tuple(map(int, info["version"].split("."))), (1, 5, 1))
        self.assertEqual((info["maxImages"], info["engine"]), (MAX_IMAGES, "meshwright"))
        self.assertGreater(info["maxParallelTasks"] - info["taskQueueCount"], 0)
        self.assertIn("lattice-step", [option.name for option in client.options()])

        uuid = client.init({**OPTIONS, "dsm": True, "auto-boundary": True}, "A ring")
        with ThreadPoolExecutor(10) as pool:
            list(pool.map(lambda path: self.upload_with_breaks(client, uuid, path), self.scene))
        self.refused(lambda: client.info(uuid), "not found")  # no task before it is committed
        self.assertEqual([client.commit(uuid) for _ in range(3)], [uuid] * 3)
        self.refused(lambda: client.upload(uuid, self.scene[0]), r"Invalid uuid \(not found\)", no_retry=True)
        info = client.wait(uuid)
        self.assertEqual((info["status"], info["progress"]), ({"code": COMPLETED}, 100), info)
        self.assertEqual((info["name"], info["imagesCount"]), ("A ring", PHOTOGRAPHS))
        self.assertIsInstance(info["dateCreated"], int)
        self.assertGreater(info["processingTime"], 0)
        self.assertEqual(info["options"][0], {"name": "lattice-step", "value": 2})
        lines = client.output(uuid)
        self.assertEqual(client.output(uuid, 3), lines[3:])
        self.assertRegex("\n".join(lines), "no meaning here: dsm, auto-boundary")
        self.look_at_result(client, uuid)
        # Cancelling what is completed changes nothing.
        self.assertTrue(client.act("cancel", uuid))
        self.assertEqual(client.info(uuid)["status"]["code"], COMPLETED)
        self.assertTrue(client.act("remove", uuid))
        self.refused(lambda: client.info(uuid), "not found")
        self.assertNotIn({"uuid": uuid}, client.get_json("/task/list"))

    def upload_with_breaks(self, client, uuid, path):
        if path.stem.endswith("3"):  # the connection ends in the middle of the file
            address = urlsplit(self.url)
            with socket.create_connection((address.hostname, address.port)) as line:
                head = f"POST /task/new/upload/{uuid}?token={OF_THE_PROXY} HTTP/1.1\r\nHost: x\r\nContent-Length: 99999\r\n"
                head += "Content-Type: multipart/form-data; boundary=xyz\r\n\r\n--xyz\r\n"
                head += f'Content-Disposition: form-data; name="images"; filename="{path.name}"\r\n\r\n'
                line.sendall(head.encode() + path.read_bytes()[:500])
        self.assertEqual(client.upload(uuid, path), {"success": True})
        if path.stem.endswith("7"):  # the answer was lost, so it is sent again
            self.assertEqual(client.upload(uuid, path), {"success": True})

    def look_at_result(self, client, uuid):
        data = client.download(uuid)
        whole = client.get(f"/task/{uuid}/download/all.zip").content
        self.assertEqual(data, whole)
        archive = zipfile.ZipFile(io.BytesIO(data))
        self.assertIsNone(archive.testzip())
        names = archive.namelist()
        self.assertGreater(len({name.split("/")[0] for name in names}), 1)
        self.assertTrue(all(item.compress_type == zipfile.ZIP_STORED for item in archive.infolist()))
        model = archive.read("odm_texturing/odm_textured_model_geo.glb")
        described = json.loads(model[20 : 20 + int.from_bytes(model[12:16], "little")])
        self.assertTrue(described["images"] and described["materials"], "no texture")
        points = archive.read("odm_georeferencing/odm_georeferenced_model.las")
        mesh = archive.read("odm_meshing/odm_mesh.ply")
        vertices = int(re.search(rb"element vertex (\d+)", mesh)[1])
        self.assertEqual((points[:4], int.from_bytes(points[107:111], "little")), (b"LASF", vertices))
        shots = json.loads(archive.read("odm_report/shots.geojson"))
        self.assertEqual(len(shots["features"]), PHOTOGRAPHS)
        self.assertEqual(len(json.loads(archive.read("images.json"))), PHOTOGRAPHS)
        self.assertEqual(len(json.loads(archive.read("cameras.json"))), 1)
        statistics = json.loads(archive.read("odm_report/stats.json"))
        self.assertEqual(statistics["reconstruction_statistics"]["reconstructed_points_count"], vertices)
        self.assertIn("Meshwright", archive.read("task_output.txt").decode())
        # The bytes that one process makes of the same files.
        local = self.folder / "local.ply"
        options = [text for name, value in OPTIONS.items() for text in (f"--{name}", str(value))]
        command = [PROGRAM, "reconstruct", str(self.scene[0].parent), "-o", str(local), "--quiet", *options]
        subprocess.run(command, check=True, env=environment(), stdout=subprocess.DEVNULL)
        self.assertEqual(mesh, local.read_bytes())

    def test_cancel_restart_and_remove(self):
        client = self.pyodm()
        uuid = client.create_task(self.small, {**OPTIONS, "max-image-size": 100}, "small")
        self.assertTrue(client.act("cancel", uuid))
        self.assertTrue(client.act("cancel", uuid))
        info = client.info(uuid)
        self.assertIn(info["status"]["code"], (CANCELLED, COMPLETED))
        before = info["dateCreated"]
        # WebODM adds rerun-from.
        options = json.dumps([{"name": "lattice-step", "value": "1"}, {"name": "rerun-from", "value": "odm_meshing"},
                              {"name": "min-component", "value": 10}])  # fmt: skip
        self.assertTrue(client.act("restart", uuid, options=options))
        info = client.wait(uuid)
        self.assertEqual(info["status"], {"code": COMPLETED}, info)
        self.assertGreaterEqual(info["dateCreated"], before)
        self.assertEqual(info["options"][0], {"name": "lattice-step", "value": "1"})
        self.assertEqual(info["imagesCount"], 4)
        self.assertRegex(client.output(uuid)[0], "started again")
        # Without options the old ones stay.
        self.assertTrue(client.act("restart", uuid))
        self.assertEqual(client.wait(uuid)["options"], info["options"])
        self.refused(lambda: client.act("restart", uuid, options='[{"name":"lattice-step","value":0}]'), "lattice-step")
        self.assertTrue(client.act("remove", uuid))
        for what in ("cancel", "remove", "restart"):
            self.refused(lambda what=what: client.act(what, uuid), "not found")

    def test_quality_is_a_share_of_the_photographs_and_outputs_choose(self):
        client = self.pyodm()
        fields = {"outputs": json.dumps(["odm_report/", "cameras.json"]), "skipPostProcessing": "true"}
        options = {"pc-quality": "high", "min-component": 10, "lattice-step": 1, "skip-3dmodel": "true"}
        uuid = client.create_task(self.small, options, "half", **fields)
        info = client.wait(uuid)
        self.assertEqual(info["status"], {"code": COMPLETED}, info)
        self.assertRegex("\n".join(client.output(uuid)), r'4 photographs of up to 120 px.*"max-image-size":60')
        names = zipfile.ZipFile(io.BytesIO(client.download(uuid))).namelist()
        self.assertEqual(names, ["cameras.json", "odm_report/shots.geojson", "odm_report/stats.json"])
        self.assertTrue(client.act("remove", uuid))

    # --- CloudODM

    def test_cloudodm_streams_and_sends_all_at_once(self):
        client = CloudOdm(self.url, OF_THE_PROXY)
        uuid = client.init(OPTIONS)
        for path in self.small:
            self.assertEqual(client.upload(uuid, path), {"success": True})
        client.commit(uuid)
        at_once = client.create_at_once(self.small, OPTIONS)
        for task in (uuid, at_once):
            info = client.wait(task)
            self.assertEqual((info["status"], info["imagesCount"]), ({"code": COMPLETED}, 4), info)
            self.assertTrue(info["name"])
        self.assertEqual(client.download(uuid).count(b"odm_mesh.ply"), 2)
        for task in (uuid, at_once):
            self.assertTrue(client.act("remove", task))

    # --- what goes wrong

    def test_wrong_tokens(self):
        self.assertTrue(CloudOdm(self.url, "wrong").is_unauthorized())
        self.assertFalse(CloudOdm(self.url, OF_THE_PROXY).is_unauthorized())
        for token in ("", "wrong", TOKEN[:-1]):
            client = PyOdm(self.url, token)
            words = "^Invalid authentication token: token does not match.$"
            for call in (lambda: client.get_json("/info"), lambda: client.get_json("/task/list"), lambda: client.init(),
                         lambda: client.upload(NO_TASK, self.small[0]), lambda: client.act("remove", NO_TASK)):  # fmt: skip
                self.refused(call, words)
        answer = requests.get(self.url + "/auth/info", timeout=10).json()
        self.assertEqual((answer["loginUrl"], answer["registerUrl"]), (None, None))
        self.assertEqual(self.pyodm().get("/info", {"_debugUnauthorized": "1"}).status_code, 401)
        self.refused(lambda: self.pyodm().post_json("/auth/login"), "Not available")

    def test_users_have_keys_and_tasks_of_their_own(self):
        alice, bob = (PyOdm(self.node.url, self.node.key_of(user)) for user in ("alice", "bob"))
        uuid = alice.create_task(self.small, OPTIONS, "alice's")
        self.assertEqual(alice.wait(uuid)["status"], {"code": COMPLETED})
        self.refused(lambda: bob.info(uuid), "not found")
        self.refused(lambda: bob.download(uuid), "not found")
        self.refused(lambda: bob.act("remove", uuid), "not found")
        self.assertEqual(bob.get_json("/task/list"), [])
        self.assertTrue(alice.act("restart", uuid))
        self.assertEqual(alice.wait(uuid)["status"], {"code": COMPLETED})
        self.assertIn(b"odm_mesh.ply", alice.download(uuid))
        self.assertTrue(alice.act("remove", uuid))

    def test_errors_are_words_with_the_status_200(self):
        client = self.pyodm()
        for options, words in (("{", "JSON"), ("[3]", "name"), ('[{"name":"lattice-step","value":"x"}]', "lattice-step")):
            self.refused(lambda o=options: client.post_json("/task/new/init", {"options": o}), words)
        refused = None
        try:
            client.init({"lattice-step": 0, "pc-quality": "best"})
        except NodeError as error:
            refused = json.loads(str(error))
        self.assertEqual([item["name"] for item in refused], ["lattice-step", "pc-quality"])
        for uuid in ("x", "A" * 36, "../../etc"):
            self.refused(lambda u=uuid: client.init(headers={"set-uuid": u}), "^Invalid set-uuid")
        mine = "11111111-2222-4333-8444-555555555555"
        self.assertEqual(client.init(headers={"set-uuid": mine}), mine)
        self.refused(lambda: client.init(headers={"set-uuid": mine}), "^Invalid set-uuid")
        self.refused(lambda: client.init(zipurl="http://127.0.0.1/x.zip"), "zipurl is not supported")
        self.refused(lambda: client.upload(NO_TASK, self.small[0]), r"Invalid uuid \(not found\)", no_retry=True)
        self.refused(lambda: client.commit(NO_TASK), r"Invalid uuid \(not found\)")
        nothing = {"Content-Type": "multipart/form-data; boundary=x"}
        self.refused(lambda: client.post_json(f"/task/new/upload/{mine}", b"--x--\r\n", nothing), "at least 1 file", no_retry=True)
        for name in ("..", "/", ".bashrc"):
            self.refused(lambda n=name: client.upload(mine, self.small[0], n), "Invalid file name", no_retry=True)
        self.refused(lambda: client.get_json(f"/task/{mine}/download/all.zip"), "not found")
        self.refused(lambda: client.get_json("/nowhere"), "nothing at this path")
        self.assertTrue(client.act("remove", mine))

    def test_names_of_files(self):
        client = self.pyodm()
        uuid = client.init()
        one, other = self.photographs(self.small)[:2]
        for path, name in ((one, "C:\\photos\\a.png"), (one, "../a.png"), (other, "a.png"), (one, "na\u00efve.png")):
            self.assertEqual(client.upload(uuid, path, name), {"success": True})
        for name in ("geo.txt", "gcp_list.txt", "seed.zip", "a_mask.png"):
            self.assertEqual(client.upload(uuid, one, name), {"success": True})
        client.commit(uuid)
        info = client.wait(uuid)
        # a.png, a_.png with other bytes, and the third. Where COLMAP is, it may make something of two places.
        self.assertEqual(info["imagesCount"], 3, info)
        if info["status"]["code"] != COMPLETED:
            self.assertEqual(info["status"]["code"], FAILED, info)
            self.assertRegex(info["status"]["errorMessage"], "photograph|COLMAP")
            self.refused(lambda: client.get_json(f"/task/{uuid}/download/all.zip"), "Asset not ready")
        self.refused(lambda: client.get_json(f"/task/{uuid}/download/orthophoto.tif"), "Invalid asset")
        self.assertRegex("\n".join(client.output(uuid)), "gcp_list.txt is not used here")
        self.assertTrue(client.act("remove", uuid))

    def test_no_more_images_than_the_node_takes(self):
        client = self.pyodm()
        uuid = client.init()
        for i in range(MAX_IMAGES):
            client.upload(uuid, self.small[0], f"{i}.png")
        self.refused(lambda: client.upload(uuid, self.small[0], "more.png"), f"more than {MAX_IMAGES} images", no_retry=True)
        client.act("remove", uuid)

    def test_tasks_outlive_the_coordinator(self):
        client = PyOdm(self.node.url, TOKEN)
        begun = client.init(OPTIONS, "begun before")
        half = len(self.small) // 2
        for path in self.small[:half]:
            client.upload(begun, path)
        done = client.create_task(self.small, OPTIONS, "done before")
        client.wait(done)
        lines = client.output(done)
        archive = client.download(done)
        running = client.create_task(self.small, OPTIONS, "running")
        self.node.end(kill=True)
        self.node.start()
        for path in self.small:  # those that are there already too
            client.upload(begun, path)
        client.commit(begun)
        self.assertEqual(client.wait(begun)["status"], {"code": COMPLETED})
        self.assertEqual(client.info(begun)["imagesCount"], 4)
        self.assertEqual(client.wait(running)["status"], {"code": COMPLETED})
        self.assertEqual(client.output(done)[: len(lines)], lines)
        self.assertEqual(client.download(done), archive)
        for uuid in (begun, done, running):
            client.act("remove", uuid)

    def test_a_thousand_tasks_are_listed_and_the_node_answers_meanwhile(self):
        client = PyOdm(self.node.url, TOKEN)
        slowest = [0.0]
        over = threading.Event()

        def poll():  # WebODM takes a node for dead that needs five seconds
            while not over.is_set():
                begin = time.monotonic()
                client.get_json("/info")
                slowest[0] = max(slowest[0], time.monotonic() - begin)
                time.sleep(0.05)

        poller = threading.Thread(target=poll)
        poller.start()
        try:
            with ThreadPoolExecutor(8) as pool:
                uuids = list(pool.map(lambda i: client.commit(client.init(name=f"task {i}")), range(1000)))
            listed = [item["uuid"] for item in client.get_json("/task/list")]
        finally:
            over.set()
            poller.join()
        self.assertTrue(set(uuids) <= set(listed))
        self.assertEqual(len(set(uuids)), 1000)
        self.assertLess(slowest[0], 5)
        print(f"/info took {1000 * slowest[0]:.0f} ms at most while 1,000 tasks came")


if __name__ == "__main__":
    unittest.main()
