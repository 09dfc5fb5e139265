// layout.h - the tables behind the codec: how the fields of a message lie in C and on the wire.
// Floor 1, private to protocol/ and its tests. Constant data; safe from any thread.
//
// A layout on the wire: when it has OPT fields, a u32 bitmap first (bit n = the n-th OPT field is
// there); then the fields in the order of messages.def. The 33rd OPT field of a message and those
// behind it have a second bitmap in front of them, which is left out, as they are, when it is 0.
// All fields behind it are OPT, and parts of lists have at most 32 (the unit test of the codec
// reads the tables): so the end of the payload says that it is left out. Fields whose `since` is
// greater than the spoken version do not exist, neither as bytes nor as bits.
#ifndef HG_PROTOCOL_LAYOUT_H
#define HG_PROTOCOL_LAYOUT_H

#include "protocol/hgp.h"

enum hgp_kind {
    HGP_K_U8,
    HGP_K_U16,
    HGP_K_U32,
    HGP_K_U64,
    HGP_K_I32,
    HGP_K_F32,
    HGP_K_F64,
    HGP_K_BOOL,  // u8, 0 or 1
    HGP_K_ENUM,  // u16
    HGP_K_STR,   // u32 size, bytes
    HGP_K_BYTES, // u32 size, bytes
    HGP_K_VEC2,  // f32 each
    HGP_K_VEC3,
    HGP_K_VEC4,
    HGP_K_MAT4,
    HGP_K_HASH, // 32 bytes
    HGP_K_LIST, // u32 count, items
};

enum hgp_presence { HGP_P_REQ, HGP_P_OPT };

struct hgp_enum_value {
    const char *name;
    uint32_t value;
};

struct hgp_enum_table {
    const char *name;
    const struct hgp_enum_value *values;
    size_t count;
};

struct hgp_layout;
typedef const struct hgp_layout *hgp_layout_fn(void);

struct hgp_field {
    const char *name;
    enum hgp_kind kind;
    enum hgp_presence presence;
    uint16_t since;
    size_t offset;     // of the member in its struct
    size_t size;       // of the member
    size_t has_offset; // of its has_ flag, OPT only
    union {
        struct {
            uint64_t least, most;
        } u; // U8 U16 U32 U64
        struct {
            int64_t least, most;
        } i; // I32
        struct {
            double least, most;
        } f;                                 // F32 (limits rounded to float) F64
        const struct hgp_enum_table *values; // ENUM
        uint32_t max_bytes;                  // STR BYTES
        struct {
            hgp_layout_fn *items;
            uint32_t max_count;
        } list;
    } limit;
};

struct hgp_layout {
    const char *name;
    const struct hgp_field *fields;
    size_t field_count;
    size_t struct_size;
};

// A LIST member seen without the type of its items.
struct hgp_any_list {
    const void *items;
    uint32_t count;
};

// NULL for an unknown type.
const struct hgp_layout *hgp_layout_find(uint16_t type);
// The n-th message's description, in the order of messages.def; NULL behind the last.
const struct hgp_message_info *hgp_message_at(size_t n);
// The n-th list part, likewise.
const struct hgp_layout *hgp_struct_at(size_t n);
// NULL when unknown.
const struct hgp_enum_table *hgp_enum_find(const char *name);

// Optional fields of one bitmap, and bitmaps of a message.
enum { HGP_BITMAP_FIELDS = 32, HGP_BITMAPS = 2 };
// Bits of the OPT fields of bitmap 0 or 1 known to `version`; 0 = there is no such bitmap.
uint32_t hgp_layout_known_bits(const struct hgp_layout *layout, unsigned bitmap, uint16_t version);
// Least number of bytes a value of this layout takes.
size_t hgp_layout_least_bytes(const struct hgp_layout *layout, uint16_t version);
// f32 values in a VEC or MAT, 0 for other kinds.
size_t hgp_kind_floats(enum hgp_kind kind);

// A list item on the way to a field, for texts like "parts[0].mode".
struct hgp_place {
    const struct hgp_place *outer; // NULL = the message itself
    const char *list;
    uint32_t index;
};

// Fills *fault, which may be NULL; `field` may be NULL (no field to blame). Returns `status`.
enum hg_status hgp_fault_set(struct hgp_fault *fault, enum hg_status status,
    const struct hgp_place *place, const char *field, uint64_t offset, const char *reason);

// Value rules, the same for both directions: HG_OK, or a status and its reason.
// For U8 .. F64, ENUM, VEC and MAT; `member` points into the struct.
enum hg_status hgp_check_value(
    const struct hgp_field *field, const void *member, char reason[HGP_REASON_BYTES]);
// For the size of STR and BYTES and the count of LIST.
enum hg_status hgp_check_size(
    const struct hgp_field *field, uint32_t size, char reason[HGP_REASON_BYTES]);

// The bodies of hgp_decode and hgp_encode for one layout (tests call them with their own).
enum hg_status hgp_layout_decode(const struct hgp_layout *layout, uint16_t version,
    struct hg_reader *payload, struct hg_arena *arena, void *out,
    struct hgp_fault *fault) HG_MUST_CHECK;
enum hg_status hgp_layout_encode(const struct hgp_layout *layout, uint16_t version,
    struct hg_writer *w, const void *message, struct hgp_fault *fault) HG_MUST_CHECK;

#endif
