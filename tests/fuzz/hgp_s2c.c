// What a client or broker reads from a server or worker.
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/hgp_stream.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    hgp_stream_read(data, size, false);
    return 0;
}
