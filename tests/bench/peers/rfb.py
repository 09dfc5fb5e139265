"""A client of VNC that sends pointer movements and counts what comes back. It finds the ends of rectangles and
decodes none. Source: RFC 6143, "The Remote Framebuffer Protocol"; the Tight encoding of the community's RFB
specification (rfbproto), section 7.7.6.
"""
import select
import socket
import struct
import time

TIGHT, CURSOR, LAST_RECT = 7, -239, -224
JPEG_QUALITY_8 = -24
QUIET_S = 0.25  # without an update: the picture is complete
PATIENCE_S = 30


class Screen:
    def __init__(self, host, port):
        self.socket = socket.create_connection((host, port))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.bytes = 0
        self.buffer = b""
        self._take(12)
        self.socket.sendall(b"RFB 003.008\n")
        types = self._take(self._take(1)[0])
        if 1 not in types:
            raise ConnectionError("the VNC server asks for a password")
        self.socket.sendall(b"\x01")
        if self._take(4) != bytes(4):
            raise ConnectionError("the VNC server refused")
        self.socket.sendall(b"\x01")  # shared
        self.width, self.height = struct.unpack(">HH", self._take(4))
        self._take(16)
        self._take(struct.unpack(">I", self._take(4))[0])
        pixels = struct.pack(">BBBBHHHBBBxxx", 32, 24, 0, 1, 255, 255, 255, 16, 8, 0)
        self.socket.sendall(b"\x00\x00\x00\x00" + pixels)
        encodings = (TIGHT, JPEG_QUALITY_8, CURSOR, LAST_RECT)
        self.socket.sendall(struct.pack(">BxH", 2, len(encodings)) + struct.pack(f">{len(encodings)}i", *encodings))
        self._request(False)

    def _take(self, count):
        while len(self.buffer) < count:
            got = self.socket.recv(1 << 20)
            if not got:
                raise ConnectionError("the VNC server closed the connection")
            self.bytes += len(got)
            self.buffer += got
        taken, self.buffer = self.buffer[:count], self.buffer[count:]
        return taken

    def _request(self, incremental):
        self.socket.sendall(struct.pack(">BBHHHH", 3, incremental, 0, 0, self.width, self.height))

    def _waits(self, seconds):
        return bool(self.buffer) or bool(select.select([self.socket], [], [], seconds)[0])

    def _compact(self):
        length = 0
        for shift in (0, 7, 14):
            byte = self._take(1)[0]
            length |= (byte & (0x7F if shift < 14 else 0xFF)) << shift
            if byte < 0x80:
                break
        return length

    def _tight(self, width, height):
        control = self._take(1)[0] >> 4
        if control == 8:  # one colour
            self._take(3)
            return
        if control == 9:  # JPEG
            self._take(self._compact())
            return
        size = width * height * 3
        if control & 4:  # a filter is named
            if self._take(1)[0] == 1:  # a palette
                colors = self._take(1)[0] + 1
                self._take(3 * colors)
                size = (width + 7) // 8 * height if colors == 2 else width * height
        self._take(size if size < 12 else self._compact())

    def _update(self):
        """Reads a message of the server; returns how many pixels it changed."""
        kind = self._take(1)[0]
        if kind == 2:  # bell
            return 0
        if kind == 3:  # cut text
            self._take(3)
            self._take(struct.unpack(">I", self._take(4))[0])
            return 0
        if kind != 0:
            raise ConnectionError(f"the VNC server sent a message of type {kind}")
        count, pixels = struct.unpack(">xH", self._take(3))[0], 0
        for _ in range(count):
            _, _, width, height, encoding = struct.unpack(">HHHHi", self._take(12))
            if encoding == LAST_RECT:
                break
            if encoding == CURSOR:
                self._take(width * height * 4 + (width + 7) // 8 * height)
            elif encoding == TIGHT:
                self._tight(width, height)
                pixels += width * height
            elif encoding == 0:
                self._take(width * height * 4)
                pixels += width * height
            else:
                raise ConnectionError(f"the VNC server sent encoding {encoding}")
        self._request(True)
        return pixels

    def drain(self):
        """Reads updates until there are none for a second."""
        while self._waits(1):
            self._update()

    def move(self, x, y):
        """Moves the pointer; milliseconds until the last update that it caused."""
        begun = changed = time.monotonic()
        self.socket.sendall(struct.pack(">BBHH", 5, 0, x, y))
        pixels = 0
        while self._waits(QUIET_S if pixels else PATIENCE_S):
            pixels += self._update()
            changed = time.monotonic()
        if not pixels:
            raise ConnectionError(f"no picture within {PATIENCE_S} s of a movement")
        return 1e3 * (changed - begun)
