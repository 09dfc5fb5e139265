// websocket.h - WebSocket frames, incremental and in place: bytes in, bytes of binary messages out.
// Floor 1. Thread: one at a time. Pure: no descriptors, no allocation.
// Source: RFC 6455. No extension is known, so reserved bits are refused. HGP is a stream: the bytes
// of binary messages are joined, and where one message ends means nothing.
#ifndef HG_PROTOCOL_WEBSOCKET_H
#define HG_PROTOCOL_WEBSOCKET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

enum {
    HG_WS_HEADER_BYTES = 14,    // greatest header: 2, 8 of length, 4 of mask
    HG_WS_CONTROL_BYTES = 125,  // greatest payload of a control frame
    HG_WS_TEXT_BYTES = 1 << 16, // greatest text; it is refused in any case, but only when whole
    HG_WS_KEY_CHARS = 24,       // Sec-WebSocket-Key: 16 bytes in base64
    HG_WS_ACCEPT_CHARS = 28,    // Sec-WebSocket-Accept: 20 bytes in base64
};

enum hg_ws_opcode {
    HG_WS_CONTINUATION = 0,
    HG_WS_TEXT = 1,
    HG_WS_BINARY = 2,
    HG_WS_CLOSE = 8,
    HG_WS_PING = 9,
    HG_WS_PONG = 10,
};

enum hg_ws_code { // RFC 6455, 7.4.1
    HG_WS_NORMAL = 1000,
    HG_WS_GOING_AWAY = 1001,
    HG_WS_PROTOCOL_ERROR = 1002,
    HG_WS_UNACCEPTABLE = 1003, // a text
    HG_WS_NO_CODE = 1005,      // never sent: a close frame without one
    HG_WS_BAD_TEXT = 1007,     // no UTF-8
    HG_WS_TOO_LARGE = 1009,
};

// Which part of a stream is being read.
struct hg_ws_frame {
    uint8_t header[HG_WS_HEADER_BYTES];
    uint8_t header_size; // bytes of it that are there
    bool begun;          // the header is whole; `left` bytes of payload are still to come
    bool fin;
    uint8_t opcode;
    uint8_t mask[4], mask_at; // mask_at: of the next byte of payload
    uint64_t left;
};

// {.masked = ...}, the rest zero = the start of a stream.
struct hg_ws_reader {
    bool masked;     // frames of the peer must be masked: it is the client
    bool ended;      // a close frame came, or an error: nothing more is taken
    uint8_t message; // opcode of the message under way, 0 = none
    uint8_t utf8[4]; // of a text: a sequence that a border of pieces cut
    uint8_t utf8_size;
    uint64_t limit;        // bytes of one message; 0 = no limit
    uint64_t message_size; // announced so far
    struct hg_ws_frame frame;
    uint8_t control[HG_WS_CONTROL_BYTES]; // payload of the newest control frame
    uint8_t control_size;
    uint16_t code;      // of an end: what the peer's close frame said, or what to answer with
    const char *reason; // of an error: which rule was broken; NULL = a close frame
};

enum hg_ws_event {
    HG_WS_MORE,     // all bytes were taken
    HG_WS_PINGED,   // control[control_size] is to be sent back
    HG_WS_PONGED,   //
    HG_WS_CLOSED,   // close frame: `code` is the peer's, HG_WS_NO_CODE without one
    HG_WS_REJECTED, // the peer broke a rule: `code` and `reason`
};

// Takes bytes of the stream from src until something has to be done. *used: bytes taken;
// *got <= *used: bytes of binary messages, unmasked, moved to dst, which may be src or before it.
enum hg_ws_event hg_ws_read(struct hg_ws_reader *r, const uint8_t *src, size_t size, uint8_t *dst,
    size_t *used, size_t *got);
// Whether a reader that was stored as its bytes can go on without leaving its own buffers.
bool hg_ws_reader_is_sound(const struct hg_ws_reader *r);

// The header of a final frame; mask NULL: of a server. Returns its size.
size_t hg_ws_header(
    uint8_t out[HG_WS_HEADER_BYTES], enum hg_ws_opcode opcode, uint64_t size, const uint8_t *mask);
// Masks or unmasks bytes that begin `at` bytes (0 to 3, modulo 4) into a payload.
void hg_ws_mask(uint8_t *dst, const uint8_t *src, size_t size, const uint8_t mask[4], unsigned at);
// Is `key` base64 of 16 bytes?
bool hg_ws_key_is_valid(const char *key, size_t size);
// What a server answers to a key; terminated. HG_E_INTERNAL: the system's SHA-1 is not there.
enum hg_status hg_ws_accept(
    const char key[HG_WS_KEY_CHARS], char out[HG_WS_ACCEPT_CHARS + 1]) HG_MUST_CHECK;

#endif
