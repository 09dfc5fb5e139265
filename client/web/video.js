// video.js - frames of H.264 and AV1 through WebCodecs, each out as soon as it is in.

const PROBES = { H264: "avc1.42E01F", AV1: "av01.0.08M.08", H264_444: "avc1.F4001F" };
const STUCK_MS = 3000;
const MICROSECONDS = 1000;

export class VideoStream {
    static encodings = Object.keys(PROBES);

    // Those of the encodings that this browser decodes.
    static async supported() {
        if (typeof VideoDecoder !== "function")
            return [];
        const checks = Object.entries(PROBES).map(async ([name, codec]) => {
            const answer = await VideoDecoder.isConfigSupported({ codec, codedWidth: 1280,
                codedHeight: 720, optimizeForLatency: true }).catch(() => null);
            return answer?.supported ? name : null;
        });
        return (await Promise.all(checks)).filter(Boolean);
    }

    constructor() {
        this.waiting = new Map(); // timestamp -> { resolve, reject, timer }
        this.count = 0; // of chunks: their timestamps, as numbers of frames begin again with another session
        this.number = null;
    }

    // The promise is a VideoFrame, which its taker closes.
    decode(frame) {
        const isKey = frame.depends === undefined;
        if (isKey && !this.begin(frame))
            return Promise.reject(new Error(`this browser does not decode ${frame.codec}`));
        if (!isKey && (this.number === null
            || this.number !== Number(frame.number) - frame.depends))
            return Promise.reject(new Error("a frame that this one depends on was lost"));
        this.number = Number(frame.number);
        const timestamp = ++this.count * MICROSECONDS;
        return new Promise((resolve, reject) => {
            const timer = setTimeout(() => this.fail(new Error("the decoder is stuck")), STUCK_MS);
            this.waiting.set(timestamp, { resolve, reject, timer });
            try {
                this.decoder.decode(new EncodedVideoChunk({ type: isKey ? "key" : "delta", timestamp,
                    data: frame.data }));
            } catch (error) {
                this.fail(error);
            }
        });
    }

    // A key frame: the decoder goes on when it is configured alike. Frames that are still in another
    // one are not waited for: the key frame shows what is newer.
    begin(frame) {
        const key = `${frame.codec} ${frame.width} ${frame.height}`;
        if (this.decoder?.state === "configured" && this.key === key)
            return true;
        this.fail(Object.assign(new Error("a key frame has taken its place"), { isReplaced: true }));
        try {
            const decoder = new VideoDecoder({ output: (picture) => this.put(picture),
                error: (error) => decoder === this.decoder && this.fail(error) });
            this.decoder = decoder;
            decoder.configure({ codec: frame.codec, codedWidth: frame.width,
                codedHeight: frame.height, optimizeForLatency: true });
        } catch (error) {
            this.fail(error);
            return false;
        }
        this.key = key;
        return true;
    }

    put(picture) {
        const entry = this.waiting.get(picture.timestamp);
        if (!entry) {
            picture.close();
            return;
        }
        clearTimeout(entry.timer);
        this.waiting.delete(picture.timestamp);
        entry.resolve(picture);
    }

    // What waits is lost; the next frame has to be a key frame.
    fail(error) {
        const { decoder, waiting } = this;
        this.number = this.key = this.decoder = null;
        this.waiting = new Map();
        if (decoder && decoder.state !== "closed")
            decoder.close();
        for (const { reject, timer } of waiting.values()) {
            clearTimeout(timer);
            reject(error);
        }
    }
}
