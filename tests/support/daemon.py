"""A daemon for tests that render many pictures: its worker loads libraries, opens the device and makes
pipelines once, which is most of a short process."""
import contextlib
import os
import subprocess
import tempfile
import time


@contextlib.contextmanager
def daemon(helio, roots, cache=None, device=None):
    """The URL of a heliod beside the program `helio` that reads below the folders `roots`. Its worker has all
    the time it takes: where pictures take too long is for their test to say. It is
    a shared one: it takes compiled shaders from $MESA_SHADER_CACHE_DIR, where that of a tenant compiles its own."""
    with tempfile.TemporaryDirectory(prefix="helio-") as folder:  # names of sockets have room for 108 bytes
        url, ready = "unix:%s/socket" % folder, os.path.join(folder, "ready")
        command = [os.path.join(os.path.dirname(helio), "heliod"), "--listen", url, "--port-file", ready,
                   "--hang-timeout", "3600", "--isolation", "shared", "--sandbox", "best-effort", "--log", "warn"]
        for root in filter(os.path.isdir, roots):  # test data may be missing
            command += ["--asset-root", root]
        command += ["--cache-dir", cache] if cache else []
        command += ["--device", device] if device else []
        child = subprocess.Popen(command)
        try:
            while not os.path.exists(ready):
                if child.poll() is not None:
                    raise SystemExit("heliod did not start")
                time.sleep(0.02)
            yield url
        finally:
            child.terminate()
            child.wait()
