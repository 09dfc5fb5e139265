"""A daemon for tests that render many pictures: its worker loads libraries, opens the device and makes
pipelines once, which is most of a short process."""
import contextlib
import hashlib
import os
import shutil
import subprocess
import tempfile
import time


def baked(helio):
    """A cache folder of all tests of a build that are not about caches, so that each texture and environment is baked
    once. It has the name of the worker that fills it: what another build baked decides no picture, and is removed."""
    build = os.path.dirname(os.path.dirname(os.path.abspath(helio)))
    with open(os.path.join(build, "libexec", "helio-worker"), "rb") as file:
        name = hashlib.file_digest(file, "sha256").hexdigest()[:16]
    folder = os.path.join(build, "tests", "baked")
    os.makedirs(os.path.join(folder, name), exist_ok=True)
    for other in os.listdir(folder):
        if other != name:
            shutil.rmtree(os.path.join(folder, other), ignore_errors=True)
    return os.path.join(folder, name)


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
