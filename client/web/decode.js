// decode.js - frames to pixels on a canvas, in the order in which they came.
// Images are decoded by the browser's own decoders, video by WebCodecs, tiles by both.
import { sha256 } from "./sha256.js";
import { VideoStream } from "./video.js";
import { decodeDepth } from "./warp.js";

const IMAGES = { JPEG: "image/jpeg", JPEG_444: "image/jpeg", PNG8: "image/png" };
const EXACT = { colorSpaceConversion: "none", premultiplyAlpha: "none" };
const TILES_HEADER_BYTES = 20;
const JPEG_RECT_BYTES = 12; // in the table of a frame of tiles
const EXACT_RECT_BYTES = 8;

export const hexOf = (bytes) =>
    Array.from(bytes, (b) => b.toString(16).padStart(2, "0")).join("");

const openImage = (bytes, type) => createImageBitmap(new Blob([bytes], { type }), EXACT);

// ---- tiles -------------------------------------------------------------------------------------

const hasInflate = () => typeof DecompressionStream === "function";

async function inflate(bytes) {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8ClampedArray(await new Response(stream).arrayBuffer());
}

// Differences to the pixel at the left, in the first column to the one above.
function undoDifferences(pixels, at, width, height) {
    const pitch = width * 4;
    for (let y = 0; y < height; y++) {
        const row = at + y * pitch;
        for (let i = row; y > 0 && i < row + 4; i++)
            pixels[i] = pixels[i] + pixels[i - pitch] & 255;
        for (let i = row + 4; i < row + pitch; i++)
            pixels[i] = pixels[i] + pixels[i - 4] & 255;
    }
}

const readU16s = (bytes, at, count) => Array.from({ length: count },
    (_, i) => bytes[at + 2 * i] | bytes[at + 2 * i + 1] << 8);

// { atlas, jpeg: [[x, y, width, height, its x in the atlas, y]], exact: [{ x, y, picture }] } of
// the data of a TILES or TILES_JPEG frame.
export async function decodeTiles(data) {
    const view = new DataView(data.buffer, data.byteOffset, data.length);
    if (data.length < TILES_HEADER_BYTES)
        throw new Error("a frame of tiles ends inside its header");
    const [jpegBytes, jpegCount, exactCount, unpackedBytes] =
        [4, 8, 12, 16].map((at) => view.getUint32(at, true));
    const packedAt = TILES_HEADER_BYTES + jpegBytes;
    const [atlas, plain] = await Promise.all([
        jpegCount ? openImage(data.subarray(TILES_HEADER_BYTES, packedAt), "image/jpeg") : null,
        unpackedBytes ? inflate(data.subarray(packedAt)) : new Uint8ClampedArray(),
    ]);
    const exactAt = jpegCount * JPEG_RECT_BYTES;
    if (exactAt + exactCount * EXACT_RECT_BYTES > plain.length)
        throw new Error("a frame of tiles ends inside its table");
    const jpeg = Array.from({ length: jpegCount },
        (_, i) => readU16s(plain, i * JPEG_RECT_BYTES, 6));
    return { atlas, jpeg, exact: readExactTiles(plain, exactAt, exactCount) };
}

function readExactTiles(plain, tableAt, count) {
    let at = tableAt + count * EXACT_RECT_BYTES;
    return Array.from({ length: count }, (_, i) => {
        const [x, y, width, height] = readU16s(plain, tableAt + i * EXACT_RECT_BYTES, 4);
        const end = at + width * height * 4;
        if (end > plain.length)
            throw new Error("a frame of tiles ends inside its pixels");
        undoDifferences(plain, at, width, height);
        const picture = new ImageData(plain.slice(at, end), width, height);
        at = end;
        return { x, y, picture };
    });
}

// The picture that frames of tiles change, kept apart from what the canvas shows.
class TileStream {
    constructor() {
        this.canvas = new OffscreenCanvas(1, 1);
        this.context = this.canvas.getContext("2d", { alpha: false });
        this.number = null;
    }
    apply(frame, tiles) {
        const { canvas } = this;
        if (frame.depends !== undefined && this.number !== Number(frame.number) - frame.depends)
            throw new Error("a frame of tiles was lost");
        if (canvas.width !== frame.width || canvas.height !== frame.height) {
            canvas.width = frame.width;
            canvas.height = frame.height;
        }
        for (const [x, y, width, height, fromX, fromY] of tiles.jpeg)
            this.context.drawImage(tiles.atlas, fromX, fromY, width, height, x, y, width, height);
        tiles.atlas?.close();
        for (const { x, y, picture } of tiles.exact)
            this.context.putImageData(picture, x, y);
        this.number = Number(frame.number);
        return canvas;
    }
}

// ---- frames ------------------------------------------------------------------------------------

export class FramePainter {
    // onShown(frame, { decode_ms }) is called when a frame is on the canvas, onFailed(frame, error)
    // when it cannot be.
    constructor(canvas, onShown, onFailed) {
        this.canvas = canvas;
        this.context = canvas.getContext("2d", { alpha: false });
        this.onShown = onShown;
        this.onFailed = onFailed;
        this.queue = Promise.resolve();
        this.tiles = new TileStream();
        this.video = new VideoStream();
    }

    push(frame) {
        const begun = performance.now();
        // Decoding starts at once; showing waits for the frames before.
        const decoded = this.decode(frame);
        decoded.catch(() => {});
        const grid = frame.depth ? decodeDepth(frame.depth, inflate).catch(() => null) : null;
        this.queue = this.queue.then(async () => {
            try {
                frame.grid = await grid; // null: none, or this browser cannot read it
                this.show(frame, await decoded);
                this.onShown(frame, { decode_ms: performance.now() - begun });
            } catch (error) {
                this.onFailed(frame, error);
            }
        });
    }

    async decode(frame) {
        const type = IMAGES[frame.encoding];
        if (type)
            return openImage(frame.data, type);
        if (VideoStream.encodings.includes(frame.encoding))
            return this.video.decode(frame);
        if (frame.encoding === "TILES" || frame.encoding === "TILES_JPEG")
            return decodeTiles(frame.data);
        if (frame.encoding === "RAW_RGBA8") {
            const { buffer, byteOffset, length } = frame.data;
            return new ImageData(new Uint8ClampedArray(buffer, byteOffset, length),
                frame.width, frame.height);
        }
        throw new Error(`frames of encoding ${frame.encoding} cannot be shown here`);
    }

    show(frame, picture) {
        const { canvas, context } = this;
        const { width, height } = frame;
        const whole = picture.exact ? this.tiles.apply(frame, picture) : picture;
        if (canvas.width !== width || canvas.height !== height) {
            canvas.width = width;
            canvas.height = height;
        }
        if (whole instanceof ImageData) {
            context.putImageData(whole, 0, 0);
            return;
        }
        // What is decoded may be larger than the picture: its upper left part counts.
        context.drawImage(whole, 0, 0, width, height, 0, 0, width, height);
        if (whole !== this.tiles.canvas)
            whole.close();
    }

    // Of pictures at rest, for a network: after an edit only tiles that differ from the one before.
    static stillEncoding() {
        return hasInflate() ? "TILES" : "PNG8";
    }

    // SHA-256 of the pixels that are shown, as hexadecimal digits. They are read from a copy: a
    // canvas that is read itself is kept in main memory by browsers, where drawing takes longer.
    async hash() {
        const { width, height } = this.canvas;
        const copy = new OffscreenCanvas(width, height)
            .getContext("2d", { alpha: false, willReadFrequently: true });
        copy.drawImage(this.canvas, 0, 0);
        return hexOf(await sha256(copy.getImageData(0, 0, width, height).data));
    }

    // Encodings in motion that this browser decodes, the best for a network first.
    static async motionEncodings() {
        const video = await VideoStream.supported();
        return [...video, ...hasInflate() ? ["TILES_JPEG"] : [], "JPEG"];
    }
}
