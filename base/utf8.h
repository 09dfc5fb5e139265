// utf8.h - what is UTF-8 (RFC 3629), and making foreign text so.
// Floor 0. Pure functions; safe from any thread.
#ifndef HG_BASE_UTF8_H
#define HG_BASE_UTF8_H

#include <stdbool.h>
#include <stddef.h>

// Bytes of the well-formed sequence at the start of `text`, 1 to 4; 0 when there is none within
// `left` bytes (overlong forms, surrogates, above U+10FFFF, cut, NUL, left 0).
size_t hg_utf8_sequence(const char *text, size_t left);
// Do these bytes begin a well-formed sequence that more bytes would complete?
bool hg_utf8_is_cut(const char *text, size_t left);
// True when all of it is well formed and holds no NUL.
bool hg_utf8_is_valid(const char *text, size_t size);
// Makes terminated text valid in place: a sequence cut by the end is dropped, every other
// malformed byte becomes '?'. Never longer than before.
void hg_utf8_clean(char *text);

#endif
