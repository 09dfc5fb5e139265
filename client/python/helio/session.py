"""Connections: to a daemon, or to a private worker that is started for them."""
from __future__ import annotations

import ctypes
import functools
import json
import os
import time
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Callable, Dict, Iterator, List, Optional, Sequence, Set, Tuple, Type, Union

from . import _lib
from ._lib import HelioError, lib
from ._enums import Role, Status

_Path = Union[str, "os.PathLike[str]"]
STATES = ("connecting", "greeting", "open", "closed")


@dataclass(frozen=True)
class Info:
    """What is known of a connection."""
    state: str
    role: Role
    version: int
    session: int
    max_message_bytes: int
    server: str
    device: Dict[str, Any]
    worker_pid: int
    draining: bool
    reconnects: int


@dataclass(frozen=True)
class Message:
    """A received message: its name, the request that it answers (0: none), its fields."""
    name: str
    request: int
    fields: Dict[str, Any]

    def __getitem__(self, field: str) -> Any:
        return self.fields[field]


def version() -> str:
    """Version of libhelio."""
    return str(lib.helio_version().decode())


def _ns(seconds: Optional[float]) -> int:
    return _lib.NO_TIMEOUT if seconds is None else max(0, int(seconds * 1e9))


def _worker() -> Optional[str]:
    """The private worker's program: of the environment, else ../libexec beside the library."""
    path = _lib.library_path()
    if os.environ.get("HELIO_WORKER") or not path:
        return os.environ.get("HELIO_WORKER")
    folder = os.path.dirname(path)
    for _ in range(4):
        worker = os.path.join(folder, "libexec", "helio-worker")
        if os.path.exists(worker):
            return worker
        folder = os.path.dirname(folder)
    return None


def _arguments(roots: Sequence[str], cache: Optional[str], more: Sequence[str]) -> List[str]:
    out: List[str] = ["--log", "warn"]
    for root in roots:
        out += ["--asset-root", os.path.realpath(root)]
    if cache:
        out += ["--cache-dir", os.path.realpath(cache)]
    return out + list(more)


def _file(path: Optional[_Path]) -> Optional[bytes]:
    return None if path is None else os.fsencode(path)


def connect(url: Optional[str] = None, *, token: Optional[str] = None, timeout: Optional[float] = 30,
            answer_timeout: Optional[float] = None, reconnect: float = 0,
            asset_roots: Sequence[str] = (), cache_dir: Optional[str] = None,
            worker: Optional[str] = None, worker_args: Sequence[str] = (), wait: bool = True,
            fd: Optional[int] = None, max_receive_bytes: int = 640 << 20, tls_ca: Optional[_Path] = None,
            tls_pin: Optional[str] = None, tls_cert: Optional[_Path] = None, tls_key: Optional[_Path] = None,
            tls_insecure: bool = False, scene: Optional[str] = None) -> "Session":
    """Opens a session.

    url          unix:PATH, tcp:HOST:PORT, tls:HOST:PORT, ws://HOST[:PORT][/PATH][?QUERY] or wss://...
                 (ports 80 and 443, path /hgp unless given), at most 255 bytes; None starts a private worker,
                 which may read the folders `asset_roots` and keeps its caches in `cache_dir`
    token        for daemons that want one; default HELIO_TOKEN of the environment
    timeout      seconds until the session is open; None: 30
    answer_timeout  seconds that each call waits for its answer (Session.timeout); None: for ever
    reconnect    seconds to go on with the session for when the connection is lost
    wait         False: return at once; the caller polls Session.fd and calls process()
    fd           a connected socket in place of url, which only names it then
    scene        ws, wss: name of the scene that is going to be opened, at most 128 bytes, for load balancers,
                 which see it in the request (/hgp?scene=) unless `url` has one; Session.scene opens it
    max_receive_bytes  greatest payload of a message that is taken, in bytes

    For tls and wss; files are PEM:
    tls_ca       file of the authorities that may have signed the daemon's certificate, or of a certificate
                 that signs itself; None: those of the system
    tls_pin      SHA-256 of the daemon's certificate (of its DER form), 64 digits 0-9 a-f: that certificate is
                 trusted, whatever has signed it
    tls_cert, tls_key  the client's own certificate, and its key when it is not in the same file
    tls_insecure  True: any certificate is accepted; whoever is between can read and change everything

    HelioError: E_INVAL: the URL, the scene's name, a file or the pin cannot be used; E_CLOSED: the daemon cannot be reached, or
    does not speak TLS there; E_AUTH: the token or the client's certificate is refused, or the daemon's
    certificate is not trusted; E_TIMEOUT; E_VERSION. With wait=False those of the connection come from process().
    """
    keep: List[Any] = []
    options = _lib.Options()
    if url is not None:
        options.url = url.encode()
    secret = token if token is not None else os.environ.get("HELIO_TOKEN")
    if secret and url is not None:
        options.token = secret.encode()
    options.client = b"python-helio"
    options.timeout_ns = 0 if timeout is None else _ns(timeout)
    options.reconnect_ns = _ns(reconnect)
    options.max_receive_bytes = max_receive_bytes
    options.tls_ca, options.tls_cert, options.tls_key = map(_file, (tls_ca, tls_cert, tls_key))
    options.tls_pin = None if tls_pin is None else tls_pin.encode()
    options.tls_insecure = tls_insecure
    options.scene = None if scene is None else scene.encode()
    program = worker or _worker()
    if program:
        options.worker = program.encode()
    arguments = [a.encode() for a in _arguments(asset_roots, cache_dir, worker_args)]
    block = (ctypes.c_char_p * (len(arguments) + 1))(*arguments, None)
    options.worker_args = block
    keep.append(block)
    handle, err = ctypes.c_void_p(), _lib.Error()
    if fd is not None:
        status = lib.helio_start_fd(options, fd, handle, err)
    else:
        status = lib.helio_start(options, handle, err)
    _lib.check(status, err)
    session = Session(handle, answer_timeout)
    if wait:
        session._wait_open(timeout)
    return session


class Session:
    """A connection with its rights. Closed by close(), by `with`, or when it is collected."""

    def __init__(self, handle: ctypes.c_void_p, timeout: Optional[float]) -> None:
        self._handle: Optional[ctypes.c_void_p] = handle
        self._timeout = timeout
        self._raised: Optional[BaseException] = None
        self._tap: Any = None
        self._credited: Set[int] = set()  # subscribed views whose frames are acknowledged when taken
        self.on_progress: Optional[Callable[[str, int, int], None]] = None
        self.on_notice: Optional[Callable[[Dict[str, Any]], None]] = None
        # The C side calls these as long as the connection lives.
        self._handlers = _lib.Handlers(None, _lib.TICK(self._guarded(self._on_tick, 1)),
                                       _lib.PROGRESS(self._guarded(self._on_progress, 2)),
                                       _lib.NOTICE(self._guarded(self._on_notice, 2)))
        lib.helio_set_handlers(handle, self._handlers)
        lib.helio_set_timeout(handle, _ns(timeout))

    # ---- life ----------------------------------------------------------------------------------

    def __enter__(self) -> "Session":
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], value: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    def close(self) -> None:
        """Ends the session, and the private worker with it. May be called again."""
        handle, self._handle = getattr(self, "_handle", None), None
        if handle:
            _lib.destroy(handle)

    @property
    def handle(self) -> ctypes.c_void_p:
        if not self._handle:
            raise HelioError(Status.E_CLOSED, "session", "", "is closed")
        return self._handle

    def _wait_open(self, timeout: Optional[float]) -> None:
        try:
            while self.info.state != "open":
                self.wait(30 if timeout is None else timeout)
        except BaseException:
            self.close()
            raise

    # ---- callbacks: an exception ends the call that waits --------------------------------------

    def _guarded(self, run: Callable[..., None], count: int) -> Callable[..., Any]:
        """`run` for C, with `count` arguments. Python runs the handlers of signals first thing in a function
        that it enters; what they raise there (Ctrl-C) would be printed and lost. So C enters a generator,
        which goes on inside of its `try`: max() hands it one argument after another."""
        def take() -> Iterator[Any]:
            while True:
                try:
                    while True:
                        arguments: List[Any] = []
                        for _ in range(count):
                            arguments.append((yield 0))
                        run(*arguments)
                except GeneratorExit:
                    return
                except BaseException as wrong:
                    below = wrong.__traceback__.tb_next if wrong.__traceback__ else None
                    self._raised = wrong.with_traceback(below)  # assertRaises clears the frames that it names
                    if self._handle:
                        lib.helio_interrupt(self._handle)

        entered: Any = take()
        next(entered)
        return functools.partial(max, key=entered.send) if count > 1 else entered.send  # type: ignore

    def _on_tick(self, _: Any) -> None:
        pass

    def _on_progress(self, _: Any, message: Any) -> None:
        if self.on_progress:
            fields = _lib.decode("progress", message.contents)
            self.on_progress(fields["stage"], fields["done"], fields["total"])

    def _on_notice(self, _: Any, message: Any) -> None:
        if self.on_notice:
            self.on_notice(_lib.decode("notice", message.contents))

    def _check(self, status: int, err: Any) -> None:
        raised, self._raised = self._raised, None
        if raised is not None:
            if status != Status.E_CANCELLED and self._handle:  # it ended before the interrupt was seen
                lib.helio_wait(self._handle, 0, _lib.Error())
            raise raised
        _lib.check(status, err)

    # ---- not blocking --------------------------------------------------------------------------

    @property
    def info(self) -> Info:
        raw = _lib.Info()
        lib.helio_get_info(self.handle, raw)
        device = json.loads(raw.device) if raw.device else {}
        return Info(STATES[raw.state], Role(raw.role), raw.version, raw.session, raw.max_message_bytes,
                    (raw.server or b"").decode("utf-8", "replace"), device, raw.worker_pid, raw.draining,
                    raw.reconnects)

    def fileno(self) -> int:
        """The descriptor to poll, for select and asyncio; -1 when closed."""
        return int(lib.helio_fd(self.handle))

    @property
    def wants_write(self) -> bool:
        return bool(lib.helio_want_write(self.handle))

    def process(self) -> None:
        """Reads and writes what is possible now."""
        err = _lib.Error()
        self._check(lib.helio_process(self.handle, err), err)

    def send(self, name: str, /, **fields: Any) -> int:
        """Queues a message; its answer has the number that is returned."""
        keep: List[Any] = []
        struct = _lib.encode(name, fields, keep)
        request, err = ctypes.c_uint32(), _lib.Error()
        self._check(lib.helio_send(self.handle, _lib.numbers[name], ctypes.byref(struct), request, err), err)
        return request.value

    def next(self) -> Optional[Message]:
        """The oldest message that has come; None: there is none."""
        out, err = ctypes.POINTER(_lib.Message)(), _lib.Error()
        status = lib.helio_next(self.handle, out, err)
        if status == Status.E_AGAIN:
            return None
        self._check(status, err)
        return self._take(out)

    def messages(self, timeout: Optional[float] = None) -> Iterator[Message]:
        """Messages as they come, until `timeout` seconds pass without one (None: for ever)."""
        return self._arrivals(timeout, lambda _: True)

    def _arrivals(self, timeout: Optional[float], counts: Callable[[Message], bool]) -> Iterator[Message]:
        """Messages, until `timeout` seconds pass without one that counts. What the library answers itself, such
        as signs of life, ends a wait as well."""
        begun = time.monotonic()
        while True:
            message = self.next()
            if message is not None:
                yield message
                begun = time.monotonic() if counts(message) else begun
                continue
            try:
                self.wait(None if timeout is None else max(0, begun + timeout - time.monotonic()))
            except HelioError as wrong:
                if wrong.status == Status.E_TIMEOUT:
                    return
                raise

    def tap(self, sent: Optional[Callable[[bytes], None]] = None,
            received: Optional[Callable[[Message], None]] = None) -> None:
        """Lets functions see what is sent (whole messages) and what comes. Without any it ends."""
        if sent is None and received is None:
            lib.helio_set_tap(self.handle, None)
            self._tap = None
            return

        def on_sent(_: Any, data: Any, size: int) -> None:
            if sent:
                sent(ctypes.string_at(data, size))

        def on_received(_: Any, message: Any) -> None:
            if received:
                received(self._decode(message.contents))

        self._tap = _lib.Tap(None, _lib.SENT(self._guarded(on_sent, 3)),
                             _lib.RECEIVED(self._guarded(on_received, 2)))
        lib.helio_set_tap(self.handle, self._tap)

    # ---- blocking ------------------------------------------------------------------------------

    @property
    def timeout(self) -> Optional[float]:
        """Seconds that each call waits for its answer; None: for ever."""
        return self._timeout

    @timeout.setter
    def timeout(self, seconds: Optional[float]) -> None:
        self._timeout = seconds
        lib.helio_set_timeout(self.handle, _ns(seconds))

    def wait(self, seconds: Optional[float] = None) -> None:
        """Until something came or went. HelioError with E_TIMEOUT: nothing did."""
        err = _lib.Error()
        self._check(lib.helio_wait(self.handle, _ns(seconds), err), err)

    def flush(self) -> None:
        err = _lib.Error()
        self._check(lib.helio_flush(self.handle, err), err)

    def interrupt(self) -> None:
        """Ends the call that waits in another thread with E_CANCELLED, else the next one."""
        lib.helio_interrupt(self.handle)

    def call(self, name: str, answer: Optional[str] = None, /, **fields: Any) -> Message:
        """Sends a message and waits for its answer; any other than `answer` is an error."""
        keep: List[Any] = []
        struct = _lib.encode(name, fields, keep)
        out, err = ctypes.POINTER(_lib.Message)(), _lib.Error()
        if answer is None:
            status = lib.helio_call(self.handle, _lib.numbers[name], ctypes.byref(struct), out, err)
        else:
            status = lib.helio_call_for(self.handle, _lib.numbers[name], ctypes.byref(struct),
                                        _lib.numbers[answer], out, err)
        self._check(status, err)
        return self._take(out)

    def ping(self) -> float:
        """Round trip in seconds."""
        rtt, err = ctypes.c_uint64(), _lib.Error()
        self._check(lib.helio_ping(self.handle, rtt, err), err)
        return rtt.value * 1e-9

    def query(self, name: str, view: int = 0) -> Any:
        """stats_query (of a view, if any), info_query, sessions_query or quarantine_query."""
        text, err = ctypes.c_void_p(), _lib.Error()
        self._check(lib.helio_query_json(self.handle, _lib.numbers[name], view, text, err), err)
        try:
            return json.loads(ctypes.string_at(text.value or 0))
        finally:
            lib.helio_text_free(text)

    def upload(self, files: Sequence[Union[str, Tuple[str, str]]]) -> List[Tuple[str, bytes]]:
        """Sends the contents that the server lacks. Files are paths, or (path, uri as the asset names
        it). Returns (uri, SHA-256) of each, for `files` of asset_load."""
        pairs = [(f, os.path.basename(f)) if isinstance(f, str) else f for f in files]
        block = (_lib.File * len(pairs))()
        for i, (path, uri) in enumerate(pairs):
            block[i].path, block[i].uri = path.encode(), uri.encode()
        sent, err = ctypes.c_uint64(), _lib.Error()
        self._check(lib.helio_upload(self.handle, block, len(pairs), sent, err), err)
        return [(uri, bytes(block[i].hash)) for i, (_, uri) in enumerate(pairs)]

    def compare(self, a: bytes, b: bytes, metric: str = "psnr") -> float:
        """A metric of two image files, as helio compare has it."""
        return float(self.call("compare", "compared", metric=metric, a=a, b=b, want_diff=False)["value"])

    def scene(self, name: str = "") -> "Scene":
        """Joins the shared scene of that name, or makes it; "" = one of this session's own, which is
        empty. A session has one at a time: close() the one before."""
        from .scene import Scene
        opened, err = _lib.structs["scene_opened"](), _lib.Error()
        self._check(lib.helio_scene_open(self.handle, name.encode(), opened, err), err)
        return Scene(self, _lib.decode("scene_opened", opened))

    # ---- inside --------------------------------------------------------------------------------

    @staticmethod
    def _decode(message: Any) -> Message:
        name = _lib.names[message.type]
        struct = ctypes.cast(message.body, ctypes.POINTER(_lib.structs[name])).contents
        return Message(name, message.request, _lib.decode(name, struct))

    def _take(self, pointer: Any) -> Message:
        try:
            message = self._decode(pointer.contents)
            if message.name == "frame" and message.request == 0 and message["view"] in self._credited:
                err = _lib.Error()
                _lib.check(lib.helio_taken(self.handle, pointer, err), err)
            return message
        finally:
            lib.helio_message_free(pointer)


from .scene import Scene  # noqa: E402  the two name each other
