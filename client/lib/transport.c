#include "client/lib/transport.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

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

const struct hg_client_transport_class hg_client_sockets = {
    .read = socket_read, .write = socket_write, .wants = socket_wants, .close = socket_close};

enum hg_status hg_client_transport_adopt(struct hg_client_transport *t, int fd)
{
    int flags = fcntl(fd, F_GETFL);
    *t = (struct hg_client_transport){.class = &hg_client_sockets, .fd = fd};
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
