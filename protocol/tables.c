// Every table of the codec, made by including messages.def several times.
#include <assert.h>
#include <stddef.h>
#include <string.h>

#include "protocol/layout.h"

// ---- enums -------------------------------------------------------------------------------------

#define HGP_ENUM(name, since, doc)     static const struct hgp_enum_value values_##name[] = {
#define HGP_VALUE(e, name, value, doc) {#name, value},
#define HGP_ENUM_END(name)                                                                         \
    }                                                                                              \
    ;                                                                                              \
    static_assert(sizeof(enum hgp_##name) == 4, "enums are kept in 4 bytes");                      \
    static const struct hgp_enum_table enum_##name = {                                             \
        #name, values_##name, sizeof values_##name / sizeof *values_##name};
#include "protocol/messages.def"

static const struct hgp_enum_table *const enums[] = {
#define HGP_ENUM(name, since, doc) &enum_##name,
#include "protocol/messages.def"
};

const struct hgp_enum_table *hgp_enum_find(const char *name)
{
    for (size_t i = 0; i < sizeof enums / sizeof *enums; i++)
        if (strcmp(enums[i]->name, name) == 0)
            return enums[i];
    return NULL;
}

// ---- layouts -----------------------------------------------------------------------------------

#define LIMIT_UINT(a, b)  .limit.u.least = a, .limit.u.most = b
#define LIMIT_NONE(a, b)  .limit.u.least = 0
#define LIMIT_U8(a, b)    LIMIT_UINT(a, b)
#define LIMIT_U16(a, b)   LIMIT_UINT(a, b)
#define LIMIT_U32(a, b)   LIMIT_UINT(a, b)
#define LIMIT_U64(a, b)   LIMIT_UINT(a, b)
#define LIMIT_I32(a, b)   .limit.i.least = a, .limit.i.most = b
#define LIMIT_F32(a, b)   .limit.f.least = (float)(a), .limit.f.most = (float)(b)
#define LIMIT_F64(a, b)   .limit.f.least = a, .limit.f.most = b
#define LIMIT_BOOL(a, b)  LIMIT_NONE(a, b)
#define LIMIT_ENUM(a, b)  .limit.values = &enum_##a
#define LIMIT_STR(a, b)   .limit.max_bytes = a
#define LIMIT_BYTES(a, b) .limit.max_bytes = a
#define LIMIT_VEC2(a, b)  LIMIT_NONE(a, b)
#define LIMIT_VEC3(a, b)  LIMIT_NONE(a, b)
#define LIMIT_VEC4(a, b)  LIMIT_NONE(a, b)
#define LIMIT_MAT4(a, b)  LIMIT_NONE(a, b)
#define LIMIT_HASH(a, b)  LIMIT_NONE(a, b)
#define LIMIT_LIST(a, b)  .limit.list.items = layout_##a, .limit.list.max_count = b

#define HAS_OFFSET_REQ(f) 0
#define HAS_OFFSET_OPT(f) offsetof(self, has_##f)

// One function per layout, because only there the rows can name the struct they belong to.
#define LAYOUT_BEGIN(name)                                                                         \
    static const struct hgp_layout *layout_##name(void)                                            \
    {                                                                                              \
        typedef struct hgp_##name self;                                                            \
        static const struct hgp_field fields[] = {
#define LAYOUT_FIELD(presence, kind, field, a, b, since)                                           \
    {#field, HGP_K_##kind, HGP_P_##presence, since, offsetof(self, field),                         \
        sizeof((self *)0)->field, HAS_OFFSET_##presence(field), LIMIT_##kind(a, b)},
#define LAYOUT_END(name)                                                                           \
    {                                                                                              \
        0                                                                                          \
    }                                                                                              \
    }                                                                                              \
    ;                                                                                              \
    static const struct hgp_layout layout = {                                                      \
        #name, fields, sizeof fields / sizeof *fields - 1, sizeof(self)};                          \
    return &layout;                                                                                \
    }

#define HGP_STRUCT(name, doc)                                     LAYOUT_BEGIN(name)
#define HGP_STRUCT_END(name)                                      LAYOUT_END(name)
#define HGP_MESSAGE(name, id, direction, state, role, since, doc) LAYOUT_BEGIN(name)
#define HGP_MESSAGE_END(name)                                     LAYOUT_END(name)
#define HGP_F(presence, kind, field, a, b, since, doc)                                             \
    LAYOUT_FIELD(presence, kind, field, a, b, since)
#include "protocol/messages.def"

static hgp_layout_fn *const structs[] = {
#define HGP_STRUCT(name, doc) layout_##name,
#include "protocol/messages.def"
};

const struct hgp_layout *hgp_struct_at(size_t n)
{
    return n < sizeof structs / sizeof *structs ? structs[n]() : NULL;
}

// ---- messages ----------------------------------------------------------------------------------

static const struct hgp_message_info messages[] = {
#define HGP_MESSAGE(name, id, direction, state, role, since, doc)                                  \
    {HGP_T_##name, #name, HGP_##direction, HGP_##state, HGP_role_##role, since,                    \
        sizeof(struct hgp_##name)},
#include "protocol/messages.def"
};

enum { MESSAGE_COUNT = sizeof messages / sizeof *messages };

// Rows are numbered so that a switch can lead from the type to its row.
enum {
#define HGP_MESSAGE(name, id, direction, state, role, since, doc) ROW_##name,
#include "protocol/messages.def"
};

const struct hgp_message_info *hgp_message_at(size_t n)
{
    return n < MESSAGE_COUNT ? &messages[n] : NULL;
}

const struct hgp_message_info *hgp_find(uint16_t type)
{
    switch (type) {
#define HGP_MESSAGE(name, id, direction, state, role, since, doc)                                  \
    case HGP_T_##name:                                                                             \
        return &messages[ROW_##name];
#include "protocol/messages.def"
    default:
        return NULL;
    }
}

const struct hgp_layout *hgp_layout_find(uint16_t type)
{
    switch (type) {
#define HGP_MESSAGE(name, id, direction, state, role, since, doc)                                  \
    case HGP_T_##name:                                                                             \
        return layout_##name();
#include "protocol/messages.def"
    default:
        return NULL;
    }
}
