// text_scan.h - words, numbers and lines of text files that are not terminated.
// Floor 2, private to scene/. Pure functions, any thread. The locale does not matter: a decimal
// point is a point.
#ifndef HG_RENDERER_SCENE_FORMATS_TEXT_SCAN_H
#define HG_RENDERER_SCENE_FORMATS_TEXT_SCAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// The part of a text that has not been read yet.
struct hg_text {
    const char *at, *end;
};

static inline bool hg_text_is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}

static inline bool hg_text_is_space(char c)
{
    return hg_text_is_blank(c) || c == '\n' || c == '\r';
}

static inline void hg_text_skip_blanks(struct hg_text *t)
{
    while (t->at < t->end && hg_text_is_blank(*t->at))
        t->at++;
}

static inline void hg_text_skip_space(struct hg_text *t)
{
    while (t->at < t->end && hg_text_is_space(*t->at))
        t->at++;
}

// The next line without its end (LF, CR LF or CR); false at the end of the text.
bool hg_text_line(struct hg_text *t, struct hg_text *line);
// The next word, up to white space; empty at the end. Skips white space before it.
struct hg_text hg_text_word(struct hg_text *t);
// Whether a word is this one; letters A to Z count as a to z.
bool hg_text_is(struct hg_text word, const char *lower_case);
// What is left, without blanks at both ends.
struct hg_text hg_text_trim(struct hg_text t);

// A decimal number, "inf" or "nan", correctly rounded (IEEE 754, to nearest even). Skips blanks
// before it, not line ends. False, and nothing read, where there is none.
bool hg_text_number(struct hg_text *t, double *out);
// The same, when white space or the end of the text follows.
bool hg_text_number_word(struct hg_text *t, double *out);

#endif
