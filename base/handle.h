// handle.h - generation handles: a freed object's handle never finds its successor.
// Floor 0. One thread at a time. Handle 0 is never valid.
#ifndef HG_BASE_HANDLE_H
#define HG_BASE_HANDLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

// Handle layout: low 32 bits = slot + 1, high 32 bits = generation.
struct hg_handles {
    struct hg_handle_slot {
        void *object; // NULL = free
        uint32_t generation, next_free;
    } *slots;
    size_t capacity;
    uint32_t count, used, first_free; // slots ever used, live handles, head of free list + 1
    uint32_t limit;                   // live handles allowed; 0 = 2^31
};

// Takes `object` (not owned, not NULL). HG_E_NOMEM, HG_E_LIMIT; *out is 0 on failure.
enum hg_status hg_handle_add(struct hg_handles *table, void *object, uint64_t *out) HG_MUST_CHECK;
// NULL when the handle is 0, freed or foreign.
void *hg_handle_find(const struct hg_handles *table, uint64_t handle);
// Returns the object that was there, or NULL.
void *hg_handle_remove(struct hg_handles *table, uint64_t handle);
// Iterates live objects: start with *cursor = 0; NULL ends.
void *hg_handle_next(const struct hg_handles *table, uint32_t *cursor, uint64_t *handle);
void hg_handles_finish(struct hg_handles *table);

#endif
