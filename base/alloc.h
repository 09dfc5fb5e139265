// alloc.h - the project's only way to the heap: overflow-checked, and made to fail by tests.
// Floor 0. Thread-safe. All results but pages are freed with hg_free.
#ifndef HG_BASE_ALLOC_H
#define HG_BASE_ALLOC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

// Zeroed memory for count x size bytes; NULL on overflow or exhaustion.
// A zero-byte request returns a unique non-NULL pointer.
void *hg_calloc(size_t count, size_t size) HG_MUST_CHECK;
// The same, aligned to a power of two >= sizeof(void *); size must be a multiple of it.
void *hg_calloc_aligned(size_t align, size_t size) HG_MUST_CHECK;
// Resizes to count x size bytes; new bytes are not cleared. NULL leaves `ptr` valid.
void *hg_realloc(void *ptr, size_t count, size_t size) HG_MUST_CHECK;
char *hg_strdup(const char *text) HG_MUST_CHECK;
// Copies at most `length` bytes and terminates.
char *hg_strndup(const char *text, size_t length) HG_MUST_CHECK;
void hg_free(void *ptr);

// Grows *ptr (elements of `size` bytes, capacity *capacity) so that it holds `need` elements.
// Geometric growth; on failure nothing changes and HG_E_NOMEM is returned.
enum hg_status hg_grow(void *ptr_to_ptr, size_t *capacity, size_t need, size_t size) HG_MUST_CHECK;

// Zeroed memory in pages of its own, for a multiple of their size: those that are never touched
// take nothing, and none is left when it is freed (hg_pages_free, with the same size).
void *hg_pages_calloc(size_t size) HG_MUST_CHECK;
void hg_pages_free(void *ptr, size_t size); // accepts NULL

// Gives what is free in the heap back to the system: after much was taken and freed by many threads.
// Takes milliseconds.
void hg_alloc_trim(void);
// What an array takes in memory: 0 for NULL and for one that is spilled (spill.h).
size_t hg_alloc_resident_bytes(const void *ptr);

// Test hook: let the n-th allocation from now (1 = next) fail once; 0 disarms.
void hg_alloc_fail_at(uint64_t n);
// Number of allocations made since the last hg_alloc_fail_at().
uint64_t hg_alloc_count(void);

#endif
