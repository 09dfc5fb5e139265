#include "client/cli/suggest.h"

#include <stdio.h>
#include <string.h>

static char lower(char c)
{
    return (char)(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
}

static uint32_t least(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

uint32_t hg_suggest_distance(const char *a, size_t a_length, const char *b, size_t b_length)
{
    uint32_t rows[3][HG_SUGGEST_BYTES + 1];
    if (a_length >= HG_SUGGEST_BYTES || b_length >= HG_SUGGEST_BYTES)
        return UINT32_MAX;
    uint32_t *two_back = rows[0], *back = rows[1], *row = rows[2];
    for (size_t j = 0; j <= b_length; j++)
        back[j] = (uint32_t)j;
    for (size_t i = 1; i <= a_length; i++) {
        row[0] = (uint32_t)i;
        for (size_t j = 1; j <= b_length; j++) {
            const bool same = lower(a[i - 1]) == lower(b[j - 1]);
            row[j] = least(least(back[j], row[j - 1]) + 1, back[j - 1] + !same);
            if (i > 1 && j > 1 && lower(a[i - 1]) == lower(b[j - 2]) &&
                lower(a[i - 2]) == lower(b[j - 1]))
                row[j] = least(row[j], two_back[j - 2] + 1);
        }
        uint32_t *const reused = two_back;
        two_back = back;
        back = row;
        row = reused;
    }
    return back[b_length];
}

struct hg_suggestion hg_suggest_begin(const char *typed, size_t length)
{
    return (struct hg_suggestion){.typed = typed, .length = length, .distance = UINT32_MAX};
}

static bool begins_with(const char *word, const char *begin, size_t length)
{
    for (size_t i = 0; i < length; i++)
        if (lower(word[i]) != lower(begin[i]))
            return false;
    return true;
}

void hg_suggest_offer(struct hg_suggestion *s, const char *word, size_t length)
{
    uint32_t distance = hg_suggest_distance(s->typed, s->length, word, length);
    if (distance == UINT32_MAX)
        return;
    const bool begun =
        s->length >= 3 && length > s->length && begins_with(word, s->typed, s->length);
    const uint32_t limit = length < 3 ? 0 : length < 6 ? 1 + (length > 3) : (uint32_t)length / 3;
    if (!begun && distance > limit)
        return;
    if (distance < s->distance) {
        s->distance = distance;
        snprintf(s->word, sizeof s->word, "%.*s", (int)length, word);
    }
}

void hg_suggest_offer_choices(struct hg_suggestion *s, const char *choices)
{
    while (*choices) {
        const size_t n = strcspn(choices, "|");
        hg_suggest_offer(s, choices, n);
        choices += n + (choices[n] == '|');
    }
}

struct hg_suggestion_text hg_suggest_text(const struct hg_suggestion *s)
{
    struct hg_suggestion_text out = {""};
    if (s->word[0])
        snprintf(out.text, sizeof out.text, "; did you mean '%s'?", s->word);
    return out;
}
