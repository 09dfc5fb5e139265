// Height maps: PNG files of one channel of 16 bits, every second one with its sums put right, and
// SRTM tiles, packed by gzip as they come.
//
// A whole tile has 2.9 MB and its mesh 86 MB, which would be nearly all the time of a run: one file
// of 64, by the sum of its bytes (and so the corpus tile.hgt.gz), may become as large, others 1
// MiB.
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/png_sums.h"
#include "tests/fuzz/scene.h"

enum { SMALL_BYTES = 1 << 20, LARGE_BYTES = 96 << 20 };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const pictures[] = {"fuzz.png", "N46E008.png"}; // the second one is to scale
    uint32_t sum = 0;
    for (size_t i = 0; i < size; i++)
        sum += data[i];
    const uint64_t limit = sum % 64 == 0 ? LARGE_BYTES : SMALL_BYTES;
    if (size == 0 || data[0] != 0x89) {
        fuzz_load_file_within("N46E008.hgt.gz", data, size, limit);
        return 0;
    }
    uint8_t *mended = sum / 64 % 2 ? fuzz_png_sums(data, size) : NULL;
    fuzz_load_file_within(pictures[sum / 128 % 2], mended ? mended : data, size, limit);
    free(mended);
    return 0;
}
