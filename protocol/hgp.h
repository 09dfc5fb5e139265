// hgp.h - the Heliograph protocol: framing and message codec. Bytes in, structs out.
// Floor 1. Pure: no sockets, no global state; safe from any thread.
//
// A connection starts with the 8-byte preface HGP_PREFACE from the client. Then both sides send
// messages: a 16-byte little-endian header { u32 length, u16 type, u16 flags, u32 request,
// u32 channel } and `length` payload bytes. `request` is chosen by the asker (0 = no answer
// wanted) and returned in every answer. `channel` is 0 on client connections; on the broker-worker
// link it names the session.
//
// A payload is the fields of its row in messages.def, one behind the other, little-endian, without
// padding: U8 .. F64 and VEC/MAT as they are, BOOL u8, ENUM u16, STR and BYTES u32 size + bytes,
// HASH 32 bytes, LIST u32 count + items. A message (or list part) that has OPT fields starts with
// a u32 bitmap: bit n = the n-th OPT field is there. A message with more than 32 OPT fields has a
// second bitmap for those from the 33rd on, in front of the first of them, and only when one of
// them is there: a message of the first 32 alone ends before it. docs/protocol.md is the normative
// text.
#ifndef HG_PROTOCOL_HGP_H
#define HG_PROTOCOL_HGP_H

#include "base/arena.h"
#include "base/bytes.h"
#include "base/status.h"

#define HGP_PREFACE "HGP\r\n\x1a\n\x01"

enum {
    HGP_PREFACE_BYTES = 8,
    HGP_HEADER_BYTES = 16,
    HGP_VERSION_MIN = 1,
    HGP_VERSION_MAX = 1,
    HGP_LIMIT_BEFORE_AUTH = 16 * 1024,          // greatest payload until the session is open
    HGP_LIMIT_OPEN_DEFAULT = 320 * 1024 * 1024, // and after; configurable
    HGP_FLAG_OPTIONAL = 1,                      // an unknown type with this flag is skipped
};

struct hgp_header {
    uint32_t length; // payload bytes
    uint16_t type;   // enum hgp_type, or unknown
    uint16_t flags;  // HGP_FLAG_*; unknown bits are refused
    uint32_t request;
    uint32_t channel;
};

struct hgp_str {
    const char *data; // UTF-8 without a terminator; may be NULL when size is 0
    uint32_t size;
};

struct hgp_bytes {
    const uint8_t *data;
    uint32_t size;
};

enum hgp_type {
#define HGP_MESSAGE(name, id, direction, state, role, since, doc) HGP_T_##name = id,
#include "protocol/messages.def"
};

#define HGP_ENUM(name, since, doc)                                                                 \
    enum hgp_##name                                                                                \
    {
#define HGP_VALUE(e, name, value, doc) HGP_##e##_##name = value,
#define HGP_ENUM_END(name)                                                                         \
    }                                                                                              \
    ;
#include "protocol/messages.def"

#define HGP_C_U8(f, a, b)    uint8_t f;
#define HGP_C_U16(f, a, b)   uint16_t f;
#define HGP_C_U32(f, a, b)   uint32_t f;
#define HGP_C_U64(f, a, b)   uint64_t f;
#define HGP_C_I32(f, a, b)   int32_t f;
#define HGP_C_F32(f, a, b)   float f;
#define HGP_C_F64(f, a, b)   double f;
#define HGP_C_BOOL(f, a, b)  bool f;
#define HGP_C_ENUM(f, a, b)  enum hgp_##a f;
#define HGP_C_STR(f, a, b)   struct hgp_str f;
#define HGP_C_BYTES(f, a, b) struct hgp_bytes f;
#define HGP_C_VEC2(f, a, b)  float f[2];
#define HGP_C_VEC3(f, a, b)  float f[3];
#define HGP_C_VEC4(f, a, b)  float f[4];
#define HGP_C_MAT4(f, a, b)  float f[16];
#define HGP_C_HASH(f, a, b)  uint8_t f[32];
#define HGP_C_LIST(f, a, b)                                                                        \
    struct {                                                                                       \
        const struct hgp_##a *items;                                                               \
        uint32_t count;                                                                            \
    } f;

#define HGP_C_HAS_REQ(f)
#define HGP_C_HAS_OPT(f) bool has_##f;

// struct hgp_<name> for every list part and message. An OPT field `f` counts only when `has_f`.
#define HGP_STRUCT(name, doc) struct hgp_##name {
#define HGP_F(presence, kind, field, a, b, since, doc)                                             \
    HGP_C_HAS_##presence(field) HGP_C_##kind(field, a, b)
#define HGP_STRUCT_END(name)                                                                       \
    }                                                                                              \
    ;
#define HGP_MESSAGE(name, id, direction, state, role, since, doc) struct hgp_##name {
#define HGP_MESSAGE_END(name)                                                                      \
    char end_; /* not on the wire: keeps messages without fields valid C */                        \
    }                                                                                              \
    ;
#include "protocol/messages.def"

// Any message, for receivers that switch on the type.
union hgp_any {
#define HGP_MESSAGE(name, id, direction, state, role, since, doc) struct hgp_##name name;
#include "protocol/messages.def"
};

enum hgp_direction { HGP_C2S, HGP_S2C, HGP_ANY, HGP_B2W, HGP_W2B };
enum hgp_state { HGP_HELLO, HGP_AUTH, HGP_OPEN };

struct hgp_message_info {
    enum hgp_type type;
    const char *name;
    enum hgp_direction direction;
    enum hgp_state state;
    enum hgp_role role;
    uint16_t since;
    size_t struct_size;
};

// NULL for an unknown type.
const struct hgp_message_info *hgp_find(uint16_t type);

// Reads a header. HG_OK; HG_E_TRUNCATED when fewer than 16 bytes are there;
// HG_E_LIMIT when length > limit; HG_E_FORMAT for unknown flag bits. Does not look at the payload.
enum hg_status hgp_header_decode(
    const uint8_t *data, size_t size, uint32_t limit, struct hgp_header *out) HG_MUST_CHECK;
void hgp_header_encode(const struct hgp_header *header, uint8_t out[HGP_HEADER_BYTES]);

// Where a payload went wrong, and how.
enum { HGP_REASON_BYTES = 96 };
struct hgp_fault {
    char field[64];  // "parts[0].mode"; empty when the payload ends inside or runs over
    uint64_t offset; // of the byte in the payload
    char reason[HGP_REASON_BYTES]; // with the value that is refused and what is allowed; may be
                                   // empty
};

// Decodes a whole payload into *out (struct hgp_<name> of `type`, zeroed first). STR and BYTES
// borrow the payload; LIST items live in `arena`. Exact: missing and extra bytes are refused.
// HG_E_FORMAT (bool, UTF-8, unknown OPT bit, extra bytes), HG_E_TRUNCATED, HG_E_INVAL (number out
// of range or not finite, unknown enum value), HG_E_LIMIT (STR, BYTES or LIST too long),
// HG_E_NOMEM, HG_E_UNSUPPORTED (unknown type or since > version; *out is untouched when the type
// is unknown). On error *out is zeroed and *fault says where (may be NULL). `arena` may be NULL
// for types without a LIST.
enum hg_status hgp_decode(uint16_t version, uint16_t type, struct hg_reader payload,
    struct hg_arena *arena, void *out, struct hgp_fault *fault) HG_MUST_CHECK;

// Where a well-formed payload has a field of the message itself (of an optional one: its value).
// False: the payload has no such field, or cannot be decoded.
bool hgp_field_find(
    uint16_t version, uint16_t type, struct hg_reader payload, const char *field, size_t *at);

// What a message's header says besides its length.
struct hgp_envelope {
    enum hgp_type type;
    uint32_t request, channel;
};

// Appends header and payload. The message must obey its own limits: HG_E_INVAL names the field in
// *fault (may be NULL); HG_E_NOMEM when the writer cannot grow or has failed before;
// HG_E_UNSUPPORTED when the message's since > version. On error nothing is appended and the
// writer is as usable as before. Fields with since > version are left out.
enum hg_status hgp_encode(struct hg_writer *w, uint16_t version, struct hgp_envelope envelope,
    const void *message, struct hgp_fault *fault) HG_MUST_CHECK;

// Overlays the OPT fields present in `from` on `into` (both struct hgp_<name> of `type`); REQ
// fields are taken from `from`. Used to compact journals. Shallow: views are copied, not bytes.
void hgp_merge(enum hgp_type type, void *into, const void *from);

// Names of enum values for logs and command lines: hgp_enum_name("encoding", 5) -> "JPEG";
// NULL when unknown. hgp_enum_value ignores case and treats '-' as '_'; false when unknown.
const char *hgp_enum_name(const char *enum_name, uint32_t value);
bool hgp_enum_value(const char *enum_name, const char *value_name, uint32_t *value);

// NULL is the empty text.
static inline struct hgp_str hgp_str_make(const char *text)
{
    return (struct hgp_str){text, text ? (uint32_t)__builtin_strlen(text) : 0};
}

// The longest start of foreign text (names, paths) that may be sent as a STR of at most max_bytes:
// ends before a sequence that is cut or malformed. `text` may be NULL.
struct hgp_str hgp_str_fit(const char *text, uint32_t max_bytes);

#endif
