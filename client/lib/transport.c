#include "client/lib/transport.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/file.h"

// ---- sockets -----------------------------------------------------------------------------------

static enum hg_status socket_failed(struct hg_client_transport *t)
{
    if (errno == EAGAIN || errno == EWOULDBLOCK)
        return HG_E_AGAIN;
    t->error_number = errno;
    return HG_E_IO;
}

static enum hg_status socket_read(
    struct hg_client_transport *t, void *dst, size_t size, size_t *got)
{
    ssize_t n;
    *got = 0;
    do
        n = recv(t->fd, dst, size, MSG_DONTWAIT);
    while (n < 0 && errno == EINTR);
    if (n == 0)
        return HG_E_CLOSED;
    if (n < 0)
        return socket_failed(t);
    *got = (size_t)n;
    return HG_OK;
}

static enum hg_status socket_write(
    struct hg_client_transport *t, const void *data, size_t size, size_t *sent)
{
    ssize_t n;
    *sent = 0;
    do
        n = send(t->fd, data, size, MSG_NOSIGNAL | MSG_DONTWAIT);
    while (n < 0 && errno == EINTR);
    if (n < 0 && (errno == EPIPE || errno == ECONNRESET))
        return HG_E_CLOSED;
    if (n < 0)
        return socket_failed(t);
    *sent = (size_t)n;
    return HG_OK;
}

static short socket_wants(const struct hg_client_transport *t, bool read, bool write)
{
    (void)t;
    return (short)((read ? POLLIN : 0) | (write ? POLLOUT : 0));
}

static void socket_close(struct hg_client_transport *t)
{
    close(t->fd);
}

static const struct hg_client_transport_class sockets = {
    socket_read, socket_write, socket_wants, socket_close};

enum hg_status hg_client_transport_adopt(struct hg_client_transport *t, int fd)
{
    int flags = fcntl(fd, F_GETFL);
    *t = (struct hg_client_transport){.class = &sockets, .fd = fd};
    if (flags >= 0 && fcntl(fd, F_SETFL, flags | O_NONBLOCK) == 0)
        return HG_OK;
    hg_client_transport_close(t);
    return HG_E_INVAL;
}

void hg_client_transport_close(struct hg_client_transport *t)
{
    if (t->class)
        t->class->close(t);
    if (t->addresses)
        freeaddrinfo(t->addresses);
    *t = (struct hg_client_transport){.fd = -1};
}

// ---- connecting --------------------------------------------------------------------------------

static enum hg_status fail_connect(const char *url, int error_number, struct hg_error *err)
{
    enum hg_status status = error_number == EACCES || error_number == EPERM ? HG_E_PERM
                            : error_number == ENOMEM                        ? HG_E_NOMEM
                                                                            : HG_E_CLOSED;
    return hg_error_set(err, status, url, NULL, "cannot connect: %s", strerror(error_number));
}

static enum hg_status dial_unix(
    struct hg_client_transport *t, const char *url, const char *path, struct hg_error *err)
{
    struct sockaddr_un sa = {.sun_family = AF_UNIX};
    if (!*path || strlen(path) >= sizeof sa.sun_path)
        return hg_error_set(
            err, HG_E_INVAL, url, NULL, "a socket path has 1 to %zu bytes", sizeof sa.sun_path - 1);
    memcpy(sa.sun_path, path, strlen(path));
    // A connect to a unix socket is made or refused at once, but a full backlog would block.
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0)
        return hg_error_set(
            err, hg_status_from_errno(errno), url, NULL, "no socket: %s", strerror(errno));
    if (connect(fd, (struct sockaddr *)&sa, sizeof sa)) {
        enum hg_status status = fail_connect(url, errno, err);
        close(fd);
        return status;
    }
    t->class = &sockets;
    t->fd = fd;
    return HG_OK;
}

static void set_tcp_options(int fd)
{
    int one = 1;
    unsigned lost_ms = 60000;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &one, sizeof one);
    setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &lost_ms, sizeof lost_ms);
}

// Begins to connect to t->address or one of its successors.
static enum hg_status dial_next(
    struct hg_client_transport *t, const char *url, int error_number, struct hg_error *err)
{
    t->connecting = false;
    for (; t->address; t->address = t->address->ai_next) {
        int fd = socket(t->address->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
        if (fd < 0) {
            error_number = errno;
            continue;
        }
        set_tcp_options(fd);
        bool made = connect(fd, t->address->ai_addr, t->address->ai_addrlen) == 0;
        if (made || errno == EINPROGRESS) {
            t->class = &sockets;
            t->fd = fd;
            t->connecting = !made;
            return HG_OK;
        }
        error_number = errno;
        close(fd);
    }
    return fail_connect(url, error_number, err);
}

static enum hg_status dial_tcp(
    struct hg_client_transport *t, const char *url, const char *address, struct hg_error *err)
{
    char host[256];
    const char *colon = strrchr(address, ':');
    size_t length = colon ? (size_t)(colon - address) : 0;
    bool bracketed = length >= 2 && address[0] == '[' && address[length - 1] == ']';
    if (!length || !colon[1] || length >= sizeof host)
        return hg_error_set(err, HG_E_INVAL, url, NULL, "expected tcp:HOST:PORT");
    snprintf(host, sizeof host, "%.*s", (int)(bracketed ? length - 2 : length),
        address + (bracketed ? 1 : 0));
    struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_ADDRCONFIG};
    int failed = getaddrinfo(host, colon + 1, &hints, &t->addresses);
    if (failed) { // AI_ADDRCONFIG hides the loopback of machines without a network
        hints.ai_flags = 0;
        failed = getaddrinfo(host, colon + 1, &hints, &t->addresses);
    }
    if (failed) {
        t->addresses = NULL;
        return hg_error_set(err, failed == EAI_SERVICE ? HG_E_INVAL : HG_E_CLOSED, url, NULL,
            "cannot find the host: %s", gai_strerror(failed));
    }
    t->address = t->addresses;
    return dial_next(t, url, ECONNREFUSED, err);
}

enum hg_status hg_client_transport_dial(
    struct hg_client_transport *t, const char *url, struct hg_error *err)
{
    static const struct {
        const char *prefix;
        enum hg_status (*dial)(
            struct hg_client_transport *t, const char *url, const char *rest, struct hg_error *err);
    } schemes[] = {
        {"unix://", dial_unix}, {"unix:", dial_unix}, {"tcp://", dial_tcp}, {"tcp:", dial_tcp}};
    for (size_t i = 0; i < sizeof schemes / sizeof *schemes; i++) {
        size_t n = strlen(schemes[i].prefix);
        if (strncmp(url, schemes[i].prefix, n) != 0)
            continue;
        enum hg_status status = schemes[i].dial(t, url, url + n, err);
        if (status)
            hg_client_transport_close(t);
        return status;
    }
    return hg_error_set(err, HG_E_INVAL, url, NULL, "expected unix:PATH or tcp:HOST:PORT");
}

enum hg_status hg_client_transport_continue(
    struct hg_client_transport *t, const char *url, struct hg_error *err)
{
    struct pollfd p = {.fd = t->fd, .events = POLLOUT};
    if (!t->connecting)
        return HG_OK;
    if (poll(&p, 1, 0) <= 0)
        return HG_E_AGAIN;
    int error_number = 0;
    socklen_t size = sizeof error_number;
    if (getsockopt(t->fd, SOL_SOCKET, SO_ERROR, &error_number, &size))
        error_number = errno;
    if (!error_number) {
        t->connecting = false;
        return HG_OK;
    }
    t->class->close(t);
    t->class = NULL;
    t->fd = -1;
    t->address = t->address->ai_next;
    enum hg_status status = dial_next(t, url, error_number, err);
    return status || !t->connecting ? status : HG_E_AGAIN;
}
