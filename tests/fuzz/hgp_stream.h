// hgp_stream.h - one side of a connection, as the fuzz harnesses play it. Test code.
#ifndef HG_TESTS_FUZZ_HGP_STREAM_H
#define HG_TESTS_FUZZ_HGP_STREAM_H

#include "protocol/hgp.h"

// Reads a whole stream as a server reads a client (`to_server`) or a client a server, with states
// and limits, and checks what the codec promises about every payload. A stream that does not start
// like a client connection is read as the link between broker and worker.
void hgp_stream_read(const uint8_t *data, size_t size, bool to_server);

#endif
