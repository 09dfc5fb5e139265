// spill_internal.h - what the heap knows of spilled arrays. Private to base.
#ifndef HG_BASE_SPILL_INTERNAL_H
#define HG_BASE_SPILL_INTERNAL_H

#include <stdbool.h>
#include <stddef.h>

bool hg_alloc_should_fail(void); // counts an allocation

// Drops one reference; false: not a spilled array.
bool hg_spill_unref(void *ptr);
// Its size; 0: not a spilled array.
size_t hg_spill_size(const void *ptr);

#endif
