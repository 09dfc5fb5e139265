// The OFF reader.
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/scene.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_load_file("fuzz.off", data, size);
    return 0;
}
