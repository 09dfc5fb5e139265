#!/usr/bin/env python3
"""scene_hint.py HELIOD FAKE_WORKER HELIO - the scene that a client is going to open, in the request of its WebSocket: written
as a browser writes it, and only where the URL has none. A daemon takes such requests. HELIO_SOURCE_DIR and HELIO_LIBRARY
come from ctest."""

import os
import socket
import subprocess
import sys
import tempfile
import threading
import unittest

from transport_peers import Daemon, wait

sys.path.insert(0, os.path.join(os.environ["HELIO_SOURCE_DIR"], "client", "python"))
import helio  # noqa: E402

# new URL("hgp", ...).searchParams.set("scene", NAME) of a browser.
SPELLINGS = {"hall": "hall", "a b": "a+b", "a+b": "a%2Bb", "größte": "gr%C3%B6%C3%9Fte", "*-._~": "*-._%7E", "50% & ?=#/": "50%25+%26+%3F%3D%23%2F",
             "a:b@c!'()": "a%3Ab%40c%21%27%28%29", "x" * 128: "x" * 128, "ß" * 64: "%C3%9F" * 64}


class Listener:
    """Keeps the target of each request, and closes."""

    def __init__(self):
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.url = "ws://127.0.0.1:%d" % self.socket.getsockname()[1]
        self.targets = []
        threading.Thread(target=self.run, daemon=True).start()

    def run(self):
        while True:
            try:
                link, _ = self.socket.accept()
            except OSError:
                return
            with link:
                head = b""
                while b"\r\n\r\n" not in head and (part := link.recv(65536)):
                    head += part
                self.targets.append(head.split(b" ")[1].decode())

    def take(self):
        targets, self.targets = self.targets, []
        assert len(targets) == 1, targets
        return targets[0]


class Hints(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.listener = Listener()
        cls.addClassCleanup(cls.listener.socket.close)
        cls.daemon = Daemon(*sys.argv[1:3], "--listen", "tcp:127.0.0.1:0", tokens="admin-token-1 admin root\n")
        cls.addClassCleanup(cls.daemon.stop)

    def target(self, path="", scene=None):
        with self.assertRaises(helio.HelioError) as caught:
            helio.connect(self.listener.url + path, scene=scene, timeout=20)
        self.assertEqual(caught.exception.status, helio.Status.E_CLOSED)
        return self.listener.take()

    def test_written_as_a_browser_does(self):
        for name, written in SPELLINGS.items():
            self.assertEqual(self.target(scene=name), "/hgp?scene=" + written)

    def test_urls_keep_what_they_have(self):
        for path, scene, target in (("", None, "/hgp"), ("/", None, "/hgp"), ("", "", "/hgp"), ("/", "a", "/hgp?scene=a"), ("/x/hgp", "a", "/x/hgp?scene=a"),
                                    ("/hgp?k=1", "a", "/hgp?k=1&scene=a"), ("/hgp?scene=b", "a", "/hgp?scene=b"), ("/hgp?k=1&scene=b", "a", "/hgp?k=1&scene=b"),
                                    ("/hgp?my-scene=b", "a", "/hgp?my-scene=b&scene=a"), ("?k=1", "a", "/hgp?k=1&scene=a"), ("/?k=1", "a", "/hgp?k=1&scene=a"),
                                    ("/hgp?k=1", None, "/hgp?k=1")):
            self.assertEqual(self.target(path, scene), target)
        longest = "/" + "p" * (254 - len(self.listener.url))
        self.assertEqual(self.target(longest, "ß" * 64), longest + "?scene=" + "%C3%9F" * 64)
        for path, scene, said in ((longest + "p", None, "at most 255 bytes"), ("", "x" * 129, "at most 128 bytes")):
            with self.assertRaises(helio.HelioError) as caught:
                helio.connect(self.listener.url + path, scene=scene, timeout=20)
            self.assertEqual(caught.exception.status, helio.Status.E_INVAL)
            self.assertIn(said, str(caught.exception))

    def helio(self, *arguments):
        return subprocess.run([sys.argv[3], *arguments], check=False, capture_output=True, text=True, timeout=60)

    def test_commands(self):
        url = self.listener.url
        with tempfile.NamedTemporaryFile("w", suffix=".hls") as script:
            for text, target in (("scene \"the hall\"\n", "/hgp?scene=the+hall"), ("load demo:\n", "/hgp"),
                                 ("connect %s/x\nscene b\n" % url, "/x?scene=b"), ("connect %s/x?scene=c\nscene b\n" % url, "/x?scene=c"),
                                 ("connect %s/x\nload demo:\n" % url, "/x")):
                script.seek(0)
                script.truncate()
                script.write(text)
                script.flush()
                got = self.helio("run", script.name, "-c", url)
                self.assertEqual(got.returncode, 4, got)
                self.assertEqual(self.listener.take(), target, text)
        for arguments, target in ((("tickets", "make", "--scene", "hall"), "/hgp?scene=hall"), (("tickets", "list"), "/hgp"),
                                  (("message", "hello", "--scene", "hall"), "/hgp?scene=hall"), (("ping",), "/hgp")):
            got = self.helio(*arguments, "-c", url)
            self.assertEqual(got.returncode, 4, got)
            self.assertEqual(self.listener.take(), target, arguments)

    def test_view(self):
        helper = os.path.join(os.path.dirname(sys.argv[3]), "..", "libexec", "helio-view")
        if not os.path.exists(helper):
            self.skipTest("SDL2 is missing")
        window = subprocess.Popen([sys.argv[3], "view", "-c", self.listener.url, "--join", "hall"], env=dict(os.environ, SDL_VIDEODRIVER="dummy"))
        try:  # it shows what went wrong until it is closed
            wait(lambda: self.listener.targets or window.poll() is not None, "the request")
            self.assertEqual(self.listener.take(), "/hgp?scene=hall")
        finally:
            window.kill()
            window.wait()

    def test_a_daemon_takes_them(self):
        url = "ws://127.0.0.1:%d" % self.daemon.ports[0]
        for name in SPELLINGS:
            with helio.connect(url, token="admin-token-1", scene=name, timeout=60) as session:
                with session.scene(name) as scene:
                    self.assertFalse(scene.existed)


if __name__ == "__main__":
    os.environ.pop("HELIO_TOKEN", None)
    unittest.main(argv=sys.argv[:1])
