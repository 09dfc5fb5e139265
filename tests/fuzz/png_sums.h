// png_sums.h - a PNG file whose chunks have the right sums, so that what a mutation changed reaches
// the decoder. Test code. One thread.
#ifndef HG_TESTS_FUZZ_PNG_SUMS_H
#define HG_TESTS_FUZZ_PNG_SUMS_H

#include <stdint.h>
#include <stdlib.h>

// A copy of what may be a PNG file, to be freed with free(). Sums follow the chunks as their
// lengths say; where one passes the end nothing is changed from there on.
uint8_t *fuzz_png_sums(const uint8_t *data, size_t size);

#endif
