// decode.js - frames to pixels on a canvas, in the order in which they came.
// Images are decoded by the browser's own decoders, video by WebCodecs, tiles by both.
import { sha256 } from "./sha256.js";
import { VideoStream } from "./video.js";
import { decodeDepth } from "./warp.js";

const IMAGES = { JPEG: "image/jpeg", JPEG_444: "image/jpeg", PNG8: "image/png" };
const EXACT = { colorSpaceConversion: "none", premultiplyAlpha: "none" };
const TILE_ROW_BYTES = 12; // of a rectangle in the table of a frame of tiles

export const hexOf = (bytes) =>
    Array.from(bytes, (b) => b.toString(16).padStart(2, "0")).join("");

const openImage = (bytes, type) => createImageBitmap(new Blob([bytes], { type }), EXACT);

// ---- tiles -------------------------------------------------------------------------------------

const hasInflate = () => typeof DecompressionStream === "function";

async function inflate(bytes) {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8ClampedArray(await new Response(stream).arrayBuffer());
}

// Rows hold differences to the pixel at the left.
function undoDifferences(pixels, at, width, height) {
    for (let y = 0; y < height; y++) {
        const row = at + y * width * 4;
        for (let i = row + 4; i < row + width * 4; i++)
            pixels[i] = pixels[i] + pixels[i - 4] & 255;
    }
}

// [{ x, y, picture }] of the data of a TILES or TILES_JPEG frame.
export async function decodeTiles(data) {
    const view = new DataView(data.buffer, data.byteOffset, data.length);
    const count = view.getUint32(0, true);
    let at = 4 + count * TILE_ROW_BYTES;
    if (at > data.length)
        throw new Error("a frame of tiles ends inside its table");
    const tiles = [];
    for (let i = 0; i < count; i++) {
        const row = 4 + i * TILE_ROW_BYTES;
        const [x, y, width, height] = [0, 2, 4, 6].map((o) => view.getUint16(row + o, true));
        const size = view.getUint32(row + 8, true);
        const picture = size ? openImage(data.subarray(at, at + size), "image/jpeg") : null;
        tiles.push({ x, y, width, height, picture });
        at += size;
    }
    await addExactTiles(tiles.filter((t) => !t.picture), data.subarray(at));
    return Promise.all(tiles.map(async (t) => ({ ...t, picture: await t.picture })));
}

async function addExactTiles(tiles, packed) {
    if (!tiles.length)
        return;
    const pixels = await inflate(packed);
    let at = 0;
    for (const tile of tiles) {
        const bytes = tile.width * tile.height * 4;
        if (at + bytes > pixels.length)
            throw new Error("a frame of tiles ends inside its pixels");
        undoDifferences(pixels, at, tile.width, tile.height);
        tile.picture = new ImageData(pixels.slice(at, at + bytes), tile.width, tile.height);
        at += bytes;
    }
}

function paint(context, picture, x, y) {
    if (picture instanceof ImageData) {
        context.putImageData(picture, x, y);
        return;
    }
    context.drawImage(picture, x, y);
    picture.close();
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
        for (const { x, y, picture } of tiles)
            paint(this.context, picture, x, y);
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
        const whole = Array.isArray(picture) ? this.tiles.apply(frame, picture) : picture;
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

    // SHA-256 of the pixels that are shown, as hexadecimal digits.
    async hash() {
        const { width, height } = this.canvas;
        const { data } = this.context.getImageData(0, 0, width, height);
        return hexOf(await sha256(data));
    }

    // Encodings in motion that this browser decodes, the best for a network first.
    static async motionEncodings() {
        const video = await VideoStream.supported();
        return [...video, ...hasInflate() ? ["TILES_JPEG"] : [], "JPEG"];
    }
}
