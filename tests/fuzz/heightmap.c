// Height maps: PNG files of one channel of 16 bits, and SRTM tiles, packed by gzip as they come.
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/scene.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_load_file(size > 0 && data[0] == 0x89 ? "fuzz.png" : "N46E008.hgt.gz", data, size);
    return 0;
}
