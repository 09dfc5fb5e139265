#include "client/lib/dial.h"

#include <errno.h>
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
#include "client/lib/lookup.h"
#include "client/lib/tls.h"
#include "client/lib/websocket.h"

static enum hg_status fail_connect(const char *url, int error_number, struct hg_error *err)
{
    enum hg_status status = error_number == EACCES || error_number == EPERM ? HG_E_PERM
                            : error_number == ENOMEM                        ? HG_E_NOMEM
                                                                            : HG_E_CLOSED;
    return hg_error_set(err, status, url, NULL, "cannot connect: %s", strerror(error_number));
}

struct address {
    char authority[256], host[256], port[8], path[HG_CLIENT_URL_BYTES];
    bool secure, websocket;
};

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
    t->class = &hg_client_sockets;
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
            t->class = &hg_client_sockets;
            t->fd = fd;
            t->connecting = !made;
            return HG_OK;
        }
        error_number = errno;
        close(fd);
    }
    return fail_connect(url, error_number, err);
}

// Of "HOST[:PORT][/PATH][?QUERY]": host without brackets, port (or `usual`), path with query.
// False: it is none.
static bool split_url(const char *rest, const char *usual, struct address *out)
{
    const size_t length = strcspn(rest, "/?");
    const char *path = rest + length;
    if (!length || length >= sizeof out->authority)
        return false;
    snprintf(out->authority, sizeof out->authority, "%.*s", (int)length, rest);
    path += *path == '/' && (!path[1] || path[1] == '?');
    if (snprintf(out->path, sizeof out->path, "%s%s", *path == '/' ? "" : "/hgp", path) >=
        (int)sizeof out->path)
        return false;
    char *colon = strrchr(out->authority, ':'), *end = strchr(out->authority, ']');
    const bool bracketed = out->authority[0] == '[' && end;
    if (colon && bracketed && colon < end)
        colon = NULL;
    snprintf(out->port, sizeof out->port, "%s", colon ? colon + 1 : usual);
    const size_t name = colon ? (size_t)(colon - out->authority) : length;
    if (bracketed ? end != out->authority + name - 1 : !name)
        return false;
    snprintf(out->host, sizeof out->host, "%.*s", (int)(bracketed ? name - 2 : name),
        out->authority + (bracketed ? 1 : 0));
    return out->host[0] && out->port[0];
}

static bool names_scene(const char *path)
{
    for (const char *p = strchr(path, '?'); p; p = strchr(p + 1, '&'))
        if (strncmp(p + 1, "scene=", 6) == 0)
            return true;
    return false;
}

// As browsers write a form's field (URLSearchParams): load balancers compare the text, so a scene
// has one spelling.
static void write_encoded(char *to, const char *text)
{
    static const char kept[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789*-._";
    for (; *text; text++)
        if (*text == ' ')
            *to++ = '+';
        else if (strchr(kept, *text))
            *to++ = *text;
        else
            to += sprintf(to, "%%%02X", (unsigned char)*text);
    *to = 0;
}

static bool parse_url(const char *url, struct address *out)
{
    static const struct {
        const char *prefix, *usual_port;
        bool secure, websocket;
    } schemes[] = {{"tcp://", "", false, false}, {"tcp:", "", false, false},
        {"tls://", "", true, false}, {"tls:", "", true, false}, {"ws://", "80", false, true},
        {"wss://", "443", true, true}};
    for (size_t i = 0; i < sizeof schemes / sizeof *schemes; i++) {
        const size_t n = strlen(schemes[i].prefix);
        if (strncmp(url, schemes[i].prefix, n) != 0)
            continue;
        out->secure = schemes[i].secure;
        out->websocket = schemes[i].websocket;
        return split_url(url + n, schemes[i].usual_port, out);
    }
    return false;
}

static enum hg_status fail_lookup(const char *url, int failed, struct hg_error *err)
{
    return hg_error_set(err, failed == EAI_SERVICE ? HG_E_INVAL : HG_E_CLOSED, url, NULL,
        "cannot find the host: %s", gai_strerror(failed));
}

// Begins to connect to the first of t->addresses.
static enum hg_status dial_first(
    struct hg_client_transport *t, const char *url, struct hg_error *err)
{
    t->address = t->addresses;
    enum hg_status status = dial_next(t, url, ECONNREFUSED, err);
    t->connecting |= !status && (t->secure || t->websocket); // layers come with _continue
    return status;
}

static enum hg_status dial_tcp(
    struct hg_client_transport *t, const char *url, const struct address *to, struct hg_error *err)
{
    const int failed = hg_client_lookup_now(to->host, to->port, AI_NUMERICHOST, &t->addresses);
    t->secure = to->secure;
    t->websocket = to->websocket;
    if (!failed)
        return dial_first(t, url, err);
    if (failed != EAI_NONAME)
        return fail_lookup(url, failed, err);
    enum hg_status status = hg_client_lookup_begin(t, to->host, to->port);
    if (status)
        return hg_error_set(err, status, url, NULL, "cannot look up the host");
    t->connecting = true;
    return HG_OK;
}

enum hg_status hg_client_dial(struct hg_client_transport *t, const char *url, struct hg_error *err)
{
    struct address to;
    enum hg_status status;
    if (strlen(url) >= HG_CLIENT_URL_BYTES)
        return hg_error_set(
            err, HG_E_INVAL, url, NULL, "a URL has at most %u bytes", HG_CLIENT_URL_BYTES - 1);
    if (strncmp(url, "unix:", 5) == 0)
        status = dial_unix(t, url, url + (strncmp(url, "unix://", 7) == 0 ? 7 : 5), err);
    else if (parse_url(url, &to))
        status = dial_tcp(t, url, &to, err);
    else
        return hg_error_set(err, HG_E_INVAL, url, NULL,
            "expected unix:PATH, tcp:HOST:PORT, tls:HOST:PORT, ws://HOST[:PORT][/PATH] or wss://");
    if (status)
        hg_client_transport_close(t);
    return status;
}

static enum hg_status begin_websocket(struct hg_client_transport *t, const struct address *to,
    const char *url, const char *scene, struct hg_error *err)
{
    char name[3 * HG_CLIENT_SCENE_BYTES + 1], target[sizeof to->path + sizeof name + 8];
    const bool added = scene[0] && !names_scene(to->path);
    write_encoded(name, scene);
    snprintf(target, sizeof target, "%s%s%s", to->path,
        !added                  ? ""
        : strchr(to->path, '?') ? "&scene="
                                : "?scene=",
        added ? name : "");
    return hg_client_websocket_begin(t, to->authority, target, url, err);
}

// Puts the next layer on a stream that is connected. HG_E_AGAIN: its handshake begins; HG_OK: there
// is none.
static enum hg_status add_layer(struct hg_client_transport *t, const char *url,
    const struct hg_client_tls_options *tls, const char *scene, struct hg_error *err)
{
    struct address to;
    enum hg_status status;
    const bool has_layers = parse_url(url, &to); // unix sockets have none
    if (has_layers && t->secure) {
        t->secure = false;
        status = hg_client_tls_begin(t, tls, to.host, url, err);
    } else if (has_layers && t->websocket) {
        t->websocket = false;
        status = begin_websocket(t, &to, url, scene, err);
    } else {
        t->connecting = false;
        return HG_OK;
    }
    return status ? status : HG_E_AGAIN;
}

// Until a handshake waits for the peer, or all layers are there.
static enum hg_status add_layers(struct hg_client_transport *t, const char *url,
    const struct hg_client_tls_options *tls, const char *scene, struct hg_error *err)
{
    for (;;) {
        enum hg_status status = t->handshaking ? t->class->handshake(t, url, err) : HG_OK;
        if (status)
            return status;
        t->handshaking = false;
        status = add_layer(t, url, tls, scene, err);
        if (status != HG_E_AGAIN)
            return status;
    }
}

// Of the socket itself.
static enum hg_status continue_socket(
    struct hg_client_transport *t, const char *url, struct hg_error *err)
{
    struct pollfd p = {.fd = t->fd, .events = POLLOUT};
    if (poll(&p, 1, 0) <= 0)
        return HG_E_AGAIN;
    int error_number = 0;
    socklen_t size = sizeof error_number;
    if (getsockopt(t->fd, SOL_SOCKET, SO_ERROR, &error_number, &size))
        error_number = errno;
    if (!error_number)
        return HG_OK;
    t->class->close(t);
    t->class = NULL;
    t->fd = -1;
    t->address = t->address->ai_next;
    enum hg_status status = dial_next(t, url, error_number, err);
    if (!status && !t->connecting) { // at once
        t->connecting = t->secure || t->websocket;
        return HG_OK;
    }
    return status ? status : HG_E_AGAIN;
}

static enum hg_status continue_lookup(
    struct hg_client_transport *t, const char *url, struct hg_error *err)
{
    int failed;
    enum hg_status status = hg_client_lookup_take(t, &failed);
    if (status)
        return status;
    status = failed ? fail_lookup(url, failed, err) : dial_first(t, url, err);
    return status ? status : HG_E_AGAIN; // it is connected when the socket says so
}

enum hg_status hg_client_dial_continue(struct hg_client_transport *t, const char *url,
    const struct hg_client_tls_options *tls, const char *scene, struct hg_error *err)
{
    if (!t->connecting)
        return HG_OK;
    enum hg_status status = hg_client_lookup_goes_on(t)      ? continue_lookup(t, url, err)
                            : t->class == &hg_client_sockets ? continue_socket(t, url, err)
                                                             : HG_OK;
    return status ? status : add_layers(t, url, tls, scene, err);
}
