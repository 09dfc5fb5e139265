"""Digests of image files for same_bytes.py: of all bytes, and of what the pixels are made from.

The second one leaves out metadata, so that a picture whose attributes changed is told from one
whose pixels did. Compressed blocks are not unpacked where the same pixels give the same blocks.
"""
import hashlib
import os
import struct
import zlib


class Malformed(Exception):
    pass


# ---- PNG ------------------------------------------------------------------------------------------

def png_pixels(data):
    digest, packed, at = hashlib.sha256(), b"", 8
    while at + 12 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            digest.update(body)
        if kind == b"IDAT":
            packed += body
        at += 12 + size
    if not packed:
        raise Malformed("a PNG file without pixels")
    digest.update(zlib.decompress(packed))
    return digest.hexdigest()


# ---- JPEG -----------------------------------------------------------------------------------------

COMMENT, SCAN = 0xFE, 0xDA


def jpeg_pixels(data):
    """Tables, frame and scans; no comments."""
    digest, at = hashlib.sha256(), 2
    while at + 4 <= len(data) and data[at] == 0xFF:
        kind, size = struct.unpack_from(">BH", data, at + 1)
        if kind == SCAN:
            digest.update(data[at:])
            return digest.hexdigest()
        if kind != COMMENT:
            digest.update(data[at:at + 2 + size])
        at += 2 + size
    raise Malformed("a JPEG file without a scan")


# ---- OpenEXR --------------------------------------------------------------------------------------

MULTIPART = 0x1000
# Rows of a chunk by the number of the compression; section "Chunk layout" of the file layout.
CHUNK_ROWS = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32, 5: 16, 6: 32, 7: 32, 8: 32, 9: 256}
# What decides how chunks are read.
SHAPE = (b"channels", b"compression", b"dataWindow", b"displayWindow", b"lineOrder", b"name",
         b"type", b"view")


def exr_text(data, at):
    end = data.index(b"\0", at)
    return data[at:end], end + 1


def exr_header(data, at):
    """(attributes, where the next header begins)."""
    found = {}
    while data[at] != 0:
        name, at = exr_text(data, at)
        _, at = exr_text(data, at)
        size, = struct.unpack_from("<I", data, at)
        found[name] = data[at + 4:at + 4 + size]
        at += 4 + size
    return found, at + 1


def exr_chunks(header):
    if b"chunkCount" in header:
        return struct.unpack("<I", header[b"chunkCount"])[0]
    _, top, _, bottom = struct.unpack("<4i", header[b"dataWindow"])
    rows = CHUNK_ROWS[header[b"compression"][0]]
    return (bottom - top + rows) // rows


def exr_pixels(data):
    flags, = struct.unpack_from("<I", data, 4)
    headers, at = [], 8
    while True:
        header, at = exr_header(data, at)
        headers.append(header)
        if not flags & MULTIPART:
            break
        if data[at] == 0:
            at += 1
            break
    digest = hashlib.sha256()
    for header in headers:
        for name in SHAPE:
            digest.update(name + b"=" + header.get(name, b"") + b";")
    # Behind the headers: a table of offsets, then the chunks.
    digest.update(data[at + 8 * sum(map(exr_chunks, headers)):])
    return digest.hexdigest()


PIXELS = ((b"\x89PNG", png_pixels), (b"\xff\xd8", jpeg_pixels), (b"\x76\x2f\x31\x01", exr_pixels))


def of_file(path):
    """{"file": digest, "pixels": digest} of an image file."""
    with open(path, "rb") as file:
        data = file.read()
    for magic, pixels in PIXELS:
        if data.startswith(magic):
            return {"file": hashlib.sha256(data).hexdigest(), "pixels": pixels(data)}
    raise Malformed("%s is no PNG, JPEG or EXR file" % path)


def of_folder(folder):
    """{name: digest} of the files of a folder."""
    found = {}
    for root, _, names in os.walk(folder):
        for name in names:
            path = os.path.join(root, name)
            with open(path, "rb") as file:
                found[os.path.relpath(path, folder)] = hashlib.sha256(file.read()).hexdigest()
    return found
