// http.h - heads of HTTP/1.1 messages: bytes in, views out. Requests for the daemon, responses for
// clients that ask for a WebSocket. Bodies are for the caller; the daemon takes none.
// Floor 1. Thread: any; no state. Nothing is allocated: all texts are views of the bytes given.
// Source: RFC 9110 (semantics), RFC 9112 (messages). Where a lenient reading would let two programs
// see two different messages (bare line feeds, folded fields, spaces before a colon, a second
// Host or length) the head is refused.
#ifndef HG_PROTOCOL_HTTP_H
#define HG_PROTOCOL_HTTP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

enum {
    HG_HTTP_HEAD_BYTES = 8192,   // greatest head
    HG_HTTP_TARGET_BYTES = 2048, // greatest target of a request
    HG_HTTP_METHOD_BYTES = 16,
    HG_HTTP_FIELDS = 64, // most fields of a head
};

struct hg_http_text {
    const char *data;
    size_t size;
};

struct hg_http_field {
    struct hg_http_text name, value; // value without spaces around it
};

struct hg_http_head {
    struct hg_http_text method;      // of a request
    struct hg_http_text target;      // of a request, as it came
    struct hg_http_text path, query; // of the target, not decoded; the query without its '?'
    unsigned minor;                  // HTTP/1.minor
    unsigned status;                 // of a response; of a refused request: what to answer
    const char *reason;              // of a refused head, else NULL
    size_t bytes;                    // of the whole head, with the empty line
    size_t field_count;
    struct hg_http_field fields[HG_HTTP_FIELDS];
};

// The head of a request at the start of `data`, with at most one empty line before it. HG_E_AGAIN:
// it is not whole, and nothing is wrong with it yet. HG_E_FORMAT, HG_E_LIMIT, HG_E_VERSION: refused
// with out->status (400, 414, 431, 505) and out->reason.
enum hg_status hg_http_request_parse(
    const void *data, size_t size, struct hg_http_head *out) HG_MUST_CHECK;
// The head of a response. HG_E_AGAIN, HG_E_FORMAT, HG_E_LIMIT, HG_E_VERSION, with out->reason.
enum hg_status hg_http_response_parse(
    const void *data, size_t size, struct hg_http_head *out) HG_MUST_CHECK;

// How many fields of that name there are (ASCII case does not count); *value is the first one's,
// or empty.
size_t hg_http_find(const struct hg_http_head *head, const char *name, struct hg_http_text *value);
// Is `token` an element of the lists in all fields of that name? Its case does not count.
bool hg_http_lists(const struct hg_http_head *head, const char *name, const char *token);
bool hg_http_is(struct hg_http_text text, const char *other);          // equal, byte for byte
bool hg_http_is_caseless(struct hg_http_text text, const char *other); // ASCII
// A decimal number without sign or spaces; false: it is none, or above `most`.
bool hg_http_number(struct hg_http_text text, uint64_t most, uint64_t *out);

#endif
