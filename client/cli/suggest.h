// suggest.h - the known word that a misspelt one probably stands for.
// Floor 6 (client). Thread: any; pure.
#ifndef HG_CLIENT_CLI_SUGGEST_H
#define HG_CLIENT_CLI_SUGGEST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { HG_SUGGEST_BYTES = 64 }; // longer words are never suggested

// The nearest of the words offered so far. Zeroed apart from `typed` = none.
struct hg_suggestion {
    const char *typed; // borrowed
    size_t length;     // of typed
    uint32_t distance;
    char word[HG_SUGGEST_BYTES]; // empty: none is near enough
};

struct hg_suggestion hg_suggest_begin(const char *typed, size_t length);
// Keeps `word` [length] when it is nearer than what was offered before. Near enough are words at a
// distance of at most a third of their letters, and those that begin with what was typed (3 letters
// or more). Upper and lower case are the same.
void hg_suggest_offer(struct hg_suggestion *s, const char *word, size_t length);
// What a message says of it: "; did you mean 'word'?", empty where none is near enough.
struct hg_suggestion_text {
    char text[HG_SUGGEST_BYTES + 32];
};
struct hg_suggestion_text hg_suggest_text(const struct hg_suggestion *s);
// "a|b|c", each a word of its own.
void hg_suggest_offer_choices(struct hg_suggestion *s, const char *choices);

// Letters inserted, deleted, replaced, or swapped with their neighbour: optimal string alignment
// (Damerau 1964, with the restriction that no part is edited twice). Words are below
// HG_SUGGEST_BYTES, else UINT32_MAX.
uint32_t hg_suggest_distance(const char *a, size_t a_length, const char *b, size_t b_length);

#endif
