# SPDX-License-Identifier: Apache-2.0
"""Against a real coordinator with a worker: submitting, following, fetching, also when the coordinator is killed."""

import hashlib
import importlib.util
import unittest

import meshwright

from . import service

HAS_NUMPY = importlib.util.find_spec("numpy") is not None


class ServiceTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.service = service.Service(token=service.TOKEN)
        cls.addClassCleanup(cls.service.stop)
        cls.scene = service.synthesize(cls.service.folder / "Facade 6")
        cls.client = meshwright.Client(cls.service.url, service.TOKEN, retry_seconds=30)
        # What one process on this machine makes of it.
        cls.local_mesh = cls.service.folder / "local.ply"
        cls.report = cls.run_locally(cls.scene, cls.local_mesh)

    @staticmethod
    def run_locally(scene, output, **more):
        options = {name.replace("-", "_"): value for name, value in {**service.OPTIONS, **more}.items()}
        return meshwright.run(scene, output, program=service.PROGRAM, **options)

    def test_from_a_folder_to_the_mesh_although_the_coordinator_is_killed(self):
        reconstruction = self.client.submit(self.scene, service.OPTIONS)
        self.assertRegex(reconstruction.id, "^facade-6-[0-9a-f]{6}$")
        killed = False
        events = []
        for event in reconstruction.events():
            events.append(event)
            if event.kind == "part" and not killed:
                killed = True
                self.service.kill()
                self.service.start()
        self.assertTrue(killed)
        self.assertEqual((events[-1].state, events[-1].fraction), ("done", 1.0))
        sequences = [event.data["sequence"] for event in events if event.kind == "part"]
        self.assertEqual(sequences, [part["sequence"] for part in reconstruction.parts()])
        fractions = [event.fraction for event in events]
        self.assertEqual(fractions, sorted(fractions))

        mesh = self.service.folder / "mesh.ply"
        reconstruction.wait(60).download(mesh)
        self.assertEqual(mesh.read_bytes(), self.local_mesh.read_bytes())
        self.assertEqual(self.report["mesh"]["faces"], len(meshwright.read_ply(mesh).triangles()))
        reconstruction.download(self.service.folder / "mesh.glb")
        self.assertEqual((self.service.folder / "mesh.glb").read_bytes()[:4], b"glTF")
        self.look_at_surfaces(reconstruction)

        other = reconstruction.again({**service.OPTIONS, "lattice-step": 4}).wait(60)
        faces = [int(one.describe()["progress"]["faces"]) for one in (other, reconstruction)]
        self.assertLess(faces[0], faces[1])
        self.assertEqual([camera["name"] for camera in other.cameras()], [camera["name"] for camera in reconstruction.cameras()])
        other.delete()

        self.assertIn(reconstruction.id, [item["id"] for item in self.client.list()])
        self.assertEqual([worker["id"] for worker in self.client.workers()], ["local-1"])
        self.assertTrue(reconstruction.attempts())
        self.assertTrue(all(camera["state"] == "CAMERA_STATE_COMMITTED" for camera in reconstruction.cameras()))
        reconstruction.delete()
        reconstruction.delete()
        self.assertNotIn(reconstruction.id, [item["id"] for item in self.client.list()])

    def look_at_surfaces(self, reconstruction):
        for part in reconstruction.parts():
            surface = reconstruction.surface(part["camera"])
            self.assertEqual((surface.camera_index, surface.patches), (part["camera"], int(part["patches"])))
        name = reconstruction.cameras()[surface.camera_index]["name"]
        self.assertEqual(reconstruction.surface(name), surface)
        with self.assertRaises(meshwright.ServiceError):
            reconstruction.surface("no-such-photograph.png")
        if not HAS_NUMPY:
            return
        import numpy

        mesh = reconstruction.part(name)
        points = surface.numpy()["points"]
        # Corners of the surface's mesh are its patches.
        numpy.testing.assert_allclose(mesh["vertices"][:, None].min(axis=1), mesh["vertices"])
        nearest = [abs(points - vertex).sum(axis=1).min() for vertex in mesh["vertices"][::50]]
        self.assertLess(max(nearest), 1e-4 * abs(points).max())
        self.assertTrue((mesh["camera"] == surface.camera_index).all())
        self.assertEqual(int((surface.depth_map().numpy() > 0).sum()), surface.patches)

    def test_an_upload_that_broke_off_goes_on(self):
        reconstruction = self.client.submit(self.scene, service.OPTIONS, id="broken", start=False)
        files = self.files_of("broken")
        self.assertTrue(all(file["complete"] for file in files.values()))
        self.assertNotIn("ground_truth.ply", files)
        # One is half there, one is another file of the same name, one is missing; the coordinator has been away.
        paths = sorted(path for path in files if path.endswith(".png"))
        for path, content in ((paths[0], b"half"), (paths[1], b"other")):
            self.put_beginning_of("half", path, self.scene / path if content == b"half" else None)
        self.service.kill()
        self.service.start()
        again = self.client.submit(self.scene, service.OPTIONS, id="half", start=False)
        for id in ("broken", "half"):
            for path, file in self.files_of(id).items():
                data = (self.scene / path).read_bytes()
                self.assertEqual((file["complete"], file["sha256"]), (True, hashlib.sha256(data).hexdigest()), path)
        for one in (reconstruction, again):
            one.cancel()
            one.cancel()
            with self.assertRaises(meshwright.ReconstructionCancelled):
                one.wait()
            one.delete()

    def files_of(self, id):
        files = self.client.transport.json("GET", f"/v1/reconstructions/{id}/files")["files"]
        return {file["path"]: file for file in files}

    def put_beginning_of(self, id, path, local):
        """The first 1000 bytes of a file, or of one that will never be whole."""
        options = '{"lattice-step": 2, "window": 2, "min-component": 20}'
        self.client.transport.json("POST", "/v1/reconstructions", {"id": id, "optionsJson": options})
        data = local.read_bytes() if local else bytes(5000)
        query = {
            "size": len(data),
            "sha256": hashlib.sha256(data).hexdigest(),
            "offset": 0,
            "partSha256": hashlib.sha256(data[:1000]).hexdigest(),
        }
        kind = {"Content-Type": "application/octet-stream"}
        self.client.transport.repeat("PUT", f"/v1/reconstructions/{id}/files/{path}", data[:1000], query, kind)

    def test_the_coordinators_reasons_are_exceptions(self):
        def error_of(call):
            with self.assertRaises(meshwright.ServiceError) as raised:
                call()
            return raised.exception

        no_option = error_of(lambda: self.client.submit(self.scene, {"lattice-step": 0}, id="bad"))
        self.assertEqual((no_option.status, no_option.code), (400, "INVALID_ARGUMENT"))
        self.assertIn("lattice-step", str(no_option))
        self.assertEqual(error_of(lambda: self.client.get("no-such-id")).code, "NOT_FOUND")
        self.assertEqual(error_of(lambda: meshwright.Client(self.service.url).workers()).status, 401)
        waiting = self.client.submit(self.scene, id="waiting", start=False)
        early = error_of(lambda: waiting.download(self.service.folder / "early.ply"))
        self.assertEqual((early.status, early.code), (409, "FAILED_PRECONDITION"))
        self.assertFalse((self.service.folder / "early.ply").exists())
        waiting.delete()
        self.assertIn("lattice-step", [option["name"] for option in self.client.options()])
        self.assertIn("glb", [item["name"] for item in self.client.formats()])

    def test_bad_scenes_are_refused_before_anything_is_created(self):
        for scene in (self.service.folder / "nowhere", self.service.folder / "empty"):
            if scene.name == "empty":
                scene.mkdir()
            with self.assertRaisesRegex(meshwright.MeshwrightError, scene.name):
                self.client.submit(scene, id="never")
        self.assertNotIn("never", [item["id"] for item in self.client.list()])

    def test_the_programs_line_is_the_exceptions(self):
        with self.assertRaisesRegex(meshwright.ProgramError, "nowhere") as raised:
            self.run_locally(self.service.folder / "nowhere", self.service.folder / "never.ply")
        self.assertEqual(raised.exception.exit_code, 3)
        with self.assertRaisesRegex(meshwright.ProgramError, "--lattice-step") as raised:
            self.run_locally(self.scene, self.service.folder / "never.ply", **{"lattice-step": 0})
        self.assertEqual(raised.exception.exit_code, 2)
        with self.assertRaises(meshwright.ProgramError):
            meshwright.run(self.scene, "x.ply", program="no-such-program")


if __name__ == "__main__":
    unittest.main()
