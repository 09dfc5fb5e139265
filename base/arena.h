// arena.h - memory that is freed all at once, under a byte limit.
// Floor 0. One thread at a time.
#ifndef HG_BASE_ARENA_H
#define HG_BASE_ARENA_H

#include <stddef.h>

#include "base/status.h"

struct hg_arena_block;

// Zero-initialise, then set limit_bytes (0 = no limit).
struct hg_arena {
    size_t limit_bytes; // refuse allocations past this; default 0 = unlimited
    size_t used_bytes;  // bytes handed out, padding included
    struct hg_arena_block *head;
};

// Zeroed memory of count x size bytes aligned to 16; NULL past the limit, on overflow or exhaustion.
void *hg_arena_alloc(struct hg_arena *arena, size_t count, size_t size) HG_MUST_CHECK;
// Copies `length` bytes of text and terminates it.
char *hg_arena_strndup(struct hg_arena *arena, const char *text, size_t length) HG_MUST_CHECK;
// Frees everything; the arena can be used again. Accepts a zeroed arena.
void hg_arena_finish(struct hg_arena *arena);

#endif
