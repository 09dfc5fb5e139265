#include "server/broker/connection/listener.h"

#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"

enum { BACKLOG = 1024 }; // a crowd that comes back at once, after a restart say

static enum hg_status fail_errno(struct hg_error *err, const char *address, const char *action)
{
    int e = errno;
    enum hg_status status = e == EADDRINUSE ? HG_E_EXISTS : hg_status_from_errno(e);
    return hg_error_set(err, status, address, NULL, "cannot %s: %s", action, strerror(e));
}

static enum hg_status add(struct hg_listener **list, int fd, struct hg_listener **out)
{
    *out = hg_calloc(1, sizeof **out);
    if (!*out)
        return HG_E_NOMEM;
    (*out)->source = (struct hg_source){.fd = fd, .events = EPOLLIN};
    (*out)->next = *list;
    *list = *out;
    return HG_OK;
}

// ---- addresses ----------------------------------------------------------------------------------

// Splits "HOST:PORT"; brackets around an IPv6 address are removed, * becomes empty.
static bool split_host(const char *text, char *host, size_t host_size, char *port, size_t port_size)
{
    const char *colon = strrchr(text, ':');
    if (!colon || colon == text || !colon[1] || strlen(colon + 1) >= port_size ||
        strspn(colon + 1, "0123456789") != strlen(colon + 1))
        return false;
    size_t length = (size_t)(colon - text);
    if (text[0] == '[' && text[length - 1] == ']') {
        text++;
        length -= 2;
    } else if (memchr(text, ':', length)) {
        return false; // an IPv6 address needs its brackets
    }
    if (length >= host_size)
        return false;
    snprintf(host, host_size, "%.*s", (int)length, text);
    if (strcmp(host, "*") == 0)
        host[0] = 0;
    snprintf(port, port_size, "%s", colon + 1);
    return strtoul(port, NULL, 10) <= 65535;
}

enum hg_status hg_listener_check(
    const char *address, bool *is_tcp, bool *is_tls, struct hg_error *err)
{
    char host[256], port[8];
    struct sockaddr_un sun;
    *is_tls = strncmp(address, "tls:", 4) == 0;
    *is_tcp = *is_tls || strncmp(address, "tcp:", 4) == 0;
    if (*is_tcp && split_host(address + 4, host, sizeof host, port, sizeof port))
        return HG_OK;
    if (strncmp(address, "unix:", 5) == 0 && address[5] &&
        strlen(address + 5) < sizeof sun.sun_path)
        return HG_OK;
    return hg_error_set(err, HG_E_INVAL, address, NULL,
        "expected unix:PATH (at most %zu bytes), tcp:HOST:PORT or tls:HOST:PORT",
        sizeof sun.sun_path - 1);
}

// ---- unix ---------------------------------------------------------------------------------------

// Removes a socket file left by a dead process.
static enum hg_status clear_stale(
    const char *address, const struct sockaddr_un *sun, struct hg_error *err)
{
    struct stat st;
    if (lstat(sun->sun_path, &st) != 0)
        return errno == ENOENT ? HG_OK : fail_errno(err, address, "look at the file");
    if (!S_ISSOCK(st.st_mode))
        return hg_error_set(err, HG_E_EXISTS, address, NULL, "a file that is no socket is there");
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0)
        return fail_errno(err, address, "make a socket");
    bool dead =
        connect(fd, (const struct sockaddr *)sun, sizeof *sun) != 0 && errno == ECONNREFUSED;
    close(fd);
    if (!dead)
        return hg_error_set(err, HG_E_EXISTS, address, NULL, "another process serves this socket");
    return unlink(sun->sun_path) == 0 ? HG_OK : fail_errno(err, address, "remove the old socket");
}

static enum hg_status open_unix(
    const char *address, struct hg_listener **list, struct hg_error *err)
{
    struct sockaddr_un sun = {.sun_family = AF_UNIX};
    snprintf(sun.sun_path, sizeof sun.sun_path, "%s", address + 5);
    enum hg_status status = clear_stale(address, &sun, err);
    if (status)
        return status;
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0)
        return fail_errno(err, address, "make a socket");
    struct hg_listener *listener = NULL;
    if (bind(fd, (const struct sockaddr *)&sun, sizeof sun) != 0)
        status = fail_errno(err, address, "bind");
    else if (listen(fd, BACKLOG) != 0)
        status = fail_errno(err, address, "listen");
    else
        status = add(list, fd, &listener);
    if (status) {
        close(fd);
        return status;
    }
    listener->transport = &hg_transport_unix;
    listener->unix_path = hg_strdup(sun.sun_path);
    snprintf(listener->name, sizeof listener->name, "%s", address);
    return HG_OK;
}

// ---- tcp ----------------------------------------------------------------------------------------

static void name_tcp(struct hg_listener *listener)
{
    struct sockaddr_storage bound;
    socklen_t size = sizeof bound;
    char host[64] = "?", port[8] = "?";
    if (getsockname(listener->source.fd, (struct sockaddr *)&bound, &size) == 0)
        getnameinfo((struct sockaddr *)&bound, size, host, sizeof host, port, sizeof port,
            NI_NUMERICHOST | NI_NUMERICSERV);
    bool v6 = bound.ss_family == AF_INET6;
    listener->transport = &hg_transport_tcp;
    listener->port = (uint16_t)strtoul(port, NULL, 10);
    snprintf(listener->name, sizeof listener->name, v6 ? "tcp:[%s]:%s" : "tcp:%s:%s", host, port);
}

static enum hg_status open_one(const char *address, const struct addrinfo *info, uint16_t port,
    struct hg_listener **list, struct hg_error *err)
{
    int on = 1;
    int fd = socket(info->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0)
        return fail_errno(err, address, "make a socket");
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (info->ai_family == AF_INET6)
        setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &on, sizeof on);
    struct sockaddr_storage name = {0};
    memcpy(&name, info->ai_addr, info->ai_addrlen);
    // Both families of one address share the port that the system chose for the first.
    if (info->ai_family == AF_INET6)
        ((struct sockaddr_in6 *)&name)->sin6_port = htons(port);
    else
        ((struct sockaddr_in *)&name)->sin_port = htons(port);
    struct hg_listener *listener = NULL;
    enum hg_status status = HG_OK;
    if (bind(fd, (struct sockaddr *)&name, info->ai_addrlen) != 0)
        status = fail_errno(err, address, "bind");
    else if (listen(fd, BACKLOG) != 0)
        status = fail_errno(err, address, "listen");
    else
        status = add(list, fd, &listener);
    if (status)
        close(fd);
    else
        name_tcp(listener);
    return status;
}

static void close_until(struct hg_listener **list, struct hg_listener *end)
{
    while (*list != end) {
        struct hg_listener *listener = *list;
        *list = listener->next;
        close(listener->source.fd);
        hg_free(listener);
    }
}

static enum hg_status open_tcp(const char *address, struct hg_listener **list, struct hg_error *err)
{
    char host[256], port[8];
    struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_PASSIVE}, *found = NULL;
    split_host(address + 4, host, sizeof host, port, sizeof port);
    int rc = getaddrinfo(host[0] ? host : NULL, port, &hints, &found);
    if (rc)
        return hg_error_set(err, HG_E_NOTFOUND, address, NULL, "%s", gai_strerror(rc));
    struct hg_listener *before = *list;
    uint16_t chosen = (uint16_t)strtoul(port, NULL, 10);
    enum hg_status status = HG_E_NOTFOUND;
    for (struct addrinfo *info = found; info; info = info->ai_next) {
        enum hg_status one = open_one(address, info, chosen, list, err);
        // A machine without IPv6 (or IPv4) still serves the other.
        bool missing = one && *list == before && info->ai_next;
        bool second = one && *list != before && errno == EAFNOSUPPORT;
        if (one && !missing && !second) {
            close_until(list, before);
            status = one;
            break;
        }
        if (!one) {
            chosen = (*list)->port;
            status = HG_OK;
        }
    }
    freeaddrinfo(found);
    return status;
}

enum hg_status hg_listener_open(
    const char *address, struct hg_listener **list, struct hg_error *err)
{
    bool is_tcp, is_tls;
    const struct hg_listener *before = *list;
    enum hg_status status = hg_listener_check(address, &is_tcp, &is_tls, err);
    if (!status)
        status = is_tcp ? open_tcp(address, list, err) : open_unix(address, list, err);
    for (struct hg_listener *it = *list; !status && is_tls && it != before; it = it->next)
        hg_listener_set_tls(it);
    return status;
}

enum hg_status hg_listener_adopt(int fd, struct hg_listener **list, struct hg_error *err)
{
    struct sockaddr_storage name = {0};
    socklen_t size = sizeof name;
    int listening = 0;
    socklen_t listening_size = sizeof listening;
    if (getsockname(fd, (struct sockaddr *)&name, &size) != 0 ||
        getsockopt(fd, SOL_SOCKET, SO_ACCEPTCONN, &listening, &listening_size) != 0 || !listening)
        return hg_error_set(
            err, HG_E_INVAL, "LISTEN_FDS", NULL, "descriptor %d is no listening socket", fd);
    struct hg_listener *listener;
    if (add(list, fd, &listener))
        return hg_error_set(err, HG_E_NOMEM, "LISTEN_FDS", NULL, "no memory");
    if (name.ss_family != AF_UNIX) {
        name_tcp(listener);
        return HG_OK;
    }
    listener->transport = &hg_transport_unix;
    snprintf(listener->name, sizeof listener->name, "unix:%.*s",
        (int)(size - offsetof(struct sockaddr_un, sun_path)),
        ((struct sockaddr_un *)&name)->sun_path);
    return HG_OK;
}

void hg_listener_set_tls(struct hg_listener *listener)
{
    listener->tls = true;
    memcpy(listener->name, "tls", 3); // in place of tcp
}

enum hg_status hg_listener_adopt_passed(
    int fd, bool tls, struct hg_listener **list, struct hg_error *err)
{
    const enum hg_status status = hg_listener_adopt(fd, list, err);
    if (status || !tls)
        return status;
    if (!(*list)->port) // whoever named it so wants no session on it in clear text
        return hg_error_set(err, HG_E_INVAL, (*list)->name, NULL,
            "is named tls by the service manager, and is no socket of tcp");
    hg_listener_set_tls(*list);
    return HG_OK;
}

enum hg_status hg_listener_own(struct hg_listener *listener, const char *path)
{
    listener->unix_path = hg_strdup(path);
    return listener->unix_path ? HG_OK : HG_E_NOMEM;
}

enum hg_status hg_listener_accept(
    struct hg_listener *listener, struct hg_transport *out, struct hg_error *err)
{
    *out = (struct hg_transport){.fd = -1};
    int fd = accept4(listener->source.fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd >= 0) {
        hg_transport_open(out, listener->transport, fd);
        return HG_OK;
    }
    if (errno != EMFILE && errno != ENFILE && errno != ENOMEM && errno != ENOBUFS)
        return HG_E_AGAIN;
    return hg_error_set(
        err, HG_E_LIMIT, listener->name, NULL, "cannot accept: %s", strerror(errno));
}

void hg_listeners_destroy(struct hg_loop *loop, struct hg_listener **list)
{
    while (*list) {
        struct hg_listener *listener = *list;
        *list = listener->next;
        hg_loop_close(loop, &listener->source);
        if (listener->unix_path)
            unlink(listener->unix_path);
        hg_free(listener->unix_path);
        hg_free(listener);
    }
}
