#include "protocol/websocket.h"

#include <openssl/evp.h>
#include <string.h>

#include "base/utf8.h"

// ---- masks --------------------------------------------------------------------------------------

void hg_ws_mask(uint8_t *dst, const uint8_t *src, size_t size, const uint8_t mask[4], unsigned at)
{
    uint8_t turned[8];
    uint64_t word;
    size_t i = 0;
    for (unsigned k = 0; k < 8; k++)
        turned[k] = mask[(at + k) & 3];
    memcpy(&word, turned, sizeof word);
    for (; i + sizeof word <= size; i += sizeof word) {
        uint64_t bytes;
        memcpy(&bytes, src + i, sizeof bytes);
        bytes ^= word;
        memcpy(dst + i, &bytes, sizeof bytes);
    }
    for (; i < size; i++)
        dst[i] = src[i] ^ mask[(at + i) & 3];
}

// ---- headers ------------------------------------------------------------------------------------

static bool is_control(unsigned opcode)
{
    return opcode & 8;
}

static size_t header_needs(const struct hg_ws_frame *f)
{
    if (f->header_size < 2)
        return 2;
    const unsigned length = f->header[1] & 0x7f;
    return 2u + (length == 127 ? 8u : length == 126 ? 2u : 0u) + (f->header[1] & 0x80 ? 4u : 0u);
}

static enum hg_ws_event reject(struct hg_ws_reader *r, enum hg_ws_code code, const char *reason)
{
    r->ended = true;
    r->code = (uint16_t)code;
    r->reason = reason;
    return HG_WS_REJECTED;
}

// What the first two bytes of a frame say.
static enum hg_ws_event check_opening(struct hg_ws_reader *r)
{
    const uint8_t *h = r->frame.header;
    const unsigned opcode = h[0] & 0x0f, length = h[1] & 0x7f;
    if (h[0] & 0x70)
        return reject(r, HG_WS_PROTOCOL_ERROR, "a reserved bit is set");
    if ((opcode > HG_WS_BINARY && opcode < HG_WS_CLOSE) || opcode > HG_WS_PONG)
        return reject(r, HG_WS_PROTOCOL_ERROR, "the opcode is reserved");
    if ((h[1] & 0x80 ? 1 : 0) != r->masked)
        return reject(r, HG_WS_PROTOCOL_ERROR,
            r->masked ? "a frame of a client is not masked" : "a frame of a server is masked");
    if (is_control(opcode) && !(h[0] & 0x80))
        return reject(r, HG_WS_PROTOCOL_ERROR, "a control frame is fragmented");
    if (is_control(opcode) && length > HG_WS_CONTROL_BYTES)
        return reject(r, HG_WS_PROTOCOL_ERROR, "a control frame is too large");
    if (opcode == HG_WS_CONTINUATION && !r->message)
        return reject(r, HG_WS_PROTOCOL_ERROR, "there is no message to continue");
    if ((opcode == HG_WS_TEXT || opcode == HG_WS_BINARY) && r->message)
        return reject(r, HG_WS_PROTOCOL_ERROR, "a message begins within another");
    return HG_WS_MORE;
}

static bool take_length(struct hg_ws_frame *f, const uint8_t **at)
{
    const unsigned length = f->header[1] & 0x7f;
    const unsigned bytes = length == 127 ? 8 : length == 126 ? 2 : 0;
    f->left = bytes ? 0 : length;
    for (unsigned i = 0; i < bytes; i++)
        f->left = f->left << 8 | *(*at)++;
    // Of the shortest form, and without the highest bit (5.2).
    return !bytes || (bytes == 2 ? f->left > 125 : f->left > 0xffff && !(f->left >> 63));
}

static enum hg_ws_event begin_frame(struct hg_ws_reader *r)
{
    struct hg_ws_frame *f = &r->frame;
    const uint8_t *at = f->header + 2;
    f->fin = f->header[0] & 0x80;
    f->opcode = f->header[0] & 0x0f;
    if (!take_length(f, &at))
        return reject(r, HG_WS_PROTOCOL_ERROR, "the length is not in its shortest form");
    if (f->header[1] & 0x80)
        memcpy(f->mask, at, 4);
    f->mask_at = 0;
    f->begun = true;
    if (is_control(f->opcode)) {
        r->control_size = 0;
        return HG_WS_MORE;
    }
    if (f->opcode != HG_WS_CONTINUATION) {
        r->message = f->opcode;
        r->message_size = 0;
        r->utf8_size = 0;
    }
    const uint64_t limit = r->message == HG_WS_TEXT ? HG_WS_TEXT_BYTES : r->limit;
    if (limit && (f->left > limit || r->message_size > limit - f->left))
        return reject(r, HG_WS_TOO_LARGE, "the message is too large");
    r->message_size += f->left;
    return HG_WS_MORE;
}

// ---- texts --------------------------------------------------------------------------------------

// Goes on with a text; NUL is a character of UTF-8, too.
static bool take_text(struct hg_ws_reader *r, const uint8_t *text, size_t size)
{
    for (size_t i = 0; i < size;) {
        if (!r->utf8_size && text[i] < 0x80) {
            i++;
            continue;
        }
        r->utf8[r->utf8_size++] = text[i++];
        if (hg_utf8_sequence((const char *)r->utf8, r->utf8_size) == r->utf8_size)
            r->utf8_size = 0;
        else if (r->utf8_size == 4 || !hg_utf8_is_cut((const char *)r->utf8, r->utf8_size))
            return false;
    }
    return true;
}

// ---- payloads -----------------------------------------------------------------------------------

static bool is_code(unsigned code)
{
    return (code >= 1000 && code <= 1003) || (code >= 1007 && code <= 1014) ||
           (code >= 3000 && code <= 4999);
}

static bool is_text(const uint8_t *text, size_t size)
{
    struct hg_ws_reader alone = {0};
    return take_text(&alone, text, size) && !alone.utf8_size;
}

static enum hg_ws_event end_control(struct hg_ws_reader *r)
{
    if (r->frame.opcode != HG_WS_CLOSE)
        return r->frame.opcode == HG_WS_PING ? HG_WS_PINGED : HG_WS_PONGED;
    const unsigned code = r->control_size > 1 ? r->control[0] << 8 | r->control[1] : HG_WS_NO_CODE;
    if (r->control_size == 1 || (r->control_size && !is_code(code)))
        return reject(r, HG_WS_PROTOCOL_ERROR, "a close frame without a valid code");
    if (r->control_size > 2 && !is_text(r->control + 2, r->control_size - 2u))
        return reject(r, HG_WS_BAD_TEXT, "the reason of a close frame is no UTF-8");
    r->ended = true;
    r->code = (uint16_t)code;
    return HG_WS_CLOSED;
}

static enum hg_ws_event end_frame(struct hg_ws_reader *r)
{
    r->frame.begun = false;
    r->frame.header_size = 0;
    if (is_control(r->frame.opcode))
        return end_control(r);
    if (!r->frame.fin)
        return HG_WS_MORE;
    const bool text = r->message == HG_WS_TEXT;
    r->message = 0;
    if (text && r->utf8_size)
        return reject(r, HG_WS_BAD_TEXT, "a text is no UTF-8");
    return text ? reject(r, HG_WS_UNACCEPTABLE, "HGP is binary: texts are not taken") : HG_WS_MORE;
}

// The next bytes of a payload. *got: bytes at dst that are of a binary message.
static enum hg_ws_event take_payload(
    struct hg_ws_reader *r, const uint8_t *src, size_t size, uint8_t *dst, size_t *got)
{
    struct hg_ws_frame *f = &r->frame;
    *got = 0;
    if (is_control(f->opcode)) {
        hg_ws_mask(r->control + r->control_size, src, size, f->mask, f->mask_at);
        r->control_size = (uint8_t)(r->control_size + size);
    } else {
        // The destination is never behind the source, and words are read before they are written.
        hg_ws_mask(dst, src, size, f->mask, f->mask_at);
        if (r->message == HG_WS_BINARY)
            *got = size;
        else if (!take_text(r, dst, size))
            return reject(r, HG_WS_BAD_TEXT, "a text is no UTF-8");
    }
    f->mask_at = (uint8_t)((f->mask_at + size) & 3);
    f->left -= size;
    return HG_WS_MORE;
}

static size_t take_header(struct hg_ws_frame *f, const uint8_t *src, size_t size)
{
    size_t need = header_needs(f) - f->header_size, step = need < size ? need : size;
    memcpy(f->header + f->header_size, src, step);
    f->header_size = (uint8_t)(f->header_size + step);
    return step;
}

enum hg_ws_event hg_ws_read(struct hg_ws_reader *r, const uint8_t *src, size_t size, uint8_t *dst,
    size_t *used, size_t *got)
{
    struct hg_ws_frame *f = &r->frame;
    enum hg_ws_event event = HG_WS_MORE;
    *used = *got = 0;
    while (event == HG_WS_MORE && !r->ended) {
        if (!f->begun) {
            const bool opening = f->header_size < 2;
            *used += take_header(f, src + *used, size - *used);
            if (f->header_size < 2)
                return HG_WS_MORE;
            if (opening && (event = check_opening(r)))
                break;
            if (f->header_size < header_needs(f)) {
                if (*used == size)
                    return HG_WS_MORE;
                continue;
            }
            event = begin_frame(r);
        } else if (f->left) {
            size_t step = size - *used, moved;
            if (!step)
                return HG_WS_MORE;
            step = f->left < step ? (size_t)f->left : step;
            event = take_payload(r, src + *used, step, dst + *got, &moved);
            *used += step;
            *got += moved;
        }
        if (event == HG_WS_MORE && f->begun && !f->left)
            event = end_frame(r);
    }
    if (r->ended) // what comes behind the end means nothing
        *used = size;
    return event;
}

bool hg_ws_reader_is_sound(const struct hg_ws_reader *r)
{
    const struct hg_ws_frame *f = &r->frame;
    return r->utf8_size < sizeof r->utf8 && r->control_size <= sizeof r->control &&
           f->header_size <= header_needs(f) && f->mask_at < sizeof f->mask &&
           !(f->begun && is_control(f->opcode) && f->left > sizeof r->control - r->control_size);
}

// ---- writing ------------------------------------------------------------------------------------

size_t hg_ws_header(
    uint8_t out[HG_WS_HEADER_BYTES], enum hg_ws_opcode opcode, uint64_t size, const uint8_t *mask)
{
    size_t bytes = size > 0xffff ? 8 : size > 125 ? 2 : 0, n = 2;
    out[0] = (uint8_t)(0x80u | (unsigned)opcode);
    out[1] = (uint8_t)((mask ? 0x80u : 0u) | (bytes == 8 ? 127u : bytes ? 126u : (unsigned)size));
    while (bytes--)
        out[n++] = (uint8_t)(size >> (8 * bytes));
    if (mask) {
        memcpy(out + n, mask, 4);
        n += 4;
    }
    return n;
}

// ---- the opening handshake ----------------------------------------------------------------------

bool hg_ws_key_is_valid(const char *key, size_t size)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    if (size != HG_WS_KEY_CHARS || memcmp(key + 22, "==", 2) != 0)
        return false;
    for (size_t i = 0; i < 22; i++)
        if (!key[i] || !strchr(digits, key[i]))
            return false;
    return strchr("AQgw", key[21]); // of the last digit two bits count
}

enum hg_status hg_ws_accept(const char key[HG_WS_KEY_CHARS], char out[HG_WS_ACCEPT_CHARS + 1])
{
    static const char guid[] = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
    uint8_t text[HG_WS_KEY_CHARS + sizeof guid - 1], hash[20];
    unsigned size = sizeof hash;
    memcpy(text, key, HG_WS_KEY_CHARS);
    memcpy(text + HG_WS_KEY_CHARS, guid, sizeof guid - 1);
    out[0] = 0;
    if (!EVP_Digest(text, sizeof text, hash, &size, EVP_sha1(), NULL) || size != sizeof hash)
        return HG_E_INTERNAL;
    EVP_EncodeBlock((unsigned char *)out, hash, sizeof hash);
    return HG_OK;
}
