#include "base/json.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>

void hg_json_put(struct hg_writer *w, const char *fmt, ...)
{
    char text[1024];
    va_list args;
    va_start(args, fmt);
    const int size = vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    if (size < 0 || size >= (int)sizeof text)
        w->failed = true;
    else
        hg_write_bytes(w, text, (size_t)size);
}

void hg_json_string(struct hg_writer *w, const char *text)
{
    hg_write_u8(w, '"');
    for (; *text != '\0'; text++) {
        if (*text == '"' || *text == '\\')
            hg_write_u8(w, '\\');
        if ((unsigned char)*text < 0x20)
            hg_json_put(w, "\\u%04x", (unsigned)*text);
        else
            hg_write_u8(w, (uint8_t)*text);
    }
    hg_write_u8(w, '"');
}

void hg_json_put_text(struct hg_writer *w, const char *key, const char *value)
{
    hg_json_put(w, "%s", key);
    hg_json_string(w, value);
}

void hg_json_put_number(struct hg_writer *w, const char *key, uint64_t value)
{
    hg_json_put(w, "%s%" PRIu64, key, value);
}

enum hg_status hg_json_take(struct hg_writer *w, char **text)
{
    hg_write_u8(w, 0);
    *text = NULL;
    if (w->failed) {
        hg_writer_finish(w);
        return HG_E_NOMEM;
    }
    *text = (char *)w->data;
    return HG_OK;
}
