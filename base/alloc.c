#include "base/alloc.h"

#include <malloc.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "base/checked.h"
#include "base/spill.h"
#include "base/spill_internal.h"

static _Atomic uint64_t alloc_count;
static _Atomic uint64_t alloc_fail_at;

bool hg_alloc_should_fail(void)
{
    uint64_t n = atomic_fetch_add_explicit(&alloc_count, 1, memory_order_relaxed) + 1;
    uint64_t at = atomic_load_explicit(&alloc_fail_at, memory_order_relaxed);
    return at != 0 && n == at;
}

void *hg_calloc(size_t count, size_t size)
{
    size_t bytes;
    if (!hg_mul_size(count, size, &bytes) || bytes > PTRDIFF_MAX || hg_alloc_should_fail())
        return NULL;
    return calloc(1, bytes ? bytes : 1);
}

void *hg_calloc_aligned(size_t align, size_t size)
{
    if (size > PTRDIFF_MAX || hg_alloc_should_fail())
        return NULL;
    void *ptr = aligned_alloc(align, size ? size : align);
    if (ptr)
        memset(ptr, 0, size);
    return ptr;
}

// A spilled array stays one when it grows.
static void *realloc_spilled(void *ptr, size_t old_bytes, size_t bytes)
{
    void *copy = hg_spill_calloc(bytes, 1);
    if (copy) {
        memcpy(copy, ptr, old_bytes < bytes ? old_bytes : bytes);
        hg_free(ptr);
    }
    return copy;
}

void *hg_realloc(void *ptr, size_t count, size_t size)
{
    size_t bytes, spilled;
    if (!hg_mul_size(count, size, &bytes) || bytes > PTRDIFF_MAX || hg_alloc_should_fail())
        return NULL;
    if ((spilled = hg_spill_size(ptr)) > 0)
        return realloc_spilled(ptr, spilled, bytes);
    return realloc(ptr, bytes ? bytes : 1);
}

char *hg_strndup(const char *text, size_t length)
{
    length = strnlen(text, length);
    char *copy = hg_calloc(length + 1, 1);
    if (copy)
        memcpy(copy, text, length);
    return copy;
}

char *hg_strdup(const char *text)
{
    return hg_strndup(text, strlen(text));
}

size_t hg_alloc_resident_bytes(const void *ptr)
{
    return hg_spill_size(ptr) ? 0 : malloc_usable_size((void *)ptr);
}

void hg_free(void *ptr)
{
    if (!hg_spill_unref(ptr))
        free(ptr);
}

#if defined(__SANITIZE_ADDRESS__) // which looks at the heap only
void *hg_pages_calloc(size_t size)
{
    return hg_calloc(size, 1);
}

void hg_pages_free(void *ptr, size_t size)
{
    (void)size;
    hg_free(ptr);
}
#else
void *hg_pages_calloc(size_t size)
{
    if (hg_alloc_should_fail())
        return NULL;
    void *ptr = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return ptr == MAP_FAILED ? NULL : ptr;
}

void hg_pages_free(void *ptr, size_t size)
{
    if (ptr)
        munmap(ptr, size);
}
#endif

enum hg_status hg_grow(void *ptr_to_ptr, size_t *capacity, size_t need, size_t size)
{
    void *old;
    memcpy(&old, ptr_to_ptr, sizeof old);
    if (need <= *capacity && old)
        return HG_OK;
    size_t next = *capacity ? *capacity : 8;
    while (next < need)
        if (!hg_add_size(next, next / 2 + 1, &next))
            return HG_E_NOMEM;
    void *grown = hg_realloc(old, next, size);
    if (!grown)
        return HG_E_NOMEM;
    memcpy(ptr_to_ptr, &grown, sizeof grown);
    *capacity = next;
    return HG_OK;
}

void hg_alloc_fail_at(uint64_t n)
{
    atomic_store(&alloc_count, 0);
    atomic_store(&alloc_fail_at, n);
}

uint64_t hg_alloc_count(void)
{
    return atomic_load(&alloc_count);
}

void hg_alloc_trim(void)
{
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}
