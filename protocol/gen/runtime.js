// ---- codec -------------------------------------------------------------------------------------
//
// A message is a plain object by the names of messages.def. u8 .. f64 are numbers, u64 is a BigInt
// (whole numbers are taken as well), enums are the names of their values, str is a string, bytes
// and hash are Uint8Array, vectors and matrices are arrays of numbers, lists are arrays of objects.
// An optional field that is not there is not a key of the object.

export const PREFACE = Uint8Array.of(0x48, 0x47, 0x50, 0x0d, 0x0a, 0x1a, 0x0a, 0x01);
export const HEADER_BYTES = 16;
export const FLAG_OPTIONAL = 1;

// Thrown for everything refused. `status` is a name of the status table; `field` is empty when the
// payload ends inside the message or runs over; `offset` counts bytes of the payload.
export class HgpError extends Error {
    constructor(status, field, offset, reason) {
        super(`${field ? field + ": " : ""}${reason} (${status}, byte ${offset})`);
        this.name = "HgpError";
        this.status = status;
        this.field = field;
        this.offset = offset;
        this.reason = reason;
    }
}

const byType = new Map(Object.entries(messages).map(([name, m]) => [m.type, { name, ...m }]));

// { name, type, direction, state, role, since, fields }, or undefined for an unknown type.
export function findMessage(type) {
    return byType.get(type);
}

// ---- headers -----------------------------------------------------------------------------------

export function encodeHeader({ length, type, flags = 0, request = 0, channel = 0 }) {
    const view = new DataView(new ArrayBuffer(HEADER_BYTES));
    view.setUint32(0, length, true);
    view.setUint16(4, type, true);
    view.setUint16(6, flags, true);
    view.setUint32(8, request, true);
    view.setUint32(12, channel, true);
    return new Uint8Array(view.buffer);
}

export function decodeHeader(bytes, limit) {
    if (bytes.length < HEADER_BYTES)
        throw new HgpError("truncated", "", bytes.length, "a header has 16 bytes");
    const view = new DataView(bytes.buffer, bytes.byteOffset, HEADER_BYTES);
    const header = {
        length: view.getUint32(0, true),
        type: view.getUint16(4, true),
        flags: view.getUint16(6, true),
        request: view.getUint32(8, true),
        channel: view.getUint32(12, true),
    };
    if (header.length > limit)
        throw new HgpError("limit", "length", 0, "the payload is longer than allowed");
    if (header.flags & ~FLAG_OPTIONAL)
        throw new HgpError("format", "flags", 6, "an unknown flag is set");
    return header;
}

// ---- rules of values, the same for both directions ---------------------------------------------

const WIDTHS = { u8: 1, u16: 2, u32: 4, u64: 8, i32: 4, f32: 4, f64: 8, bool: 1, enum: 2, hash: 32 };
const FLOATS = { vec2: 2, vec3: 3, vec4: 4, mat4: 16 };

function checkRange(value, least, most) {
    return value < least || value > most ? `${value} is outside of ${least} to ${most}` : null;
}

// The reason why a number, enum or vector is refused, or null.
function checkValue(field, value) {
    switch (field.kind) {
    case "f32":
        if (!Number.isFinite(value))
            return `${value} is not a finite number`;
        return checkRange(value, Math.fround(field.least), Math.fround(field.most));
    case "f64":
        if (!Number.isFinite(value))
            return `${value} is not a finite number`;
        return checkRange(value, field.least, field.most);
    case "vec2":
    case "vec3":
    case "vec4":
    case "mat4":
        return value.every(Number.isFinite) ? null : "not a finite number";
    case "enum":
        return value === undefined ? "not a value of its enum" : null;
    case "hash":
        return null;
    default:
        return checkRange(value, field.least, field.most);
    }
}

function optionalFields(fields, version) {
    return fields.filter((f) => f.optional && f.since <= version);
}

// Optional fields of one bitmap. A message with more has a second one in front of the first of
// the others, and only when one of them is there.
const BITMAP_FIELDS = 32;

// The bits of the optional fields of a bitmap for which is(field) holds.
function bitmapOf(fields, bitmap, is) {
    let bits = 0;
    fields.filter((f) => f.optional).forEach((f, i) => {
        if (Math.floor(i / BITMAP_FIELDS) === bitmap && is(f))
            bits |= 1 << i % BITMAP_FIELDS;
    });
    return bits >>> 0;
}

function knownBits(fields, bitmap, version) {
    return bitmapOf(fields, bitmap, (f) => f.since <= version);
}

function leastBytes(fields, version) {
    const required = fields.filter((f) => !f.optional && f.since <= version);
    const one = (f) => WIDTHS[f.kind] ?? (f.kind in FLOATS ? 4 * FLOATS[f.kind] : 4);
    const bitmap = optionalFields(fields, version).length ? 4 : 0;
    return required.reduce((sum, f) => sum + one(f), bitmap);
}

// ---- decoding ----------------------------------------------------------------------------------

const utf8 = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });

class Reader {
    constructor(bytes, version) {
        this.bytes = bytes;
        this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
        this.version = version;
        this.pos = 0;
    }
    // Moves over `size` bytes and returns where they start.
    take(size) {
        if (size > this.bytes.length - this.pos)
            throw new HgpError("truncated", "", this.pos, "the payload ends inside the message");
        const at = this.pos;
        this.pos += size;
        return at;
    }
    u8() { return this.view.getUint8(this.take(1)); }
    u16() { return this.view.getUint16(this.take(2), true); }
    u32() { return this.view.getUint32(this.take(4), true); }
    i32() { return this.view.getInt32(this.take(4), true); }
    u64() { return this.view.getBigUint64(this.take(8), true); }
    f32() { return this.view.getFloat32(this.take(4), true); }
    f64() { return this.view.getFloat64(this.take(8), true); }
    blob(size) {
        const at = this.take(size);
        return this.bytes.subarray(at, at + size);
    }
}

function readText(bytes) {
    try {
        const text = utf8.decode(bytes);
        return text.includes("\0") ? null : text;
    } catch {
        return null;
    }
}

function decodeBlob(r, field, path, at) {
    const size = r.u32();
    if (size > field.max)
        throw new HgpError("limit", path, at, "longer than allowed");
    const bytes = r.blob(size);
    if (field.kind === "bytes")
        return bytes;
    const text = readText(bytes);
    if (text === null)
        throw new HgpError("format", path, at, "not UTF-8 without NUL");
    return text;
}

function decodeList(r, field, path, at) {
    const count = r.u32();
    if (count > field.max)
        throw new HgpError("limit", path, at, "more items than allowed");
    const fields = structs[field.items];
    if (count * leastBytes(fields, r.version) > r.bytes.length - r.pos)
        throw new HgpError("truncated", "", r.pos, "the payload ends inside the message");
    const list = [];
    for (let i = 0; i < count; i++)
        list.push(decodeFields(r, fields, `${path}[${i}].`));
    return list;
}

function readFixed(r, field) {
    if (field.kind in FLOATS)
        return Array.from({ length: FLOATS[field.kind] }, () => r.f32());
    if (field.kind === "enum") {
        const value = r.u16();
        return Object.keys(enums[field.values]).find((name) => enums[field.values][name] === value);
    }
    return field.kind === "hash" ? r.blob(32) : r[field.kind]();
}

function decodeField(r, field, path) {
    const at = r.pos;
    if (field.kind === "list")
        return decodeList(r, field, path, at);
    if (field.kind === "str" || field.kind === "bytes")
        return decodeBlob(r, field, path, at);
    if (field.kind === "bool") {
        const byte = r.u8();
        if (byte > 1)
            throw new HgpError("format", path, at, "a bool is 0 or 1");
        return byte === 1;
    }
    const value = readFixed(r, field);
    const reason = checkValue(field, value);
    if (reason)
        throw new HgpError("invalid", path, at, reason);
    return value;
}

function decodeBitmap(r, fields, prefix, bitmap) {
    const known = knownBits(fields, bitmap, r.version);
    if (!known || (bitmap > 0 && r.bytes.length - r.pos < 4))
        return 0;
    const bits = r.u32();
    if (bitmap > 0 && bits === 0)
        throw new HgpError("format", prefix + "has", r.pos - 4,
            "a second bitmap without a field");
    if (bits & ~known)
        throw new HgpError("format", prefix + "has", r.pos - 4,
            "a bit of an unknown optional field is set");
    return bits;
}

function decodeFields(r, fields, prefix) {
    let bits = decodeBitmap(r, fields, prefix, 0);
    const out = {};
    let optional = 0;
    for (const field of fields) {
        let there = field.since <= r.version;
        if (field.optional) {
            if (optional === BITMAP_FIELDS)
                bits = decodeBitmap(r, fields, prefix, 1);
            there &&= (bits >>> optional++ % BITMAP_FIELDS & 1) === 1;
        }
        if (there)
            out[field.name] = decodeField(r, field, prefix + field.name);
    }
    return out;
}

// A whole payload by a list of fields; missing and extra bytes are refused.
export function decodeLayout(fields, version, payload) {
    const r = new Reader(payload, version);
    const message = decodeFields(r, fields, "");
    if (r.pos !== payload.length)
        throw new HgpError("format", "", r.pos, "bytes behind the end of the message");
    return message;
}

// bytes and hash fields are views of `payload`.
export function decode(version, type, payload) {
    const info = findMessage(type);
    if (!info || info.since > version)
        throw new HgpError("unsupported", "", 0, "unknown message type");
    return decodeLayout(info.fields, version, payload);
}

// ---- encoding ----------------------------------------------------------------------------------

const utf8Encoder = new TextEncoder();

class Writer {
    constructor(version, start) {
        this.version = version;
        this.start = start;
        this.size = start;
        this.bytes = new Uint8Array(256);
        this.view = new DataView(this.bytes.buffer);
    }
    // Makes room for `size` bytes and returns where they start.
    grow(size) {
        const at = this.size;
        this.size += size;
        if (this.size > this.bytes.length) {
            const bytes = new Uint8Array(Math.max(this.size, this.bytes.length * 2));
            bytes.set(this.bytes.subarray(0, at));
            this.bytes = bytes;
            this.view = new DataView(bytes.buffer);
        }
        return at;
    }
    u8(v) { this.view.setUint8(this.grow(1), v); }
    u16(v) { const at = this.grow(2); this.view.setUint16(at, v, true); }
    u32(v) { const at = this.grow(4); this.view.setUint32(at, v, true); }
    i32(v) { const at = this.grow(4); this.view.setInt32(at, v, true); }
    u64(v) { const at = this.grow(8); this.view.setBigUint64(at, v, true); }
    f32(v) { const at = this.grow(4); this.view.setFloat32(at, v, true); }
    f64(v) { const at = this.grow(8); this.view.setFloat64(at, v, true); }
    blob(bytes) { const at = this.grow(bytes.length); this.bytes.set(bytes, at); }
}

function refuse(w, path, reason) {
    throw new HgpError("invalid", path, w.size - w.start, reason);
}

// The value as it will be on the wire, or undefined when it has the wrong type.
function coerce(field, value) {
    switch (field.kind) {
    case "u64":
        if (Number.isSafeInteger(value))
            return BigInt(value);
        return typeof value === "bigint" ? value : undefined;
    case "f32":
        return typeof value === "number" ? Math.fround(value) : undefined;
    case "f64":
        return typeof value === "number" ? value : undefined;
    case "vec2":
    case "vec3":
    case "vec4":
    case "mat4": {
        const list = Array.from(value ?? [], (v) => (typeof v === "number" ? Math.fround(v) : NaN));
        return list.length === FLOATS[field.kind] ? list : undefined;
    }
    case "bool":
        return typeof value === "boolean" ? value : undefined;
    case "enum":
        return Object.hasOwn(enums[field.values], value) ? enums[field.values][value] : undefined;
    case "hash":
        return value instanceof Uint8Array && value.length === 32 ? value : undefined;
    default:
        return Number.isInteger(value) ? value : undefined;
    }
}

function encodeBlob(w, field, path, value) {
    let bytes = value;
    if (field.kind === "str") {
        // A lone surrogate has no UTF-8 form; TextEncoder would replace it without a word.
        if (typeof value !== "string" || /[\ud800-\udfff]/u.test(value) || value.includes("\0"))
            refuse(w, path, "not UTF-8 without NUL");
        bytes = utf8Encoder.encode(value);
    }
    if (!(bytes instanceof Uint8Array))
        refuse(w, path, "not a Uint8Array");
    if (bytes.length > field.max)
        refuse(w, path, "longer than allowed");
    w.u32(bytes.length);
    w.blob(bytes);
}

function encodeList(w, field, path, value) {
    if (!Array.isArray(value))
        refuse(w, path, "not an array");
    if (value.length > field.max)
        refuse(w, path, "more items than allowed");
    w.u32(value.length);
    value.forEach((item, i) => encodeFields(w, structs[field.items], item, `${path}[${i}].`));
}

function encodeField(w, field, path, value) {
    if (field.kind === "list")
        return encodeList(w, field, path, value);
    if (field.kind === "str" || field.kind === "bytes")
        return encodeBlob(w, field, path, value);
    const wire = coerce(field, value);
    if (wire === undefined)
        refuse(w, path, field.kind === "enum" ? "not a value of its enum" : `not a ${field.kind}`);
    if (field.kind === "bool")
        return w.u8(wire ? 1 : 0);
    const reason = checkValue(field, wire);
    if (reason)
        refuse(w, path, reason);
    if (field.kind in FLOATS)
        return wire.forEach((v) => w.f32(v));
    if (field.kind === "enum")
        return w.u16(wire);
    return field.kind === "hash" ? w.blob(wire) : w[field.kind](wire);
}

function writeBitmap(w, fields, message, bitmap) {
    const bits = bitmapOf(fields, bitmap,
        (f) => f.since <= w.version && message[f.name] !== undefined);
    if (bitmap === 0 ? knownBits(fields, 0, w.version) : bits)
        w.u32(bits);
}

function encodeFields(w, fields, message, prefix) {
    if (typeof message !== "object" || message === null)
        refuse(w, prefix, "not an object");
    for (const key of Object.keys(message))
        if (!fields.some((f) => f.name === key))
            refuse(w, prefix + key, "no such field");
    writeBitmap(w, fields, message, 0);
    let optional = 0;
    for (const field of fields) {
        const value = message[field.name];
        if (field.optional && optional++ === BITMAP_FIELDS)
            writeBitmap(w, fields, message, 1);
        if (field.since > w.version || (field.optional && value === undefined))
            continue;
        if (value === undefined)
            refuse(w, prefix + field.name, "the field is missing");
        encodeField(w, field, prefix + field.name, value);
    }
}

// The payload alone, by a list of fields.
export function encodeLayout(fields, version, message) {
    const w = new Writer(version, 0);
    encodeFields(w, fields, message, "");
    return w.bytes.subarray(0, w.size);
}

// Header and payload of one message, by its name.
export function encode(version, name, message, { request = 0, channel = 0 } = {}) {
    const info = Object.hasOwn(messages, name) ? messages[name] : undefined;
    if (!info || info.since > version)
        throw new HgpError("unsupported", "", 0, "unknown message type");
    const w = new Writer(version, HEADER_BYTES);
    encodeFields(w, info.fields, message, "");
    const length = w.size - HEADER_BYTES;
    w.bytes.set(encodeHeader({ length, type: info.type, request, channel }), 0);
    return w.bytes.subarray(0, w.size);
}
