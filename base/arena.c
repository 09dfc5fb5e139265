#include "base/arena.h"

#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"

enum { BLOCK_BYTES = 64 * 1024, ALIGN = 16 };

struct hg_arena_block {
    struct hg_arena_block *next;
    size_t size, used;
    _Alignas(16) unsigned char data[];
};

static struct hg_arena_block *add_block(struct hg_arena *arena, size_t bytes)
{
    size_t size = bytes > BLOCK_BYTES ? bytes : BLOCK_BYTES, total;
    if (!hg_add_size(size, sizeof(struct hg_arena_block), &total))
        return NULL;
    struct hg_arena_block *block = hg_calloc(1, total);
    if (!block)
        return NULL;
    block->size = size;
    // A block made for one large request goes behind the head, which may still have room.
    if (arena->head && bytes > BLOCK_BYTES) {
        block->next = arena->head->next;
        arena->head->next = block;
    } else {
        block->next = arena->head;
        arena->head = block;
    }
    return block;
}

void *hg_arena_alloc(struct hg_arena *arena, size_t count, size_t size)
{
    size_t bytes, total;
    if (!hg_mul_size(count, size, &bytes) || !hg_align_size(bytes ? bytes : 1, ALIGN, &bytes) ||
        !hg_add_size(arena->used_bytes, bytes, &total))
        return NULL;
    if (arena->limit_bytes && total > arena->limit_bytes)
        return NULL;
    struct hg_arena_block *block = arena->head;
    if (!block || block->size - block->used < bytes)
        block = add_block(arena, bytes);
    if (!block)
        return NULL;
    void *result = block->data + block->used;
    block->used += bytes;
    arena->used_bytes = total;
    return result;
}

char *hg_arena_strndup(struct hg_arena *arena, const char *text, size_t length)
{
    size_t size;
    char *copy = hg_add_size(length, 1, &size) ? hg_arena_alloc(arena, size, 1) : NULL;
    if (copy)
        memcpy(copy, text, length);
    return copy;
}

void hg_arena_finish(struct hg_arena *arena)
{
    for (struct hg_arena_block *block = arena->head, *next; block; block = next) {
        next = block->next;
        hg_free(block);
    }
    arena->head = NULL;
    arena->used_bytes = 0;
}
