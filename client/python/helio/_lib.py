"""libhelio by ctypes: finds the library, declares its functions, and turns messages into Python
values and back. The C header client/include/helio/helio.h is the reference."""
from __future__ import annotations

import ctypes
import ctypes.util
import difflib
import enum
import operator
import os
import threading
from ctypes import (POINTER, c_bool, c_char, c_char_p, c_double, c_float, c_int, c_int32, c_size_t,
                    c_uint8, c_uint16, c_uint32, c_uint64, c_void_p)
from typing import Any, Dict, List, Mapping, Optional, Tuple

from ._enums import ENUMS, STATUS_NAMES, Status
from ._messages import RANGES, RECORDS

NO_TIMEOUT = 2 ** 64 - 1


class HelioError(Exception):
    """What libhelio refuses or could not do.

    status  Status, such as Status.E_NOTFOUND
    what    file, message or object; where: field, JSON pointer or byte; reason: for people
    limit   of Status.E_LIMIT and E_BUSY: which one, by the name of the daemon's option; or ""
    retry_after  seconds after which the same may succeed; None: not by waiting
    """

    def __init__(self, status: int, what: str = "", where: str = "", reason: str = "",
                 limit: str = "", retry_after: Optional[float] = None) -> None:
        self.status = Status(status) if status in STATUS_NAMES else status
        self.what, self.where, self.reason = what, where, reason
        self.limit, self.retry_after = limit, retry_after
        words = [part for part in (what, where, reason) if part]
        super().__init__("%s (%s)" % (": ".join(words), STATUS_NAMES.get(int(status), "unknown")))


class Error(ctypes.Structure):
    _fields_ = [("status", c_int), ("what", c_char * 256), ("where", c_char * 128),
                ("reason", c_char * 256), ("limit", c_char * 32), ("retry_after_ms", c_uint32)]


class Str(ctypes.Structure):
    _fields_ = [("data", c_void_p), ("size", c_uint32)]


_SCALARS: Dict[str, Any] = {
    "U8": c_uint8, "U16": c_uint16, "U32": c_uint32, "U64": c_uint64, "I32": c_int32, "F32": c_float,
    "F64": c_double, "BOOL": c_bool, "ENUM": c_int, "STR": Str, "BYTES": Str, "VEC2": c_float * 2,
    "VEC3": c_float * 3, "VEC4": c_float * 4, "MAT4": c_float * 16, "HASH": c_uint8 * 32,
}

structs: Dict[str, Any] = {}
numbers: Dict[str, int] = {}
names: Dict[int, str] = {}


def _make(name: str) -> Any:
    if name in structs:
        return structs[name]
    number, _, rows = RECORDS[name]
    fields: List[Tuple[str, Any]] = []
    for field, kind, of, optional in rows:
        if optional:
            fields.append(("has_" + field, c_bool))
        if kind == "LIST":
            part = type("List_" + of, (ctypes.Structure,),
                        {"_fields_": [("items", POINTER(_make(of))), ("count", c_uint32)]})
            fields.append((field, part))
        else:
            fields.append((field, _SCALARS[kind]))
    if number:
        fields.append(("end_", c_char))
        numbers[name], names[number] = number, name
    structs[name] = type("hgp_" + name, (ctypes.Structure,), {"_fields_": fields})
    return structs[name]


for _name in RECORDS:
    _make(_name)


# ---- values ------------------------------------------------------------------------------------

def _enum(of: str, value: Any) -> int:
    if isinstance(value, str):
        key = value.upper().replace("-", "_")
        if key not in ENUMS[of].__members__:
            raise ValueError("%r is none of %s" % (value, " ".join(n.lower() for n in ENUMS[of].__members__)))
        return int(ENUMS[of][key])
    return operator.index(value)


def _text(value: Any, keep: List[Any]) -> Str:
    if isinstance(value, int):  # bytes() would make so many zeros of it
        raise TypeError("%r is neither text nor bytes" % (value,))
    data = value.encode() if isinstance(value, str) else bytes(value)
    buffer = ctypes.create_string_buffer(data, len(data) + 1)
    keep.append(buffer)
    return Str(ctypes.cast(buffer, c_void_p), len(data))


def encode(name: str, values: Mapping[str, Any], keep: List[Any]) -> Any:
    """The C struct of a message. `keep` holds what it points at: it has to live as long. A required field
    that is not there, or None, is a TypeError."""
    if name not in structs:
        near = difflib.get_close_matches(name, numbers)
        raise ValueError("there is no message %r%s" % (name, "; is it %s?" % " or ".join(near) if near else ""))
    out = structs[name]()
    rows = {row[0]: row for row in RECORDS[name][2]}
    for field, value in values.items():
        if field not in rows:
            raise TypeError("%s has no field %r; it has %s" % (name, field, ", ".join(rows)))
        if value is None:
            continue
        _, kind, of, optional = rows[field]
        if optional:
            setattr(out, "has_" + field, True)
        try:
            setattr(out, field, _integer(name, field, kind, value) if kind in _WHOLE else
                    _encode_value(kind, of, value, keep))
        except (TypeError, ValueError) as wrong:
            raised = TypeError if isinstance(wrong, TypeError) else ValueError
            raise raised("%s: %s: %s" % (name, field, wrong)) from None
    missing = [field for field, row in rows.items() if not row[3] and values.get(field) is None]
    if missing:
        raise TypeError("%s needs %s" % (name, ", ".join(missing)))
    return out


_WHOLE: Dict[str, Tuple[int, int]] = {
    "U8": (0, 2 ** 8 - 1), "U16": (0, 2 ** 16 - 1), "U32": (0, 2 ** 32 - 1), "U64": (0, 2 ** 64 - 1),
    "I32": (-2 ** 31, 2 ** 31 - 1)}


def _integer(name: str, field: str, kind: str, value: Any) -> int:
    """In its range: ctypes takes any integer and keeps its lowest bits."""
    number = operator.index(value)
    least, most = RANGES.get(name, {}).get(field, _WHOLE[kind])
    if not least <= number <= most:
        raise HelioError(Status.E_INVAL, name, field, "%d is outside of %d to %d" % (number, least, most))
    return number


def _encode_value(kind: str, of: str, value: Any, keep: List[Any]) -> Any:
    if kind in ("STR", "BYTES"):
        return _text(value, keep)
    if kind == "ENUM":
        return _enum(of, value)
    if kind == "BOOL" and isinstance(value, (str, bytes)):  # "no" would be true
        raise TypeError("%r is neither True nor False" % (value,))
    if kind in ("VEC2", "VEC3", "VEC4", "MAT4", "HASH"):
        array = _SCALARS[kind]
        items = list(value)
        if len(items) != array._length_:
            raise ValueError("%d values are needed, not %d" % (array._length_, len(items)))
        return array(*items)
    if kind == "LIST":
        block = (structs[of] * len(value))(*[encode(of, item, keep) for item in value])
        keep.append(block)
        return (ctypes.cast(block, POINTER(structs[of])), len(value))  # a struct takes a tuple
    return value


def decode(name: str, struct: Any) -> Dict[str, Any]:
    """The fields of a message as Python values; an optional field that is not there is not a key."""
    out: Dict[str, Any] = {}
    for field, kind, of, optional in RECORDS[name][2]:
        if not optional or getattr(struct, "has_" + field):
            out[field] = _decode_value(kind, of, getattr(struct, field))
    return out


def _decode_value(kind: str, of: str, value: Any) -> Any:
    if kind in ("STR", "BYTES"):
        data = ctypes.string_at(value.data, value.size) if value.size else b""
        return data.decode("utf-8", "replace") if kind == "STR" else data
    if kind == "ENUM":
        known = ENUMS[of]
        return known(value) if value in known._value2member_map_ else value
    if kind in ("VEC2", "VEC3", "VEC4", "MAT4"):
        return tuple(value)
    if kind == "HASH":
        return bytes(value)
    if kind == "LIST":
        return [decode(of, value.items[i]) for i in range(value.count)]
    return value


# ---- functions ---------------------------------------------------------------------------------

class Options(ctypes.Structure):
    _fields_ = [("url", c_char_p), ("token", c_char_p), ("client", c_char_p),
                ("timeout_ns", c_uint64), ("max_receive_bytes", c_uint32), ("worker", c_char_p),
                ("worker_args", POINTER(c_char_p)), ("reconnect_ns", c_uint64), ("tls_ca", c_char_p),
                ("tls_pin", c_char_p), ("tls_cert", c_char_p), ("tls_key", c_char_p), ("tls_insecure", c_bool),
                ("scene", c_char_p)]


class Info(ctypes.Structure):
    _fields_ = [("state", c_int), ("role", c_int), ("version", c_uint16), ("session", c_uint64),
                ("max_message_bytes", c_uint32), ("server", c_char_p), ("device", c_char_p),
                ("worker_pid", c_int), ("draining", c_bool), ("scene", c_char_p), ("reconnects", c_uint32)]


class Message(ctypes.Structure):
    _fields_ = [("type", c_int), ("request", c_uint32), ("size_bytes", c_uint32), ("body", c_void_p),
                ("begun_ns", c_uint64), ("received_ns", c_uint64)]


class File(ctypes.Structure):
    _fields_ = [("path", c_char_p), ("uri", c_char_p), ("hash", c_uint8 * 32)]


TICK = ctypes.CFUNCTYPE(None, c_void_p)
PROGRESS = ctypes.CFUNCTYPE(None, c_void_p, POINTER(structs["progress"]))
NOTICE = ctypes.CFUNCTYPE(None, c_void_p, POINTER(structs["notice"]))
TOLD = ctypes.CFUNCTYPE(None, c_void_p, POINTER(structs["message"]))
IDLE = ctypes.CFUNCTYPE(None, c_void_p, POINTER(structs["idle_warning"]))
SENT = ctypes.CFUNCTYPE(None, c_void_p, POINTER(c_uint8), c_size_t)
RECEIVED = ctypes.CFUNCTYPE(None, c_void_p, POINTER(Message))


class Handlers(ctypes.Structure):
    _fields_ = [("user", c_void_p), ("tick", TICK), ("progress", PROGRESS), ("notice", NOTICE),
                ("message", TOLD), ("idle", IDLE)]


class Tap(ctypes.Structure):
    _fields_ = [("user", c_void_p), ("sent", SENT), ("received", RECEIVED)]


_ERR, _H = POINTER(Error), c_void_p
_MESSAGE = POINTER(POINTER(Message))

# Every function of helio.h: result and arguments.
PROTOTYPES: Dict[str, Tuple[Any, List[Any]]] = {
    "helio_version": (c_char_p, []),
    "helio_start": (c_int, [POINTER(Options), POINTER(_H), _ERR]),
    "helio_start_fd": (c_int, [POINTER(Options), c_int, POINTER(_H), _ERR]),
    "helio_connect": (c_int, [POINTER(Options), POINTER(_H), _ERR]),
    "helio_destroy": (None, [_H]),
    "helio_get_info": (None, [_H, POINTER(Info)]),
    "helio_fd": (c_int, [_H]),
    "helio_want_write": (c_bool, [_H]),
    "helio_process": (c_int, [_H, _ERR]),
    "helio_send": (c_int, [_H, c_int, c_void_p, POINTER(c_uint32), _ERR]),
    "helio_next": (c_int, [_H, _MESSAGE, _ERR]),
    "helio_message_free": (None, [POINTER(Message)]),
    "helio_message_error": (c_int, [_H, POINTER(Message), _ERR]),
    "helio_taken": (c_int, [_H, POINTER(Message), _ERR]),
    "helio_set_handlers": (None, [_H, POINTER(Handlers)]),
    "helio_set_tap": (None, [_H, POINTER(Tap)]),
    "helio_set_timeout": (None, [_H, c_uint64]),
    "helio_interrupt": (None, [_H]),
    "helio_wait": (c_int, [_H, c_uint64, _ERR]),
    "helio_flush": (c_int, [_H, _ERR]),
    "helio_call": (c_int, [_H, c_int, c_void_p, _MESSAGE, _ERR]),
    "helio_call_for": (c_int, [_H, c_int, c_void_p, c_int, _MESSAGE, _ERR]),
    "helio_ping": (c_int, [_H, POINTER(c_uint64), _ERR]),
    "helio_scene_open": (c_int, [_H, c_char_p, POINTER(structs["scene_opened"]), _ERR]),
    "helio_load": (c_int, [_H, c_uint32, c_char_p, POINTER(structs["asset_loaded"]), _ERR]),
    "helio_upload": (c_int, [_H, POINTER(File), c_uint32, POINTER(c_uint64), _ERR]),
    "helio_frame": (c_int, [_H, POINTER(structs["frame_request"]), _MESSAGE, _ERR]),
    "helio_camera_fit": (c_int, [_H, POINTER(structs["view_fit"]), POINTER(structs["view_camera"]), _ERR]),
    "helio_query_json": (c_int, [_H, c_int, c_uint32, POINTER(c_void_p), _ERR]),
    "helio_text_free": (None, [c_void_p]),
    "helio_object_id": (c_uint64, [c_uint32, c_uint32]),
    "helio_camera_orbit": (None, [c_double, c_double, c_double, c_double * 3,
                                  POINTER(structs["view_camera"])]),
    "helio_view_angles": (c_bool, [c_char_p, POINTER(c_double), POINTER(c_double)]),
}


def _candidates() -> List[str]:
    here = os.path.dirname(os.path.abspath(__file__))
    given = os.environ.get("HELIO_LIBRARY")
    if given:
        return [given]
    out = []
    folder = here
    for _ in range(6):  # a prefix that was moved: PREFIX/lib/python3/dist-packages/helio
        folder = os.path.dirname(folder)
        out += [os.path.join(folder, "libhelio.so.0"), os.path.join(folder, "lib", "libhelio.so.0")]
    found = ctypes.util.find_library("helio")
    return [path for path in out if os.path.exists(path)] + ([found] if found else []) + ["libhelio.so.0"]


def _open() -> ctypes.CDLL:
    reasons = []
    for path in _candidates():
        try:
            return ctypes.CDLL(path)
        except OSError as wrong:
            reasons.append(str(wrong))
    raise ImportError("libhelio cannot be opened (HELIO_LIBRARY names it): " + "; ".join(reasons))


lib = _open()
for _function, (_result, _arguments) in PROTOTYPES.items():
    getattr(lib, _function).restype = _result
    getattr(lib, _function).argtypes = _arguments


# ---- one thread at a time ----------------------------------------------------------------------

_locks: Dict[int, Any] = {}  # of handles


def _one_at_a_time(function: Any) -> Any:
    """Two threads in one connection would read and write the same memory: the second one is refused."""
    def call(handle: c_void_p, *arguments: Any) -> Any:
        lock = _locks.setdefault(handle.value or 0, threading.RLock())
        if not lock.acquire(blocking=False):
            raise HelioError(Status.E_STATE, "session", "", "another thread is using it")
        try:
            if not handle.value:
                raise HelioError(Status.E_CLOSED, "session", "", "is closed")
            return function(handle, *arguments)
        finally:
            lock.release()
    return call


def destroy(handle: c_void_p) -> None:
    """Ends a connection, and before it the call of another thread that waits."""
    lock = _locks.setdefault(handle.value or 0, threading.RLock())
    if not lock.acquire(blocking=False):
        lib.helio_interrupt(handle)
        lock.acquire()
    try:
        lib.helio_destroy(handle)
    finally:
        _locks.pop(handle.value or 0, None)
        handle.value = None
        lock.release()


for _function, (_, _arguments) in PROTOTYPES.items():
    if _arguments[:1] == [_H] and _function not in ("helio_interrupt", "helio_destroy"):
        setattr(lib, _function, _one_at_a_time(getattr(lib, _function)))


def library_path() -> Optional[str]:
    """Where the library that was opened lies; None where the system's search found it."""
    name = lib._name
    return os.path.realpath(name) if name and os.path.sep in name else None


def check(status: int, err: Error) -> None:
    if status:
        retry_s = err.retry_after_ms / 1000 if err.retry_after_ms else None
        what, where, reason, limit = (part.decode("utf-8", "replace") for part in
                                      (err.what, err.where, err.reason, err.limit))
        raise HelioError(status, what, where, reason, limit, retry_s)


def enum_value(of: str, value: Any) -> enum.IntEnum:
    return ENUMS[of](_enum(of, value))
