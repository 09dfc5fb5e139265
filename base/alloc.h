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
// As hg_calloc, aligned to `align`, a power of two >= sizeof(void *); size: a multiple of it.
void *hg_calloc_aligned(size_t align, size_t size) HG_MUST_CHECK;
// Resizes to count x size bytes; new bytes are not cleared. NULL leaves `ptr` valid.
void *hg_realloc(void *ptr, size_t count, size_t size) HG_MUST_CHECK;
char *hg_strdup(const char *text) HG_MUST_CHECK; // NULL: no memory
// Copies at most `length` bytes and terminates the copy. NULL: no memory.
char *hg_strndup(const char *text, size_t length) HG_MUST_CHECK;
void hg_free(void *ptr); // accepts NULL

// Grows *ptr (elements of `size` bytes, capacity *capacity) so that it holds `need` elements.
// Geometric growth; on failure nothing changes and HG_E_NOMEM is returned.
enum hg_status hg_grow(void *ptr_to_ptr, size_t *capacity, size_t need, size_t size) HG_MUST_CHECK;

// Zeroed memory in whole pages, `size` bytes, a multiple of the page size; NULL: no memory. Pages
// that are not touched take no memory; hg_pages_free (same size) returns all to the system.
void *hg_pages_calloc(size_t size) HG_MUST_CHECK;
void hg_pages_free(void *ptr, size_t size); // accepts NULL

// Returns free heap memory to the system, after many threads have allocated and freed much. Takes
// milliseconds.
void hg_alloc_trim(void);
// Bytes of memory that an allocation takes: 0 for NULL and for one that is spilled (spill.h).
size_t hg_alloc_resident_bytes(const void *ptr);

// Test hook: let the n-th allocation from now (1 = next) fail once; 0 disarms.
void hg_alloc_fail_at(uint64_t n);
// Number of allocations made since the last hg_alloc_fail_at().
uint64_t hg_alloc_count(void);

#endif
