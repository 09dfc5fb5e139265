#include "renderer/scene/formats/gltf/gltf.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/bytes.h"

enum { GLB_MAGIC = 0x46546c67, CHUNK_JSON = 0x4e4f534a, CHUNK_BIN = 0x004e4942 };

static enum hg_status fail_byte(
    struct hg_gltf *g, enum hg_status status, uint64_t offset, const char *reason)
{
    char where[40];
    snprintf(where, sizeof where, "byte %llu", (unsigned long long)offset);
    return hg_error_set(g->err, status, g->file, where, "%s", reason);
}

static enum hg_status parse_json(struct hg_gltf *g, const uint8_t *text, size_t size, size_t base)
{
    // A parsed value takes up to about 40 times the bytes of its shortest text.
    if (size > g->memory_limit / 32)
        return fail_byte(g, HG_E_LIMIT, base, "the JSON text passes the memory limit");
    g->memory_used += size * 8;
    json_error_t error;
    g->json = json_loadb((const char *)text, size, JSON_REJECT_DUPLICATES, &error);
    if (!g->json) {
        char reason[256];
        const enum json_error_code code = json_error_code(&error);
        snprintf(reason, sizeof reason, "INVALID_JSON: %s (line %d, column %d)",
            code == json_error_premature_end_of_input ? "the text ends before its end"
            : code == json_error_duplicate_key        ? "a key is there twice"
            : code == json_error_invalid_utf8         ? "the text is not UTF-8"
                                                      : "the text breaks off or is no JSON here",
            error.line, error.column);
        return fail_byte(
            g, HG_E_FORMAT, base + (error.position > 0 ? (size_t)error.position : 0), reason);
    }
    if (!json_is_object(g->json))
        return fail_byte(g, HG_E_FORMAT, base, "TYPE_MISMATCH: the JSON root is not an object");
    g->root = (struct hg_gltf_at){.json = g->json};
    return HG_OK;
}

static enum hg_status parse_glb(struct hg_gltf *g)
{
    struct hg_reader r = hg_reader_make(g->main->data, g->main->size);
    (void)hg_read_u32(&r);
    uint32_t version = hg_read_u32(&r), length = hg_read_u32(&r);
    if (r.failed)
        return fail_byte(g, HG_E_FORMAT, r.pos, "GLB_UNEXPECTED_END_OF_HEADER: truncated header");
    if (version != 2)
        return fail_byte(g, HG_E_UNSUPPORTED, 4, "GLB_INVALID_VERSION: only version 2 is known");
    if (length > r.size)
        return fail_byte(
            g, HG_E_FORMAT, 8, "GLB_LENGTH_MISMATCH: the file is shorter than it says");
    if (length < r.size)
        hg_asset_warn(g->asset, "byte 8", "GLB_LENGTH_MISMATCH: bytes behind the end are ignored");
    r.size = length;
    for (uint32_t chunk = 0; r.pos < r.size; chunk++) {
        size_t start = r.pos;
        uint32_t size = hg_read_u32(&r), type = hg_read_u32(&r);
        const uint8_t *data = hg_read_bytes(&r, size);
        if (!data)
            return fail_byte(
                g, HG_E_FORMAT, start, "GLB_CHUNK_LENGTH_MISMATCH: a chunk passes the end");
        if (chunk == 0 && type != CHUNK_JSON)
            return fail_byte(g, HG_E_FORMAT, start, "GLB_UNEXPECTED_FIRST_CHUNK: it is not JSON");
        if (chunk == 0) {
            enum hg_status status = parse_json(g, data, size, start + 8);
            if (status)
                return status;
        } else if (chunk == 1 && type == CHUNK_BIN) {
            g->bin = data;
            g->bin_size = size;
        }
    }
    return g->json ? HG_OK : fail_byte(g, HG_E_FORMAT, 12, "GLB_EMPTY_CHUNK: there is no JSON");
}

enum hg_status hg_gltf_parse_container(struct hg_gltf *g)
{
    struct hg_reader r = hg_reader_make(g->main->data, g->main->size);
    if (g->main->size >= 4 && hg_read_u32(&r) == GLB_MAGIC) {
        snprintf(g->asset->file.format, sizeof g->asset->file.format, "glb");
        return parse_glb(g);
    }
    snprintf(g->asset->file.format, sizeof g->asset->file.format, "gltf");
    return parse_json(g, g->main->data, g->main->size, 0);
}

// ---- URIs --------------------------------------------------------------------------------------

static int hex_digit(char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    c = (char)(c | 32);
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

enum hg_status hg_gltf_decode_uri(const char *uri, char **out)
{
    size_t length = strlen(uri), n = 0;
    *out = hg_calloc(length + 1, 1);
    if (!*out)
        return HG_E_NOMEM;
    for (size_t i = 0; i < length; i++) {
        char c = uri[i];
        if (c == '%') {
            int high = length - i > 2 ? hex_digit(uri[i + 1]) : -1;
            int low = high >= 0 ? hex_digit(uri[i + 2]) : -1;
            c = (char)(high * 16 + low);
            if (high < 0 || low < 0 || c == '\0') {
                hg_free(*out);
                *out = NULL;
                return HG_E_FORMAT;
            }
            i += 2;
        }
        (*out)[n++] = c;
    }
    return HG_OK;
}

static int base64_digit(char c)
{
    if (c >= 'A' && c <= 'Z')
        return c - 'A';
    if (c >= 'a' && c <= 'z')
        return c - 'a' + 26;
    if (c >= '0' && c <= '9')
        return c - '0' + 52;
    if (c == '+' || c == '-')
        return 62;
    return c == '/' || c == '_' ? 63 : -1;
}

// RFC 4648 base64, either alphabet, padding optional. False on a foreign character.
static bool decode_base64(const char *text, size_t length, uint8_t *out, size_t *size)
{
    uint32_t bits = 0;
    int held = 0;
    size_t n = 0;
    while (length && text[length - 1] == '=')
        length--;
    for (size_t i = 0; i < length; i++) {
        int digit = base64_digit(text[i]);
        if (digit < 0)
            return false;
        bits = bits << 6 | (uint32_t)digit;
        held += 6;
        if (held >= 8) {
            held -= 8;
            out[n++] = (uint8_t)(bits >> held);
        }
    }
    *size = n;
    return length % 4 != 1;
}

static enum hg_status decode_data_uri(struct hg_gltf *g, const struct hg_gltf_at *at,
    const char *uri, struct hg_refbuf **out, char mime[64])
{
    const char *comma = strchr(uri, ',');
    if (!comma)
        return hg_gltf_fail(g, at, HG_E_FORMAT, "INVALID_URI: a data URI without a comma");
    size_t head = (size_t)(comma - uri), length = strlen(comma + 1);
    const char *semicolon = memchr(uri, ';', head);
    if (mime)
        snprintf(mime, 64, "%.*s", (int)((semicolon ? semicolon : comma) - uri - 5), uri + 5);
    if (head < 7 || strncmp(comma - 7, ";base64", 7) != 0)
        return hg_gltf_fail(g, at, HG_E_FORMAT, "INVALID_URI: a data URI that is not base64");
    if (memmem(uri, head, ";;", 2))
        return hg_gltf_fail(g, at, HG_E_FORMAT, "INVALID_URI: an empty media type parameter");
    uint64_t need = length / 4 * 3 + 3;
    if (need > g->memory_limit - g->memory_used)
        return hg_gltf_fail(g, at, HG_E_LIMIT, "the data URI passes the memory limit");
    struct hg_refbuf *buf = hg_refbuf_create_spilled((size_t)need);
    if (!buf)
        return hg_gltf_fail(g, at, HG_E_NOMEM, "no memory for a data URI");
    if (!decode_base64(comma + 1, length, buf->data, &buf->size)) {
        hg_refbuf_unref(buf);
        return hg_gltf_fail(g, at, HG_E_FORMAT, "INVALID_URI: malformed base64");
    }
    g->memory_used += need;
    *out = buf;
    return HG_OK;
}

// A scheme as in RFC 3986: letters, digits, + - . before a colon.
bool hg_gltf_uri_is_relative(const char *uri)
{
    size_t n = strspn(uri, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789+-.");
    return uri[0] != '/' && !(n > 0 && uri[n] == ':');
}

enum hg_status hg_gltf_fetch(struct hg_gltf *g, const struct hg_gltf_at *at, const char *uri,
    struct hg_refbuf **out, char mime[64])
{
    *out = NULL;
    if (mime)
        mime[0] = '\0';
    if (strncmp(uri, "data:", 5) == 0)
        return decode_data_uri(g, at, uri, out, mime);
    if (!hg_gltf_uri_is_relative(uri))
        return hg_gltf_fail(
            g, at, HG_E_UNSUPPORTED, "NON_RELATIVE_URI: only files beside the asset are read");
    char *path = NULL;
    enum hg_status status = hg_gltf_decode_uri(uri, &path);
    if (status)
        return hg_gltf_fail(g, at, status, "INVALID_URI: wrong percent-encoding");
    struct hg_error error = {0};
    status = g->params->fetch(
        g->params->fetch_user, path, g->memory_limit - g->memory_used, out, &error);
    if (status)
        status = hg_gltf_fail(g, at, status, "IO_ERROR: %s: %s", path,
            error.reason[0] ? error.reason : hg_status_text(status));
    else
        g->memory_used += (*out)->size;
    hg_free(path);
    return status;
}

// ---- buffers -----------------------------------------------------------------------------------

static bool is_fallback(const struct hg_gltf_at *at)
{
    struct hg_gltf_at extensions;
    struct hg_gltf_at meshopt = hg_gltf_extension(at, "EXT_meshopt_compression", &extensions);
    return hg_gltf_bool(&meshopt, "fallback", false);
}

static void check_mime(struct hg_gltf *g, const struct hg_gltf_at *at, const char *mime)
{
    if (mime[0] && strcmp(mime, "application/octet-stream") != 0 &&
        strcmp(mime, "application/gltf-buffer") != 0)
        hg_gltf_warn(g, at, "BUFFER_DATA_URI_MIME_TYPE_INVALID: '%s'", mime);
}

static enum hg_status load_buffer(
    struct hg_gltf *g, const struct hg_gltf_at *at, size_t index, struct hg_gltf_buffer *buffer)
{
    uint64_t length = hg_gltf_uint(at, "byteLength", 0);
    const char *uri = hg_gltf_string(at, "uri");
    if (uri) {
        if (is_fallback(at))
            return HG_OK;
        char mime[64];
        struct hg_gltf_at uri_at = hg_gltf_key(at, "uri");
        enum hg_status status = hg_gltf_fetch(g, &uri_at, uri, &buffer->owner, mime);
        if (status)
            return status;
        check_mime(g, &uri_at, mime);
        buffer->data = buffer->owner->data;
        buffer->size = buffer->owner->size;
    } else if (index == 0 && g->bin) {
        buffer->data = g->bin;
        buffer->size = g->bin_size;
        if (buffer->size > length + 3)
            hg_gltf_warn(g, at, "BUFFER_GLB_CHUNK_TOO_BIG: %llu bytes, %llu declared",
                (unsigned long long)buffer->size, (unsigned long long)length);
    } else {
        if (!is_fallback(at))
            hg_gltf_warn(g, at, "BUFFER_MISSING_GLB_DATA: the buffer has no bytes");
        return HG_OK;
    }
    if (buffer->size < length)
        return hg_gltf_fail(g, at, HG_E_FORMAT,
            "BUFFER_BYTE_LENGTH_MISMATCH: %llu bytes, %llu declared",
            (unsigned long long)buffer->size, (unsigned long long)length);
    buffer->size = length;
    return HG_OK;
}

enum hg_status hg_gltf_load_buffers(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "buffers");
    size_t count = hg_gltf_count(&list);
    g->buffers = hg_gltf_alloc(g, &list, count, sizeof *g->buffers);
    if (!g->buffers)
        return g->err->status;
    g->buffer_count = (uint32_t)count;
    for (size_t i = 0; i < count; i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i);
        enum hg_status status = load_buffer(g, &at, i, &g->buffers[i]);
        if (status)
            return status;
    }
    return HG_OK;
}
