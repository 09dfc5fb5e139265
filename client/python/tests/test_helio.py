"""Tests of the Python module: against a private worker, with pictures of a few pixels.

HELIO_LIBRARY, HELIO_WORKER and HELIO_TEST_MODEL (a glTF file) come from ctest.
"""
import contextlib
import ctypes
import functools
import io
import os
import re
import runpy
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from unittest import mock

SOURCE = os.environ["HELIO_SOURCE_DIR"]
sys.path.insert(0, os.path.join(SOURCE, "client", "python"))

import helio  # noqa: E402
from helio import _lib  # noqa: E402
from helio.scene import Scene  # noqa: E402

MODEL = os.environ.get("HELIO_TEST_MODEL", "demo:")
SMALL = {"gi": "none", "samples": 1, "temporal": "none"}


class Tables(unittest.TestCase):
    def test_every_function_is_bound(self):
        with open(os.path.join(SOURCE, "client/include/helio/helio.h"), encoding="utf-8") as f:
            declared = set(re.findall(r"^HELIO_API [^;]*?\b(helio_\w+)\(", f.read(), re.M))
        self.assertGreater(len(declared), 25)
        self.assertEqual(declared, set(_lib.PROTOTYPES))

    def test_structs_are_as_large_as_those_of_c(self):
        class MessageInfo(ctypes.Structure):
            _fields_ = [("type", ctypes.c_int), ("name", ctypes.c_char_p), ("direction", ctypes.c_int),
                        ("state", ctypes.c_int), ("role", ctypes.c_int), ("since", ctypes.c_uint16),
                        ("struct_size", ctypes.c_size_t)]
        find = _lib.lib.hgp_find
        find.restype, find.argtypes = ctypes.POINTER(MessageInfo), [ctypes.c_uint16]
        for name, number in _lib.numbers.items():
            info = find(number)
            self.assertTrue(info, name)
            self.assertEqual(info.contents.name.decode(), name)
            self.assertEqual(info.contents.struct_size, ctypes.sizeof(_lib.structs[name]), name)

    def test_values_come_back(self):
        keep = []
        fields = {"asset": 7, "path": "größe.glb", "files": [{"uri": "a.bin", "hash": bytes(range(32))},
                                                            {"uri": "b.png", "hash": bytes(32)}],
                  "up": "minus-z", "transform": tuple(float(i) for i in range(16))}
        struct = _lib.encode("asset_load", fields, keep)
        out = _lib.decode("asset_load", struct)
        self.assertEqual(out["path"], "größe.glb")
        self.assertEqual(out["files"][0]["hash"], bytes(range(32)))
        self.assertEqual(out["files"][1]["uri"], "b.png")
        self.assertEqual(out["up"].name, "MINUS_Z")
        self.assertEqual(out["transform"][15], 15.0)
        self.assertNotIn("variant", out)

    def test_wrong_values_are_refused(self):
        with self.assertRaises(TypeError):
            _lib.encode("view_set", {"view": 1, "widht": 3}, [])
        with self.assertRaises(ValueError):
            _lib.encode("view_set", {"view": 1, "mode": "fast"}, [])
        with self.assertRaises(ValueError):
            _lib.encode("view_camera", {"view": 1, "eye": (1, 2)}, [])
        with self.assertRaises(ValueError) as caught:
            _lib.encode("node_sett", {"node": 1}, [])
        self.assertIn("node_set", str(caught.exception))

    def test_wrong_values_name_their_field(self):
        for name, fields, kind, text in (
                ("view_set", {"view": 1, "exposure_ev": "3"}, TypeError, "view_set: exposure_ev: "),
                ("view_set", {"view": 1, "mode": "fast"}, ValueError, "view_set: mode: 'fast' is none of"),
                ("view_set", {"view": 1, "mode": 0.7}, TypeError, "view_set: mode: "),
                ("view_camera", {"view": 1, "input_seq": 1, "eye": (1, 2)}, ValueError, "view_camera: eye: 3 values"),
                ("node_set", {"node": 1, "visible": "no"}, TypeError, "node_set: visible: 'no' is neither"),
                ("node_set", {"node": 1, "name": 5}, TypeError, "node_set: name: 5 is neither text nor"),
                ("view_clip", {"view": 1, "planes": [{"normal": "x"}]}, ValueError, "view_clip: planes: clip_plane: normal:")):
            with self.assertRaises(kind, msg=fields) as caught:
                _lib.encode(name, fields, [])
            self.assertIn(text, str(caught.exception))

    def test_required_fields_are_never_made_up(self):
        for name, fields, text in (
                ("object_remove", {"object": 5}, "object_remove needs kind"),
                ("object_remove", {"object": 5, "kind": None}, "object_remove needs kind"),
                ("asset_load", {"path": "a.glb"}, "asset_load needs asset, files"),
                ("view_overrides", {"view": 1, "overrides": [{"node": 1}]}, "node_override needs set")):
            with self.assertRaises(TypeError) as caught:
                _lib.encode(name, fields, [])
            self.assertIn(text, str(caught.exception))
        _lib.encode("view_set", {"view": 1}, [])

    def test_integers_keep_to_their_range(self):
        for name, fields, text in (
                ("pick", {"view": 1, "x": -1, "y": 3}, "pick: x: -1 is outside of 0 to 16383"),
                ("pick", {"view": 1, "x": 16384, "y": 3}, "pick: x: 16384 is outside of 0 to 16383"),
                ("view_set", {"view": 2 ** 32 + 1}, "view_set: view: 4294967297 is outside of 1 to 4294967295"),
                ("view_camera", {"view": 1, "input_seq": -1}, "input_seq: -1 is outside of 0 to 18446744073709551615"),
                ("view_overrides", {"view": 1, "overrides": [{"node": 1, "set": 16}]},
                 "node_override: set: 16 is outside of 0 to 15")):
            with self.assertRaises(helio.HelioError) as caught:
                _lib.encode(name, fields, [])
            self.assertEqual(caught.exception.status, helio.Status.E_INVAL)
            self.assertIn(text, str(caught.exception))
        with self.assertRaises(TypeError):
            _lib.encode("pick", {"view": 1, "x": 0.5, "y": 3}, [])
        self.assertEqual(_lib.encode("pick", {"view": 1, "x": 16383, "y": 0}, []).x, 16383)


class Errors(unittest.TestCase):
    def test_limits_are_named(self):
        error = _lib.Error(int(helio.Status.E_LIMIT), b"view_set", b"view", b"too many", b"max-views", 1500)
        with self.assertRaises(helio.HelioError) as caught:
            _lib.check(error.status, error)
        self.assertEqual(caught.exception.limit, "max-views")
        self.assertEqual(caught.exception.retry_after, 1.5)
        self.assertIn("view_set: view: too many", str(caught.exception))
        error = _lib.Error(int(helio.Status.E_NOTFOUND), b"scene")
        with self.assertRaises(helio.HelioError) as caught:
            _lib.check(error.status, error)
        self.assertEqual((caught.exception.limit, caught.exception.retry_after), ("", None))


class Unreachable(unittest.TestCase):
    def test_no_daemon(self):
        with self.assertRaises(helio.HelioError) as caught:
            helio.connect("unix:/nonexistent/heliod.sock", timeout=5)
        self.assertEqual(caught.exception.status, helio.Status.E_CLOSED)
        self.assertIn("/nonexistent/heliod.sock", caught.exception.what)

    def test_url(self):
        with self.assertRaises(helio.HelioError) as caught:
            helio.connect("gopher:here")
        self.assertEqual(caught.exception.status, helio.Status.E_INVAL)


class Interrupts(unittest.TestCase):
    """Signals that come while C waits for a server that says nothing."""

    def test_what_handlers_raise_ends_the_call(self):
        def alarm(*_):
            raise TimeoutError("the handler's own")
        before = signal.signal(signal.SIGALRM, alarm)
        self.addCleanup(signal.signal, signal.SIGALRM, before)
        here, there = socket.socketpair()
        with there, helio.connect("unix:mute", fd=here.detach(), wait=False) as session:
            session.flush()
            for number, raised in ((signal.SIGINT, KeyboardInterrupt), (signal.SIGALRM, TimeoutError)) * 2:
                timer = threading.Timer(0.1, os.kill, (os.getpid(), number))
                with self.assertRaises(raised):
                    timer.start()
                    session.wait(20)
                timer.join()


class Threads(unittest.TestCase):
    def test_a_session_takes_one_at_a_time(self):
        here, there = socket.socketpair()
        ended = []

        def wait():
            try:
                session.wait(30)
            except helio.HelioError as wrong:
                ended.append(wrong.status)
        with there, helio.connect("unix:mute", fd=here.detach(), wait=False) as session:
            session.flush()
            thread = threading.Thread(target=wait)
            thread.start()
            with self.assertRaises(helio.HelioError) as caught:
                while thread.is_alive():
                    session.process()
                    time.sleep(0.001)
            self.assertEqual(caught.exception.status, helio.Status.E_STATE)
            session.close()
            thread.join()
        self.assertEqual(ended, [helio.Status.E_CANCELLED])


class Waiting(unittest.TestCase):
    def test_what_is_no_message_gives_no_more_time(self):
        """A wait ends when bytes come, also such as the library uses up itself."""
        left = []

        def wait(seconds):
            left.append(seconds)
            time.sleep(0.002)
            if len(left) == 3:
                raise helio.HelioError(helio.Status.E_TIMEOUT)
        here, there = socket.socketpair()
        with there, helio.connect("unix:mute", fd=here.detach(), wait=False) as session:
            with mock.patch.object(session, "wait", wait):
                self.assertEqual(list(session.messages(5)), [])
            self.assertTrue(left[2] < left[1] < left[0] <= 5, left)


class Rendering(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        roots = [] if MODEL == "demo:" else [os.path.dirname(os.path.realpath(MODEL))]
        cls.session = helio.connect(asset_roots=roots, timeout=200, answer_timeout=300)
        cls.scene = cls.session.scene()
        cls.loaded = cls.scene.load(MODEL)
        cls.view = cls.scene.view(32, 24, **SMALL)
        cls.view.fit("iso")

    @classmethod
    def tearDownClass(cls):
        cls.session.close()
        cls.session.close()  # again: nothing

    def test_info(self):
        info = self.session.info
        self.assertEqual(info.state, "open")
        self.assertEqual(info.role, helio.Role.ADMIN)
        self.assertGreater(info.worker_pid, 1)
        self.assertRegex(helio.version(), r"^\d+\.\d+\.\d+$")
        self.assertGreater(self.session.ping(), 0)
        self.assertGreaterEqual(self.session.fileno(), 0)

    def test_scene(self):
        self.assertGreater(self.loaded["triangles"], 0)
        nodes = list(self.scene.nodes())
        self.assertEqual(len(nodes), self.loaded["nodes"])
        low, high = self.scene.bounds()
        self.assertTrue(all(a <= b for a, b in zip(low, high)))
        self.assertEqual(len(self.scene.describe()), 1)

    def test_settled_frames_are_the_same(self):
        a, b = self.view.frame(encoding="raw_rgba8"), self.view.frame(encoding="raw_rgba8")
        self.assertTrue(a.settled)
        self.assertEqual(len(a.data), 32 * 24 * 4)
        self.assertEqual((a.hash, a.data), (b.hash, b.data))
        png = self.view.frame()
        self.assertEqual(png.hash, a.hash)  # of the pixels, whatever they are packed in
        self.assertEqual(png._repr_png_()[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(self.session.compare(png.data, png.data), 999)
        with tempfile.TemporaryDirectory() as folder:
            png.save(os.path.join(folder, "a.png"))
            with self.assertRaises(ValueError):
                png.save(os.path.join(folder, "a.jpg"))
            self.assertFalse(os.path.exists(os.path.join(folder, "a.jpg")))
            self.assertEqual(os.path.getsize(os.path.join(folder, "a.png")), len(png.data))

    def test_numpy(self):
        try:
            import numpy
        except ImportError:
            self.skipTest("numpy is not installed")
        frame = self.view.frame(encoding="raw_rgba8")
        self.assertEqual(frame.array.shape, (24, 32, 4))
        self.assertEqual(numpy.asarray(frame).tobytes(), frame.data)
        with self.assertRaises(ValueError):
            self.view.frame().array

    def test_cameras_move_the_picture(self):
        with self.scene.view(16, 16, **SMALL) as view:
            view.fit("front")
            front = view.frame()
            seq = view.fit("top")
            top = view.frame()
            self.assertNotEqual(front.hash, top.hash)
            self.assertEqual(top.input_seq, seq)
        with self.assertRaises(ValueError):
            self.view.fit("underneath")

    def test_wrong_cameras_are_refused(self):
        node = list(self.scene.nodes())[0]["node"]
        with self.scene.view(16, 16, **SMALL) as view:
            for place in (lambda: view.camera(camera=2 ** 40), lambda: view.camera(camera=node)):
                with self.assertRaises(helio.HelioError) as caught:
                    place()
                self.assertEqual(caught.exception.what, "camera")
            with self.assertRaises(helio.HelioError):
                for _ in view.frames(timeout=100):
                    view.camera(camera=2 ** 40)
        with self.assertRaises(helio.HelioError):
            view.fit()

    def test_cameras_leave_nothing_to_be_taken(self):
        with self.scene.view(16, 16, **SMALL) as view:
            for i in range(300):  # more than messages may wait
                view.orbit(i, 60, 4)
            self.assertEqual(view.frame().input_seq, 300)
        self.assertIsNone(self.session.next())

    def test_edits_raise_the_revision(self):
        node = self.scene.new_id()
        first = self.scene.edit("node_set", node=node, translation=(1, 2, 3), name="made")
        self.assertEqual(self.scene.find("made"), node)
        self.assertGreater(self.scene.edit("object_remove", kind="node", object=node), first)

    def test_subscription(self):
        with self.scene.view(16, 16, **SMALL) as view:
            view.fit("left")
            seen = []
            for frame in view.frames(timeout=100):
                seen.append(frame)
                if frame.settled:
                    break
            self.assertTrue(seen[-1].settled)

    def test_pick(self):
        self.view.frame()
        hit = self.view.pick(16, 12)
        if hit is not None:
            self.assertIn(hit["node"], [n["node"] for n in self.scene.nodes()])
        self.assertEqual(self.view.stats()["frame"]["samples"], 1)

    def test_errors_say_what_and_where(self):
        with self.assertRaises(helio.HelioError) as caught:
            self.scene.load("/nonexistent/scene.glb")
        self.assertIn(caught.exception.status, (helio.Status.E_NOTFOUND, helio.Status.E_PERM))
        self.assertIn("scene.glb", str(caught.exception))
        with self.assertRaises(helio.HelioError) as caught:
            self.scene.edit("node_set", node=0)
        self.assertEqual(caught.exception.status, helio.Status.E_INVAL)
        self.assertEqual(caught.exception.what, "node_set")

    def test_tap(self):
        sent, came = [], []
        self.session.tap(sent.append, lambda m: came.append(m.name))
        self.session.ping()
        self.session.tap()
        self.session.ping()
        self.assertEqual(len(sent), 1)
        self.assertEqual(int.from_bytes(sent[0][4:6], "little"), _lib.numbers["ping"])
        self.assertEqual(came, ["pong"])

    def test_exceptions_of_callbacks_end_the_call(self):
        class Stop(Exception):
            pass

        def stop(message):
            raise Stop
        self.session.tap(received=stop)
        with self.assertRaises(Stop):
            self.session.ping()
        self.session.tap()
        self.assertGreater(self.session.ping(), 0)


class Scenes(unittest.TestCase):
    def test_one_after_another(self):
        """A worker is started once; each scene is empty, and numbers begin again."""
        with helio.connect(asset_roots=[os.path.dirname(os.path.realpath(MODEL))], timeout=200,
                           answer_timeout=300) as session:
            with session.scene() as scene:
                first = scene.load(MODEL)
                scene.edit("node_set", node=scene.new_id(), name="made")
                with self.assertRaises(helio.HelioError) as caught:
                    session.scene()
                self.assertEqual(caught.exception.status, helio.Status.E_STATE)
            with session.scene() as scene:
                self.assertEqual(list(scene.nodes()), [])
                again = scene.load(MODEL)
                self.assertEqual((again["asset"], again["nodes"]), (first["asset"], first["nodes"]))


class Examples(unittest.TestCase):
    def test_usage(self):
        folder = os.path.join(SOURCE, "client", "python", "examples")
        env = dict(os.environ, PYTHONPATH=os.path.join(SOURCE, "client", "python"))
        for name in sorted(os.listdir(folder)):
            ran = subprocess.run([sys.executable, os.path.join(folder, name)], env=env, timeout=60, text=True,
                                 stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            self.assertEqual((ran.returncode, ran.stdout), (2, ""), name)
            self.assertIn("%s " % name, ran.stderr)
            self.assertNotIn("Traceback", ran.stderr)

    def run_example(self, name, *args):
        env = dict(os.environ, PYTHONPATH=os.path.join(SOURCE, "client", "python"))
        path = os.path.join(SOURCE, "client", "python", "examples", name)
        return subprocess.run([sys.executable, path, *args], env=env, check=True, stdout=subprocess.PIPE,
                              timeout=300, text=True).stdout

    def run_here(self, session, name, *args):
        """In this process, with a session that is there already: starting workers takes longest."""
        view = functools.partialmethod(Scene.view, gi="none", temporal="none")
        path, out = os.path.join(SOURCE, "client", "python", "examples", name), io.StringIO()
        with mock.patch.object(helio, "connect", lambda **_: contextlib.nullcontext(session)), \
                mock.patch.object(Scene, "view", view), mock.patch.object(sys, "argv", [path, *args]), \
                contextlib.redirect_stdout(out):
            runpy.run_path(path, run_name="__main__")
        session.call("scene_close", "ok")
        return out.getvalue()

    def test_looking(self):
        roots = [os.path.dirname(os.path.realpath(MODEL))]
        with helio.connect(asset_roots=roots, timeout=200, answer_timeout=300) as session, \
                tempfile.TemporaryDirectory() as folder:
            self.run_here(session, "orbit.py", MODEL, os.path.join(folder, "%d.png"), "3", "32", "24")
            pictures = []
            for name in sorted(os.listdir(folder)):
                with open(os.path.join(folder, name), "rb") as f:
                    pictures.append(f.read())
            self.assertEqual(len(set(pictures)), 3)
            self.assertTrue(all(p[:4] == b"\x89PNG" for p in pictures))
            said = self.run_here(session, "pick.py", MODEL, "32", "24")
            self.assertRegex(said, r"^\S.* at \(.*\), \d+\.\d+ m away\n$")
            lines = self.run_here(session, "compare.py", MODEL, "2", "32", "24").splitlines()
        found = {name: float(value) for name, value in (line.split() for line in lines)}
        self.assertEqual(list(found), ["psnr", "ssim", "flip"])
        self.assertTrue(5 < found["psnr"] < 100 and 0 < found["ssim"] <= 1 and 0 <= found["flip"] < 1, found)

    def test_edit(self):
        with tempfile.TemporaryDirectory() as folder:
            before, after = os.path.join(folder, "a.png"), os.path.join(folder, "b.png")
            self.run_example("edit.py", before, after)
            with open(before, "rb") as a, open(after, "rb") as b:
                pictures = a.read(), b.read()
        self.assertTrue(all(p[:4] == b"\x89PNG" for p in pictures))
        self.assertNotEqual(pictures[0], pictures[1])

    def test_render(self):
        with tempfile.TemporaryDirectory() as folder:
            out = os.path.join(folder, "a.png")
            self.assertIn("settled", self.run_example("render.py", MODEL, out))
            self.assertGreater(os.path.getsize(out), 100)


if __name__ == "__main__":
    unittest.main()
