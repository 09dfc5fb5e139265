#include "client/lib/lookup.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"

// Of the thread and of the transport; who leaves last frees it.
struct lookup {
    _Atomic int holders;
    atomic_bool done;
    char host[256], port[8];
    int ends[2]; // of a pipe: the transport's, the thread's
    int failed;
    struct addrinfo *addresses;
};

static void leave(struct lookup *l)
{
    if (atomic_fetch_sub(&l->holders, 1) != 1)
        return;
    if (l->addresses)
        freeaddrinfo(l->addresses);
    hg_free(l);
}

int hg_client_lookup_now(const char *host, const char *port, int flags, struct addrinfo **out)
{
    struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = flags};
    const int failed = getaddrinfo(host, port, &hints, out);
    if (failed)
        *out = NULL;
    return failed;
}

static void *lookup_main(void *user)
{
    struct lookup *l = user;
    l->failed = hg_client_lookup_now(l->host, l->port, AI_ADDRCONFIG, &l->addresses);
    if (l->failed) // AI_ADDRCONFIG hides the loopback of machines without a network
        l->failed = hg_client_lookup_now(l->host, l->port, 0, &l->addresses);
    atomic_store(&l->done, true);
    close(l->ends[1]);
    leave(l);
    return NULL;
}

// Signals are for the program's own threads.
static int start_thread(struct lookup *l)
{
    pthread_t thread;
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    const int failed = pthread_create(&thread, NULL, lookup_main, l);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (!failed)
        pthread_detach(thread);
    return failed;
}

// ---- a transport that waits for it --------------------------------------------------------------

static enum hg_status lookup_read(
    struct hg_client_transport *t, void *dst, size_t size, size_t *got)
{
    (void)t;
    (void)dst;
    (void)size;
    *got = 0;
    return HG_E_AGAIN;
}

static enum hg_status lookup_write(
    struct hg_client_transport *t, const void *data, size_t size, size_t *sent)
{
    (void)t;
    (void)data;
    (void)size;
    *sent = 0;
    return HG_E_AGAIN;
}

static short lookup_wants(const struct hg_client_transport *t, bool read, bool write)
{
    (void)t;
    (void)read;
    (void)write;
    return 0; // POLLHUP comes unasked
}

static void lookup_close(struct hg_client_transport *t)
{
    close(t->fd);
    leave(t->state);
}

static const struct hg_client_transport_class lookups = {
    .read = lookup_read, .write = lookup_write, .wants = lookup_wants, .close = lookup_close};

enum hg_status hg_client_lookup_begin(
    struct hg_client_transport *t, const char *host, const char *port)
{
    struct lookup *l = hg_calloc(1, sizeof *l);
    if (!l)
        return HG_E_NOMEM;
    if (pipe2(l->ends, O_CLOEXEC)) {
        const enum hg_status status = hg_status_from_errno(errno);
        hg_free(l);
        return status;
    }
    snprintf(l->host, sizeof l->host, "%s", host);
    snprintf(l->port, sizeof l->port, "%s", port);
    l->holders = 2;
    const int fd = l->ends[0];
    if (start_thread(l)) {
        close(l->ends[0]);
        close(l->ends[1]);
        hg_free(l);
        return HG_E_LIMIT;
    }
    t->class = &lookups;
    t->state = l;
    t->fd = fd;
    return HG_OK;
}

bool hg_client_lookup_goes_on(const struct hg_client_transport *t)
{
    return t->class == &lookups;
}

enum hg_status hg_client_lookup_take(struct hg_client_transport *t, int *failed)
{
    struct lookup *l = t->state;
    if (!atomic_load(&l->done))
        return HG_E_AGAIN;
    *failed = l->failed;
    t->addresses = t->address = l->addresses;
    l->addresses = NULL;
    lookup_close(t);
    t->class = NULL;
    t->state = NULL;
    t->fd = -1;
    return HG_OK;
}
