#include "base/utf8.h"

#include <string.h>

// How many bytes a sequence that starts with `c` has; 0 when none starts so.
static size_t announced(unsigned char c)
{
    if (c < 0x80)
        return c != 0;
    if (c < 0xc2 || c > 0xf4)
        return 0;
    return c >= 0xf0 ? 4 : c >= 0xe0 ? 3 : 2;
}

// Bytes from the start of `text` that fit a well-formed sequence of `length` bytes.
static size_t fitting(const unsigned char *p, size_t length, size_t left)
{
    // The second byte carries the bounds against overlong forms, surrogates and > U+10FFFF.
    unsigned char least = p[0] == 0xe0 ? 0xa0 : p[0] == 0xf0 ? 0x90 : 0x80;
    unsigned char most = p[0] == 0xed ? 0x9f : p[0] == 0xf4 ? 0x8f : 0xbf;
    size_t n = 1;
    for (; n < length && n < left && p[n] >= least && p[n] <= most; n++) {
        least = 0x80;
        most = 0xbf;
    }
    return n;
}

size_t hg_utf8_sequence(const char *text, size_t left)
{
    const unsigned char *p = (const unsigned char *)text;
    size_t length = left ? announced(p[0]) : 0;
    return length && fitting(p, length, left) == length ? length : 0;
}

bool hg_utf8_is_cut(const char *text, size_t left)
{
    const unsigned char *p = (const unsigned char *)text;
    size_t length = left ? announced(p[0]) : 0;
    return length > left && fitting(p, length, left) == left;
}

bool hg_utf8_is_valid(const char *text, size_t size)
{
    for (size_t i = 0, n; i < size; i += n) {
        n = hg_utf8_sequence(text + i, size - i);
        if (n == 0)
            return false;
    }
    return true;
}

void hg_utf8_clean(char *text)
{
    size_t size = strlen(text);
    for (size_t i = 0, n; i < size; i += n) {
        n = hg_utf8_sequence(text + i, size - i);
        if (n)
            continue;
        const unsigned char *p = (const unsigned char *)text + i;
        size_t length = announced(p[0]);
        if (length > size - i && fitting(p, length, size - i) == size - i) {
            text[i] = 0;
            return;
        }
        text[i] = '?';
        n = 1;
    }
}
