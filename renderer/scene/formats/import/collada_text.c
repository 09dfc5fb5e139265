#include "renderer/scene/formats/import/collada_text.h"

#include <stdbool.h>
#include <string.h>

// ---- encodings ---------------------------------------------------------------------------------

enum encoding { UTF_8, UTF_16_LITTLE, UTF_16_BIG };

static enum encoding find_encoding(const uint8_t *p, size_t size)
{
    if (size < 2)
        return UTF_8;
    if ((p[0] == 0xff && p[1] == 0xfe) || (p[0] == '<' && p[1] == 0))
        return UTF_16_LITTLE;
    return (p[0] == 0xfe && p[1] == 0xff) || (p[0] == 0 && p[1] == '<') ? UTF_16_BIG : UTF_8;
}

static uint32_t unit_at(const uint8_t *p, bool big)
{
    return big ? (uint32_t)(p[0] << 8 | p[1]) : (uint32_t)(p[1] << 8 | p[0]);
}

// A surrogate without its other half becomes U+FFFD (Unicode 15, 3.9).
static size_t put_utf8(uint8_t *out, uint32_t c)
{
    if (c < 0x80) {
        out[0] = (uint8_t)c;
        return 1;
    }
    if (c < 0x800) {
        out[0] = (uint8_t)(0xc0 | c >> 6);
        out[1] = (uint8_t)(0x80 | (c & 63));
        return 2;
    }
    const size_t n = c < 0x10000 ? 3 : 4;
    out[0] = (uint8_t)((n == 3 ? 0xe0 : 0xf0) | c >> 6 * (n - 1));
    for (size_t i = 1; i < n; i++)
        out[i] = (uint8_t)(0x80 | (c >> 6 * (n - 1 - i) & 63));
    return n;
}

static size_t from_utf16(const uint8_t *p, size_t size, bool big, uint8_t *out)
{
    size_t n = 0;
    for (size_t i = 0; i + 2 <= size; i += 2) {
        uint32_t c = unit_at(p + i, big);
        if (c >= 0xd800 && c < 0xe000) {
            const uint32_t low = c < 0xdc00 && i + 4 <= size ? unit_at(p + i + 2, big) : 0;
            const bool pair = low >= 0xdc00 && low < 0xe000;
            c = pair ? 0x10000 + ((c & 0x3ff) << 10) + (low & 0x3ff) : 0xfffd;
            i += pair ? 2 : 0;
        }
        n += put_utf8(out + n, c);
    }
    return n;
}

// ---- white space -------------------------------------------------------------------------------

struct cleaner {
    const uint8_t *at, *end;
    uint8_t *out;
    bool blank; // white space was read and not written yet
    bool first; // nothing was written since the text or the value began
};

// Bytes of the white space at a place; 0: none.
static size_t space_at(const uint8_t *p, const uint8_t *end)
{
    if (*p == ' ' || *p == '\t' || *p == '\n' || *p == '\r' || *p == '\v' || *p == '\f' || *p == 0)
        return 1;
    if (end - p >= 2 && p[0] == 0xc2 && p[1] == 0xa0)
        return 2;
    return end - p >= 3 && p[0] == 0xef && p[1] == 0xbb && p[2] == 0xbf ? 3 : 0;
}

static bool begins(const struct cleaner *c, const char *text)
{
    const size_t n = strlen(text);
    return (size_t)(c->end - c->at) >= n && memcmp(c->at, text, n) == 0;
}

// Passes over what ends with `text`, or all that is left.
static void skip_past(struct cleaner *c, const char *text, bool copy)
{
    const size_t n = strlen(text);
    const uint8_t *found = memmem(c->at, (size_t)(c->end - c->at), text, n);
    const uint8_t *end = found ? found + n : c->end;
    if (copy) {
        memmove(c->out, c->at, (size_t)(end - c->at));
        c->out += end - c->at;
    }
    c->at = end;
}

// One character, or the white space before the next; blanks at the beginning are dropped, those
// before the end when that comes.
static void copy_character(struct cleaner *c)
{
    const size_t space = space_at(c->at, c->end);
    if (space) {
        c->blank = true;
        c->at += space;
        return;
    }
    if (c->blank && !c->first)
        *c->out++ = ' ';
    c->blank = c->first = false;
    *c->out++ = *c->at++;
}

static void copy_value(struct cleaner *c)
{
    const uint8_t quote = *c->at;
    if (c->blank)
        *c->out++ = ' ';
    *c->out++ = *c->at++;
    c->first = true;
    c->blank = false;
    while (c->at < c->end && *c->at != quote)
        copy_character(c);
    if (c->at < c->end)
        *c->out++ = *c->at++;
    c->first = c->blank = false;
}

static void copy_tag(struct cleaner *c)
{
    *c->out++ = *c->at++;
    c->first = true;
    c->blank = false;
    while (c->at < c->end && *c->at != '>') {
        if (*c->at == '"' || *c->at == '\'')
            copy_value(c);
        else
            copy_character(c);
    }
    if (c->at < c->end)
        *c->out++ = *c->at++;
    c->first = true;
    c->blank = false;
}

// In place: what is written never passes what is read.
static size_t clean(uint8_t *text, size_t size)
{
    struct cleaner c = {.at = text, .end = text + size, .out = text, .first = true};
    while (c.at < c.end) {
        if (begins(&c, "<!--"))
            skip_past(&c, "-->", false);
        else if (begins(&c, "<?"))
            skip_past(&c, "?>", false);
        else if (begins(&c, "<![CDATA["))
            skip_past(&c, "]]>", true);
        else if (*c.at == '<')
            copy_tag(&c);
        else
            copy_character(&c);
    }
    return (size_t)(c.out - text);
}

enum hg_status hg_collada_clean(const struct hg_refbuf *in, uint64_t limit_bytes, const char *label,
    struct hg_refbuf **out, struct hg_error *err)
{
    const enum encoding encoding = find_encoding(in->data, in->size);
    // A unit of two bytes takes up to three, a pair of them four.
    const uint64_t size = encoding == UTF_8 ? in->size : (uint64_t)in->size / 2 * 3;
    *out = NULL;
    if (size > limit_bytes)
        return hg_error_set(err, HG_E_LIMIT, label, NULL, "the text passes the memory limit");
    struct hg_refbuf *buf = hg_refbuf_create_spilled((size_t)size);
    if (!buf)
        return hg_error_set(err, HG_E_NOMEM, label, NULL, "no memory");
    if (encoding == UTF_8)
        memcpy(buf->data, in->data, in->size);
    else
        buf->size = from_utf16(in->data, in->size, encoding == UTF_16_BIG, buf->data);
    buf->size = clean(buf->data, buf->size);
    *out = buf;
    return HG_OK;
}
