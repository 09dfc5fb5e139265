// decode.js - frames to pixels on a canvas, one after the other in the order they came.
// Images are decoded by the browser's own decoders, video by WebCodecs.

const IMAGES = { JPEG: "image/jpeg", PNG8: "image/png" };

// Which encodings this browser shows; the first of a list is the one it likes best.
export const MOTION_ENCODINGS = ["JPEG"];

export async function sha256Hex(bytes) {
    const digest = await crypto.subtle.digest("SHA-256", bytes);
    return hexOf(new Uint8Array(digest));
}

export const hexOf = (bytes) =>
    Array.from(bytes, (b) => b.toString(16).padStart(2, "0")).join("");

export class FramePainter {
    // onShown(frame, { decode_ms }) is called when a frame is on the canvas, onFailed(frame, error)
    // when it cannot be.
    constructor(canvas, onShown, onFailed) {
        this.canvas = canvas;
        this.context = canvas.getContext("2d", { alpha: false });
        this.onShown = onShown;
        this.onFailed = onFailed;
        this.queue = Promise.resolve();
    }

    push(frame) {
        const begun = performance.now();
        // Decoding starts at once; showing waits for the frames before.
        const decoded = this.decode(frame);
        decoded.catch(() => {});
        this.queue = this.queue.then(async () => {
            try {
                await this.show(frame, await decoded);
                this.onShown(frame, { decode_ms: performance.now() - begun });
            } catch (error) {
                this.onFailed(frame, error);
            }
        });
    }

    async decode(frame) {
        const type = IMAGES[frame.encoding];
        if (type)
            return createImageBitmap(new Blob([frame.data], { type }),
                { colorSpaceConversion: "none", premultiplyAlpha: "none" });
        if (frame.encoding === "RAW_RGBA8") {
            const { buffer, byteOffset, length } = frame.data;
            return new ImageData(new Uint8ClampedArray(buffer, byteOffset, length),
                frame.width, frame.height);
        }
        throw new Error(`frames of encoding ${frame.encoding} cannot be shown here`);
    }

    show(frame, picture) {
        this.fit(frame.width, frame.height);
        if (picture instanceof ImageData) {
            this.context.putImageData(picture, 0, 0);
            return;
        }
        this.context.drawImage(picture, 0, 0);
        picture.close();
    }

    fit(width, height) {
        const { canvas } = this;
        if (canvas.width === width && canvas.height === height)
            return;
        canvas.width = width;
        canvas.height = height;
    }

    // SHA-256 of the pixels that are shown, as hexadecimal digits.
    hash() {
        const { width, height } = this.canvas;
        return sha256Hex(this.context.getImageData(0, 0, width, height).data);
    }
}
