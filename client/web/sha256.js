// sha256.js - SHA-256 (FIPS 180-4): by the browser, and where the page came over plain HTTP from
// another machine, for which browsers have no crypto.subtle, by the code below.

// The first 64 primes: roots of two and three give the constants (4.2.2, 5.3.3).
const primes = [];
for (let n = 2; primes.length < 64; n++)
    if (primes.every((p) => n % p))
        primes.push(n);
const fraction = (v) => (v - Math.floor(v)) * 2 ** 32 | 0;
const K = Int32Array.from(primes, (p) => fraction(Math.cbrt(p)));
const H = Int32Array.from(primes.slice(0, 8), (p) => fraction(Math.sqrt(p)));

const BLOCK = 64;
const PAUSE_BYTES = 1 << 22; // the page answers between so many

// Blocks of `view` from `at` to `end`, into the state.
function blocks(state, view, at, end) {
    const w = new Int32Array(64);
    for (; at < end; at += BLOCK) {
        for (let i = 0; i < 16; i++)
            w[i] = view.getInt32(at + 4 * i);
        for (let i = 16; i < 64; i++) {
            const x = w[i - 15], y = w[i - 2];
            const s0 = (x >>> 7 | x << 25) ^ (x >>> 18 | x << 14) ^ x >>> 3;
            const s1 = (y >>> 17 | y << 15) ^ (y >>> 19 | y << 13) ^ y >>> 10;
            w[i] = w[i - 16] + s0 + w[i - 7] + s1 | 0;
        }
        let [a, b, c, d, e, f, g, h] = state;
        for (let i = 0; i < 64; i++) {
            const s1 = (e >>> 6 | e << 26) ^ (e >>> 11 | e << 21) ^ (e >>> 25 | e << 7);
            const t1 = h + s1 + (e & f ^ ~e & g) + K[i] + w[i] | 0;
            const s0 = (a >>> 2 | a << 30) ^ (a >>> 13 | a << 19) ^ (a >>> 22 | a << 10);
            const t2 = s0 + (a & b ^ a & c ^ b & c) | 0;
            h = g;
            g = f;
            f = e;
            e = d + t1 | 0;
            d = c;
            c = b;
            b = a;
            a = t1 + t2 | 0;
        }
        [a, b, c, d, e, f, g, h].forEach((v, i) => { state[i] = state[i] + v | 0; });
    }
}

// Without the browser's help; bytes as for sha256.
export async function ownSha256(bytes) {
    const { length, byteOffset, buffer } = bytes;
    const state = Int32Array.from(H), whole = length - length % BLOCK;
    const view = new DataView(buffer, byteOffset, length);
    for (let at = 0; at < whole; at += PAUSE_BYTES) {
        if (at)
            await new Promise((done) => setTimeout(done));
        blocks(state, view, at, Math.min(whole, at + PAUSE_BYTES));
    }
    const tail = new Uint8Array(length - whole + 9 > BLOCK ? 2 * BLOCK : BLOCK);
    tail.set(bytes.subarray(whole));
    tail[length - whole] = 0x80;
    const end = new DataView(tail.buffer);
    end.setBigUint64(tail.length - 8, BigInt(length) * 8n);
    blocks(state, end, 0, tail.length);
    const digest = new DataView(new ArrayBuffer(32));
    state.forEach((v, i) => digest.setInt32(4 * i, v));
    return new Uint8Array(digest.buffer);
}

// Of a Uint8Array or Uint8ClampedArray: 32 bytes.
export async function sha256(bytes) {
    return globalThis.crypto?.subtle
        ? new Uint8Array(await crypto.subtle.digest("SHA-256", bytes)) : ownSha256(bytes);
}
