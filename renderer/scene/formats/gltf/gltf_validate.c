// Walks the document along its schema. What nothing sound can be made of is refused: wrong types,
// missing members, references to nothing. Odd values are warned about and dealt with by readers.
#include <math.h>
#include <string.h>

#include "renderer/scene/formats/gltf/gltf.h"
#include "renderer/scene/formats/gltf/gltf_schema.h"

static enum hg_status check_object(
    struct hg_gltf *g, const struct hg_gltf_at *at, const struct hg_schema_object *schema);

static enum hg_status wrong_type(
    struct hg_gltf *g, const struct hg_gltf_at *at, bool soft, const char *wanted)
{
    if (!soft)
        return hg_gltf_fail(g, at, HG_E_FORMAT, "TYPE_MISMATCH: not %s", wanted);
    hg_gltf_warn(g, at, "TYPE_MISMATCH: not %s", wanted);
    return HG_OK;
}

static enum hg_status check_number(
    struct hg_gltf *g, const struct hg_gltf_at *at, const struct hg_schema_member *m)
{
    double v = json_number_value(at->json);
    bool integer = m->type == HG_SCHEMA_INTEGER;
    if (!json_is_number(at->json) || (integer && v != floor(v)))
        return wrong_type(g, at, m->flags & HG_SCHEMA_SOFT, integer ? "an integer" : "a number");
    if (integer && (v < 0 || v > 9007199254740992.0))
        return hg_gltf_fail(g, at, HG_E_FORMAT, "VALUE_NOT_IN_RANGE: %g", v);
    if ((m->low != 0 || m->high != 0) && !(v >= m->low && v <= m->high))
        hg_gltf_warn(g, at, "VALUE_NOT_IN_RANGE: %g", v);
    return HG_OK;
}

static bool is_listed(const char *text, const char *values)
{
    size_t n = strlen(text);
    for (const char *p = values; (p = strstr(p, text)); p++)
        if ((p == values || p[-1] == ' ') && (p[n] == ' ' || p[n] == '\0'))
            return true;
    return false;
}

static enum hg_status check_string(
    struct hg_gltf *g, const struct hg_gltf_at *at, const struct hg_schema_member *m)
{
    const char *text = json_string_value(at->json);
    if (!text)
        return wrong_type(g, at, m->flags & HG_SCHEMA_SOFT, "a string");
    if (m->values && (!*text || !is_listed(text, m->values)))
        hg_gltf_warn(g, at, "VALUE_NOT_IN_LIST: '%.60s'", text);
    return HG_OK;
}

static enum hg_status check_index(struct hg_gltf *g, const struct hg_gltf_at *at, const char *array)
{
    double v = json_number_value(at->json);
    if (!json_is_number(at->json) || v != floor(v))
        return wrong_type(g, at, false, "an index");
    size_t count = array ? json_array_size(json_object_get(g->json, array)) : SIZE_MAX;
    if (v < 0 || (array && v >= (double)count))
        return hg_gltf_fail(
            g, at, HG_E_FORMAT, "UNRESOLVED_REFERENCE: %g of %zu %s", v, count, array);
    return HG_OK;
}

static enum hg_status check_map(struct hg_gltf *g, const struct hg_gltf_at *at, const char *array)
{
    if (!json_is_object(at->json))
        return wrong_type(g, at, false, "an object");
    if (json_object_size(at->json) == 0)
        hg_gltf_warn(g, at, "EMPTY_ENTITY: nothing in it");
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)at->json, key, value)
    {
        struct hg_gltf_at item = hg_gltf_key(at, key);
        enum hg_status status = check_index(g, &item, array);
        if (status)
            return status;
    }
    return HG_OK;
}

static enum hg_status check_item(
    struct hg_gltf *g, const struct hg_gltf_at *item, const struct hg_schema_member *m)
{
    switch (m->type) {
    case HG_SCHEMA_NUMBERS:
        return json_is_number(item->json)
                   ? HG_OK
                   : hg_gltf_fail(g, item, HG_E_FORMAT, "ARRAY_TYPE_MISMATCH: not a number");
    case HG_SCHEMA_STRINGS:
        return json_is_string(item->json)
                   ? HG_OK
                   : hg_gltf_fail(g, item, HG_E_FORMAT, "ARRAY_TYPE_MISMATCH: not a string");
    case HG_SCHEMA_INDEXES:
        return check_index(g, item, m->values);
    default:
        if (!json_is_object(item->json))
            return hg_gltf_fail(g, item, HG_E_FORMAT, "ARRAY_TYPE_MISMATCH: not an object");
        return m->child ? check_object(g, item, m->child) : check_map(g, item, m->values);
    }
}

static enum hg_status check_array(
    struct hg_gltf *g, const struct hg_gltf_at *at, const struct hg_schema_member *m)
{
    if (!json_is_array(at->json))
        return wrong_type(g, at, false, "an array");
    size_t count = json_array_size(at->json);
    if (count == 0)
        hg_gltf_warn(g, at, "EMPTY_ENTITY: nothing in it");
    else if (m->type == HG_SCHEMA_NUMBERS && ((double)count < m->low || (double)count > m->high))
        return hg_gltf_fail(g, at, HG_E_FORMAT, "ARRAY_LENGTH_NOT_IN_LIST: %zu items", count);
    for (size_t i = 0; i < count; i++) {
        struct hg_gltf_at item = hg_gltf_item(at, i);
        enum hg_status status = check_item(g, &item, m);
        if (status)
            return status;
    }
    return HG_OK;
}

static enum hg_status check_member(
    struct hg_gltf *g, const struct hg_gltf_at *at, const struct hg_schema_member *m)
{
    switch ((enum hg_schema_type)m->type) {
    case HG_SCHEMA_OBJECT:
        return json_is_object(at->json) ? check_object(g, at, m->child)
                                        : wrong_type(g, at, false, "an object");
    case HG_SCHEMA_STRING:
        return check_string(g, at, m);
    case HG_SCHEMA_NUMBER:
    case HG_SCHEMA_INTEGER:
        return check_number(g, at, m);
    case HG_SCHEMA_BOOLEAN:
        return json_is_boolean(at->json) ? HG_OK : wrong_type(g, at, false, "true or false");
    case HG_SCHEMA_INDEX:
        return check_index(g, at, m->values);
    case HG_SCHEMA_MAP:
        return check_map(g, at, m->values);
    default:
        return check_array(g, at, m);
    }
}

static enum hg_status check_extensions(struct hg_gltf *g, const struct hg_gltf_at *at)
{
    struct hg_gltf_at extensions = hg_gltf_key(at, "extensions");
    if (!extensions.json)
        return HG_OK;
    if (!json_is_object(extensions.json))
        return wrong_type(g, &extensions, false, "an object");
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)extensions.json, key, value)
    {
        const struct hg_schema_object *schema = hg_gltf_extension_schema(key);
        struct hg_gltf_at extension = hg_gltf_key(&extensions, key);
        if (!schema)
            continue;
        if (!json_is_object(value))
            return wrong_type(g, &extension, false, "an object");
        enum hg_status status = check_object(g, &extension, schema);
        if (status)
            return status;
    }
    return HG_OK;
}

// Unknown members, most often a misspelling.
static void check_unexpected(
    struct hg_gltf *g, const struct hg_gltf_at *at, const struct hg_schema_object *schema)
{
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)at->json, key, value)
    {
        const struct hg_schema_member *m = schema->members;
        while (m->name && strcmp(m->name, key) != 0)
            m++;
        struct hg_gltf_at place = hg_gltf_key(at, key);
        if (!m->name && strcmp(key, "extensions") != 0 && strcmp(key, "extras") != 0)
            hg_gltf_warn(g, &place, "UNEXPECTED_PROPERTY: it is ignored");
    }
}

static enum hg_status check_object(
    struct hg_gltf *g, const struct hg_gltf_at *at, const struct hg_schema_object *schema)
{
    for (const struct hg_schema_member *m = schema->members; m->name; m++) {
        struct hg_gltf_at member = hg_gltf_key(at, m->name);
        if (!member.json && !(m->flags & HG_SCHEMA_REQUIRED))
            continue;
        if (!member.json)
            return hg_gltf_fail(
                g, at, HG_E_FORMAT, "UNDEFINED_PROPERTY: '%s' must be defined", m->name);
        enum hg_status status = check_member(g, &member, m);
        if (status)
            return status;
    }
    check_unexpected(g, at, schema);
    return check_extensions(g, at);
}

enum hg_status hg_gltf_check_schema(struct hg_gltf *g)
{
    return check_object(g, &g->root, &hg_gltf_schema);
}
