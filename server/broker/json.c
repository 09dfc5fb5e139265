#include "server/broker/json.h"

#include <stdio.h>
#include <string.h>

void hg_json_put(struct hg_writer *w, const char *text)
{
    hg_write_bytes(w, text, strlen(text));
}

void hg_json_put_string(struct hg_writer *w, const char *text)
{
    hg_json_put(w, "\"");
    for (; *text; text++) {
        char escaped[8];
        if (*text == '"' || *text == '\\')
            snprintf(escaped, sizeof escaped, "\\%c", *text);
        else if ((unsigned char)*text < 0x20)
            snprintf(escaped, sizeof escaped, "\\u%04x", (unsigned)*text);
        else
            snprintf(escaped, sizeof escaped, "%c", *text);
        hg_json_put(w, escaped);
    }
    hg_json_put(w, "\"");
}

void hg_json_put_text(struct hg_writer *w, const char *key, const char *value)
{
    hg_json_put(w, key);
    hg_json_put_string(w, value);
}

void hg_json_put_number(struct hg_writer *w, const char *key, uint64_t value)
{
    char text[24];
    hg_json_put(w, key);
    snprintf(text, sizeof text, "%llu", (unsigned long long)value);
    hg_json_put(w, text);
}
