// A whole connection of libhelio against whatever a daemon or worker may send: it must neither
// crash nor hang nor leak, and end with a status and a reason.
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "client/lib/conn.h"
#include "tests/fuzz/fuzz.h"

// Takes what was received; asks once, so that answers have something to belong to.
static void use(struct helio *h, bool *asked)
{
    struct helio_message *m;
    struct hg_error err = {0};
    struct helio_info info;
    helio_get_info(h, &info);
    if (info.state == HELIO_OPEN && !*asked) {
        uint32_t request;
        struct hgp_frame_request ask = {.view = 1};
        *asked = true;
        enum hg_status status = helio_send(h, HGP_T_frame_request, &ask, &request, &err);
        FUZZ_CHECK(status == HG_OK || status == HG_E_LIMIT);
    }
    while (helio_next(h, &m, &err) == HG_OK) {
        FUZZ_CHECK(m->body != NULL);
        helio_message_free(m);
    }
}

static void drain(int fd)
{
    char bytes[4096];
    while (recv(fd, bytes, sizeof bytes, MSG_DONTWAIT) > 0)
        ;
}

static void face(const uint8_t *data, size_t size, bool worker, size_t step)
{
    int pair[2];
    struct helio *h;
    struct hg_error err = {0};
    bool asked = false;
    struct helio_options options = {.url = "fuzz", .max_receive_bytes = 1 << 20};
    FUZZ_CHECK(socketpair(AF_UNIX, SOCK_STREAM, 0, pair) == 0);
    FUZZ_CHECK(helio_start_fd(&options, pair[0], &h, &err) == HG_OK);
    h->embedded = worker;
    enum hg_status status = HG_OK;
    for (size_t at = 0; at < size && !status; at += step) {
        size_t n = size - at < step ? size - at : step;
        FUZZ_CHECK(send(pair[1], data + at, n, MSG_NOSIGNAL) == (ssize_t)n);
        status = helio_process(h, &err);
        use(h, &asked);
        drain(pair[1]);
    }
    shutdown(pair[1], SHUT_WR);
    for (int i = 0; i < 1000 && !status; i++) {
        status = helio_process(h, &err);
        use(h, &asked);
        drain(pair[1]);
    }
    FUZZ_CHECK(status != HG_OK && err.status == status && err.reason[0]);
    helio_destroy(h);
    close(pair[1]);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    face(data, size, false, 4096);
    face(data, size, false, 7); // cut finely
    face(data, size, true, 4096);
    return 0;
}
