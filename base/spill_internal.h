// spill_internal.h - what the heap knows of spilled arrays. Private to base.
#ifndef HG_BASE_SPILL_INTERNAL_H
#define HG_BASE_SPILL_INTERNAL_H

#include <stdbool.h>
#include <stddef.h>

bool hg_alloc_should_fail(void); // counts an allocation

// Drops one reference; false: not a spilled array.
bool hg_spill_unref(void *ptr);

#endif
