// What a server or worker reads from a client or broker.
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/hgp_stream.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    hgp_stream_read(data, size, true);
    return 0;
}
