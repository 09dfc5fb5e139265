// connection.js - a session with heliod over a WebSocket: bytes to messages, requests to answers,
// and a new connection in place of a lost one. Knows no pictures and no page.
//
// Events: "frame" (detail: { frame, begun_ms, received_ms }), "message" (detail: { name, body } of
// any other message that answers no request), "state" (detail: the new state; "ended" = by the server, for
// good), "opened" (detail: { resumed }),
// "active" (something is sent that keeps the session), "auth" (a token is needed; detail: RequestError or null).
import {
    PREFACE, HEADER_BYTES, decode, decodeHeader, encode, findMessage, status as statusCodes,
} from "./hgp.js";

const VERSION = 1;
const SUBPROTOCOL = "hgp.1";
const FRAME_LIMIT = 560 * 1024 * 1024;
const PING_MS = 2000;
const SILENCE_MS = 15000;
const KEPT_PINGS = 10;
const SILENT = ["pong", "taken", "credit", "clock_query"]; // do not keep an idle session
const ENDING = ["not-allowed", "timeout"]; // of a session: by an administrator, or idle for too long
const RETRY_MS = [250, 500, 1000, 2000, 4000, 8000];
const LONGEST_RETRY_MS = 3600000;

const statusNames = Object.fromEntries(Object.entries(statusCodes).map(([k, v]) => [v, k]));

// What the server refused, or (status "closed") a connection that ended first.
export class RequestError extends Error {
    constructor(body) {
        super(body.reason);
        this.name = "RequestError";
        this.status = statusNames[body.code] ?? body.status ?? "internal";
        this.what = body.what ?? "";
        this.where = body.where ?? "";
        this.limit = body.limit ?? "";
        this.retryAfter_ms = Number(body.retry_after_ms ?? 0);
    }
}

const closedError = (reason) =>
    new RequestError({ status: "closed", what: "connection", reason });

// Pieces of a byte stream to whole messages. A large message is copied once.
class Assembler {
    constructor(onMessage) {
        this.onMessage = onMessage; // (bytes, when the first of them came)
        this.rest = new Uint8Array(0);
        this.large = null; // { bytes, filled } of a message that has not fully come
    }
    push(bytes) {
        const now_ms = performance.now();
        if (this.large)
            bytes = this.fill(bytes);
        if (this.rest.length && bytes.length) {
            const joined = new Uint8Array(this.rest.length + bytes.length);
            joined.set(this.rest);
            joined.set(bytes, this.rest.length);
            bytes = joined;
            this.rest = new Uint8Array(0);
        }
        while (bytes.length >= HEADER_BYTES) {
            const end = HEADER_BYTES + decodeHeader(bytes, FRAME_LIMIT).length;
            if (bytes.length < end) {
                this.large = { bytes: new Uint8Array(end), filled: 0, begun_ms: now_ms };
                this.fill(bytes);
                return;
            }
            this.onMessage(bytes.subarray(0, end), now_ms);
            bytes = bytes.subarray(end);
        }
        if (bytes.length)
            this.rest = bytes;
    }
    fill(bytes) {
        const { large } = this;
        const part = bytes.subarray(0, large.bytes.length - large.filled);
        large.bytes.set(part, large.filled);
        large.filled += part.length;
        if (large.filled === large.bytes.length) {
            this.large = null;
            this.onMessage(large.bytes, large.begun_ms);
        }
        return bytes.subarray(part.length);
    }
}

export class Connection extends EventTarget {
    constructor(url, client) {
        super();
        this.url = url;
        this.client = client;
        this.state = "idle";
        this.token = null;
        this.ticket = null; // of keep, for resume
        this.joined = ""; // the only scene of a session that came in by a join ticket
        this.limits = new Map(); // request -> message `limited` before its error
        this.requests = new Map();
        this.nextRequest = 1;
        this.tries = 0;
        this.role = "NONE";
        this.server = "";
        this.rtt_ms = 0;
        this.pings = []; // the last ones: { rtt_ms, offset_ms }
        this.bytesIn = 0;
        this.bytesOut = 0;
        this.lastError = null;
        this.revoked = null; // why the access of the session that was open is good no longer
    }

    get isOpen() {
        return this.state === "open";
    }
    get canEdit() {
        return this.role === "EDIT" || this.role === "ADMIN";
    }
    // Bytes that wait to be sent.
    get backlog_bytes() {
        return this.socket?.bufferedAmount ?? 0;
    }

    setState(state) {
        this.state = state;
        this.dispatchEvent(new CustomEvent("state", { detail: state }));
    }

    // ---- connecting ----------------------------------------------------------------------------

    connect() {
        clearTimeout(this.retryTimer);
        this.drop();
        this.lastError = null;
        this.setState("connecting");
        const socket = new WebSocket(this.url, SUBPROTOCOL);
        socket.binaryType = "arraybuffer";
        this.socket = socket;
        this.assembler = new Assembler((bytes, begun_ms) => this.receive(bytes, begun_ms));
        socket.onopen = () => this.greet().catch((error) => this.fail(error, socket));
        socket.onmessage = (event) => this.take(event, socket);
        socket.onclose = () => this.lost(socket);
        this.silenceTimer = setInterval(() => this.beat(), PING_MS);
        this.heard_ms = performance.now();
    }

    async greet() {
        this.socket.send(PREFACE);
        const welcome = await this.call("hello", { version_min: VERSION, version_max: VERSION,
            client: this.client, capabilities: [] });
        this.server = welcome.server;
        this.role = welcome.role;
        this.session = welcome.session;
        if (welcome.auth_required && !await this.authenticate())
            return;
        const resumed = await this.tryResume();
        this.tries = 0;
        this.lastError = this.revoked = null;
        this.setState("open");
        this.dispatchEvent(new CustomEvent("opened", { detail: { resumed } }));
    }

    async authenticate() {
        if (!this.token) {
            this.askToken(null);
            return false;
        }
        const { token, ticket } = this;
        try {
            // A join ticket may be used up: it still lets its session in again.
            const { role, name } = ticket
                ? await this.call("auth_resume", { token, secret: ticket })
                : await this.call("auth", { token });
            this.role = role;
            this.name = name;
            return true;
        } catch (error) {
            if (error.status !== "auth")
                throw error;
            if (ticket) {
                // The session is gone; with the token there may be another one.
                this.ticket = null;
                this.connect();
                return false;
            }
            this.askToken(error);
            return false;
        }
    }

    askToken(error) {
        const why = this.revoked ?? error;
        this.revoked = null;
        this.drop();
        this.setState("auth");
        this.dispatchEvent(new CustomEvent("auth", { detail: why }));
    }

    // The message resumed, or null when the session has to be opened anew.
    async tryResume() {
        if (!this.ticket)
            return null;
        const secret = this.ticket;
        this.ticket = null;
        try {
            const resumed = await this.call("resume", { secret });
            this.ticket = resumed.secret;
            this.session = resumed.session; // the one before, not that of this connection's welcome
            return resumed;
        } catch (error) {
            if (error.status === "closed")
                this.ticket = secret;
            else if (error.status !== "auth" && error.status !== "not-found")
                throw error;
            return null;
        }
    }

    // Asks that the session be kept when the connection is lost.
    async keep() {
        this.ticket = (await this.call("keep", {})).secret;
    }

    fail(error, socket) {
        this.lastError = error;
        if (socket === this.socket)
            socket.close();
    }

    lost(socket) {
        if (socket !== this.socket)
            return;
        const wasAuth = this.state === "auth";
        this.drop();
        if (wasAuth)
            return;
        // Not before the server says, and not all who were refused at one time.
        const usual_ms = RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)];
        const told_ms = Math.min(LONGEST_RETRY_MS, this.lastError?.retryAfter_ms ?? 0);
        const wait_ms = Math.max(told_ms, usual_ms * 0.8) + usual_ms * 0.4 * Math.random();
        this.retryAt_ms = performance.now() + wait_ms;
        this.setState("waiting");
        this.retryTimer = setTimeout(() => this.connect(), wait_ms);
    }

    // Ends the socket and answers what waits for it.
    drop() {
        clearInterval(this.silenceTimer);
        const { socket } = this;
        this.socket = null;
        if (socket) {
            socket.onopen = socket.onmessage = socket.onclose = null;
            socket.close();
        }
        const waiting = [...this.requests.values()];
        this.requests.clear();
        for (const request of waiting)
            request.reject(this.lastError ?? closedError("the connection was lost"));
    }

    close() {
        clearTimeout(this.retryTimer);
        if (this.isOpen)
            this.send("bye", { reason: "" });
        this.ticket = null;
        this.drop();
        this.setState("closed");
    }

    // The server has ended the session for good: who looks decides whether to open another one.
    end() {
        this.ticket = null;
        this.drop();
        this.setState("ended");
    }

    // Asks for the server's clock, and gives up on a connection that has been silent for long.
    beat() {
        if (performance.now() - this.heard_ms > SILENCE_MS && this.socket) {
            this.lastError = closedError("the server does not answer");
            const { socket } = this;
            this.lost(socket);
        } else if (this.isOpen) {
            this.askClock().catch(() => {}); // a lost connection says so itself
        }
    }

    // ---- messages ------------------------------------------------------------------------------

    send(name, message, request = 0) {
        if (this.socket?.readyState !== WebSocket.OPEN)
            return false;
        if (!SILENT.includes(name))
            this.dispatchEvent(new Event("active"));
        const bytes = encode(VERSION, name, message, { request });
        this.bytesOut += bytes.length;
        this.socket.send(bytes);
        return true;
    }

    // Sends a request; the promise is its answer, or a RequestError. onProgress gets `progress`
    // and `notice` messages that come before it.
    call(name, message, onProgress = null) {
        const request = this.nextRequest;
        this.nextRequest = this.nextRequest % 0x7fffffff + 1;
        return new Promise((resolve, reject) => {
            this.requests.set(request, { resolve, reject, onProgress });
            let sent = false;
            try {
                sent = this.send(name, message, request);
            } catch (error) {
                this.requests.delete(request);
                reject(new RequestError({ status: error.status ?? "invalid", what: name,
                    where: error.field, reason: error.reason ?? error.message }));
                return;
            }
            if (!sent) {
                this.requests.delete(request);
                reject(closedError("there is no connection"));
            }
        });
    }

    take(event, socket) {
        if (socket !== this.socket)
            return;
        this.heard_ms = performance.now();
        this.bytesIn += event.data.byteLength;
        try {
            this.assembler.push(new Uint8Array(event.data));
        } catch (error) {
            this.fail(error, socket);
        }
    }

    receive(bytes, begun_ms) {
        const header = decodeHeader(bytes, FRAME_LIMIT);
        const known = findMessage(header.type);
        if (!known)
            return;
        const body = decode(VERSION, header.type, bytes.subarray(HEADER_BYTES));
        const request = this.requests.get(header.request)
            ?? (known.name === "welcome" || known.name === "auth_ok" ? this.oldest() : undefined);
        if (known.name === "progress" || known.name === "notice" || known.name === "frame_part") {
            request?.onProgress?.(known.name, body);
            if (!request)
                this.tell(known.name, known.name === "notice" ? { ...body, ...this.limitOf(0) } : body);
        } else if (known.name === "ping") {
            this.send("pong", body);
        } else if (known.name === "limited") {
            this.limits.set(body.request, body);
        } else if (known.name === "join_scene") {
            this.joined = body.scene;
        } else if (known.name === "frame" && !request) {
            this.dispatchEvent(new CustomEvent("frame", { detail:
                { frame: body, begun_ms, received_ms: performance.now() } }));
        } else if (request) {
            this.answer(header.request, request, known.name, body);
        } else if (known.name === "error" && header.request === 0) {
            this.refused(body);
        } else {
            this.tell(known.name, body);
        }
    }

    // The round trip, and how far the server's clock is ahead: the fastest one tells it best.
    async askClock() {
        const sent_ms = performance.now();
        const { time_ns } = await this.call("clock_query", {});
        this.rtt_ms = performance.now() - sent_ms;
        this.pings.push({ rtt_ms: this.rtt_ms,
            offset_ms: Number(time_ns) / 1e6 - (sent_ms + this.rtt_ms / 2) });
        if (this.pings.length > KEPT_PINGS)
            this.pings.shift();
    }

    get best() {
        return this.pings.reduce((a, b) => a && a.rtt_ms <= b.rtt_ms ? a : b, null);
    }

    // A time of the server's clock as one of this page, or null.
    toPageTime(time_ns) {
        const offset_ms = this.best?.offset_ms ?? null;
        return time_ns === undefined || offset_ms === null ? null
            : Number(time_ns) / 1e6 - offset_ms;
    }

    limitOf(request) {
        const limit = this.limits.get(request);
        this.limits.delete(request);
        return limit;
    }

    // Greetings are answered without a request id.
    oldest() {
        const [first] = this.requests.entries();
        return first?.[1];
    }

    forget(request) {
        for (const [key, value] of this.requests)
            if (value === request)
                this.requests.delete(key);
    }

    answer(id, request, name, body) {
        this.forget(request);
        if (name === "error")
            request.reject(new RequestError({ ...body, ...this.limitOf(id) }));
        else
            request.resolve(body);
    }

    // The connection as a whole was refused: what waits for a greeting gets the reason.
    refused(body) {
        const error = new RequestError({ ...body, ...this.limitOf(0) });
        this.lastError = error;
        if (this.isOpen && body.what === "session" && ENDING.includes(error.status)) {
            this.end();
            return;
        }
        if (this.isOpen && error.status === "auth")
            this.revoked = error;
        const first = this.isOpen ? null : this.oldest();
        if (first) {
            this.forget(first);
            first.reject(error);
        }
        this.tell("error", body);
    }

    tell(name, body) {
        this.dispatchEvent(new CustomEvent("message", { detail: { name, body } }));
    }
}

// ---- errors as sentences -----------------------------------------------------------------------

const SENTENCES = {
    "limit": "A limit was reached",
    "no-memory": "The server is out of memory",
    "no-space": "The server has no room left",
    "format": "The file is malformed",
    "truncated": "The file ends too early",
    "unsupported": "This is not supported",
    "not-found": "Not found",
    "not-allowed": "Your access does not allow this",
    "state": "Not possible now",
    "cancelled": "Given up",
    "auth": "The access token is not valid",
    "busy": "The server is busy",
    "closed": "No connection",
    "worker": "The renderer was restarted",
    "device": "The server has no usable graphics device",
    "timeout": "The server took too long",
};

// How far a request has come: a text, and a share of 0..1 or null where that is not known.
export function describeProgress({ stage, done, total }) {
    const [n, all] = [Number(done), Number(total)];
    if (!all)
        return [stage, null];
    return [stage === "samples" ? `${n} of ${all} samples`
        : `${stage}, ${Math.floor(n / all * 100)} %`, n / all];
}

export const waitText = (ms) => ms < 100000 ? `${Math.ceil(ms / 1000)} s` : `${Math.round(ms / 60000)} min`;

// What happened, to what, and (hasRetry) when to try again, for people.
export function describeError(error, hasRetry = true) {
    if (!(error instanceof RequestError))
        return error?.message ?? String(error);
    const place = [error.what, error.where].filter(Boolean).join(", ");
    const head = SENTENCES[error.status] ?? "That did not work";
    const limit = error.limit && !error.message?.includes(error.limit) ? ` (${error.limit})` : "";
    const retry = error.retryAfter_ms && hasRetry
        ? ` Try again in ${waitText(error.retryAfter_ms)}.` : "";
    const reason = error.message ? `: ${error.message}` : "";
    return `${head}${limit}${place ? ` – ${place}` : ""}${reason}.${retry}`.replace(/\.\.$/, ".");
}
