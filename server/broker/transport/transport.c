#include "server/broker/transport/transport.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

// ---- sockets ------------------------------------------------------------------------------------

static enum hg_status socket_read(struct hg_transport *t, void *dst, size_t size, size_t *got)
{
    ssize_t n;
    *got = 0;
    do
        n = recv(t->fd, dst, size, MSG_DONTWAIT);
    while (n < 0 && errno == EINTR);
    if (n > 0)
        *got = (size_t)n;
    if (n == 0 || (n < 0 && errno == ECONNRESET))
        return HG_E_CLOSED;
    if (n < 0)
        return errno == EAGAIN || errno == EWOULDBLOCK ? HG_E_AGAIN : HG_E_IO;
    return HG_OK;
}

static enum hg_status socket_write(
    struct hg_transport *t, const struct iovec *parts, int count, size_t *sent)
{
    struct msghdr message = {.msg_iov = (struct iovec *)parts, .msg_iovlen = (size_t)count};
    ssize_t n;
    *sent = 0;
    do
        n = sendmsg(t->fd, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
    while (n < 0 && errno == EINTR);
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK))
        return HG_E_AGAIN;
    if (n < 0)
        return errno == EPIPE || errno == ECONNRESET ? HG_E_CLOSED : HG_E_IO;
    *sent = (size_t)n;
    return HG_OK;
}

static uint32_t socket_wants(const struct hg_transport *t, bool read, bool write)
{
    (void)t;
    return (read ? (uint32_t)EPOLLIN : 0u) | (write ? (uint32_t)EPOLLOUT : 0u);
}

static void socket_end_writing(struct hg_transport *t)
{
    shutdown(t->fd, SHUT_WR);
}

static void socket_close(struct hg_transport *t)
{
    close(t->fd);
}

// ---- peers --------------------------------------------------------------------------------------

static void greet_unix(struct hg_transport *t, uint64_t peer_timeout_ns, struct hg_peer *peer)
{
    struct ucred credentials = {0};
    socklen_t size = sizeof credentials;
    (void)peer_timeout_ns;
    *peer = (struct hg_peer){.name = "unix", .is_local = true};
    if (getsockopt(t->fd, SOL_SOCKET, SO_PEERCRED, &credentials, &size) == 0) {
        peer->same_user = credentials.uid == geteuid();
        snprintf(peer->name, sizeof peer->name, "uid:%u", credentials.uid);
    }
    memcpy(peer->source, peer->name, sizeof peer->source);
}

// The first `bits` of an address, with zeroes behind them.
static void name_block(const uint8_t *address, int family, unsigned bits, char *out, size_t size)
{
    uint8_t block[16] = {0};
    char text[INET6_ADDRSTRLEN] = "?";
    memcpy(block, address, bits / 8);
    inet_ntop(family, block, text, sizeof text);
    snprintf(out, size, "%s/%u", text, bits);
}

static void name_source(const struct sockaddr_storage *address, struct hg_peer *peer)
{
    static const uint8_t mapped[12] = {[10] = 0xff, [11] = 0xff}; // ::ffff:a.b.c.d
    const uint8_t *v4 = (const uint8_t *)&((const struct sockaddr_in *)address)->sin_addr;
    const uint8_t *v6 = (const uint8_t *)&((const struct sockaddr_in6 *)address)->sin6_addr;
    bool is_v6 = address->ss_family == AF_INET6;
    if (is_v6 && memcmp(v6, mapped, sizeof mapped) == 0) {
        v4 = v6 + sizeof mapped;
        is_v6 = false;
    }
    if (is_v6) {
        name_block(v6, AF_INET6, 64, peer->source, sizeof peer->source);
        name_block(v6, AF_INET6, 48, peer->network, sizeof peer->network);
    } else {
        name_block(v4, AF_INET, 32, peer->source, sizeof peer->source);
        name_block(v4, AF_INET, 24, peer->network, sizeof peer->network);
    }
}

void hg_peer_name(struct hg_peer *peer, const struct sockaddr_storage *address)
{
    socklen_t size =
        address->ss_family == AF_INET6 ? sizeof(struct sockaddr_in6) : sizeof(struct sockaddr_in);
    *peer = (struct hg_peer){0};
    if (getnameinfo((const struct sockaddr *)address, size, peer->name, sizeof peer->name, NULL, 0,
            NI_NUMERICHOST))
        snprintf(peer->name, sizeof peer->name, "tcp");
    name_source(address, peer);
}

static void greet_tcp(struct hg_transport *t, uint64_t peer_timeout_ns, struct hg_peer *peer)
{
    int on = 1;
    unsigned timeout_ms = (unsigned)(peer_timeout_ns / 1000000);
    struct sockaddr_storage address = {0};
    socklen_t size = sizeof address;
    setsockopt(t->fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    setsockopt(t->fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
    setsockopt(t->fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &timeout_ms, sizeof timeout_ms);
    if (getpeername(t->fd, (struct sockaddr *)&address, &size))
        address.ss_family = AF_UNSPEC;
    hg_peer_name(peer, &address);
}

const struct hg_transport_class hg_transport_unix = {
    .read = socket_read,
    .write = socket_write,
    .wants = socket_wants,
    .end_writing = socket_end_writing,
    .greet = greet_unix,
    .close = socket_close,
};

const struct hg_transport_class hg_transport_tcp = {
    .read = socket_read,
    .write = socket_write,
    .wants = socket_wants,
    .end_writing = socket_end_writing,
    .greet = greet_tcp,
    .close = socket_close,
};

// ---- life ---------------------------------------------------------------------------------------

void hg_transport_open(struct hg_transport *t, const struct hg_transport_class *class, int fd)
{
    *t = (struct hg_transport){.class = class, .fd = fd};
    fcntl(fd, F_SETFL, O_NONBLOCK | fcntl(fd, F_GETFL));
}

void hg_transport_close(struct hg_transport *t)
{
    if (t->class)
        t->class->close(t);
    *t = (struct hg_transport){.fd = -1};
}

enum hg_status hg_transport_flush(struct hg_transport *t)
{
    return t->class->flush ? t->class->flush(t) : HG_OK;
}

bool hg_transport_has_input(const struct hg_transport *t)
{
    return t->class && t->class->has_input && t->class->has_input(t);
}

bool hg_transport_refuse(struct hg_transport *t, const char *reason)
{
    return t->class->refuse && t->class->refuse(t, reason);
}

void hg_transport_become(
    struct hg_transport *t, const struct hg_transport_class *class, void *state)
{
    t->class = class;
    t->state = state;
}

enum hg_status hg_transport_discard(struct hg_transport *t, enum hg_status otherwise)
{
    uint8_t sink[4096];
    size_t got;
    enum hg_status status = t->class->read(t, sink, sizeof sink, &got);
    return status == HG_E_CLOSED || status == HG_E_IO ? status : otherwise;
}
