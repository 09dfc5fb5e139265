#include "server/broker/http/http_answer.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "base/alloc.h"
#include "protocol/websocket.h"
#include "server/broker/transport/address_list.h"
#include "server/broker/metrics/counters.h"

static const char plain[] = "text/plain; charset=utf-8";

// ---- heads --------------------------------------------------------------------------------------

static const char *phrase(unsigned status)
{
    static const struct {
        unsigned status;
        const char *phrase;
    } known[] = {
        {101, "Switching Protocols"},
        {200, "OK"},
        {304, "Not Modified"},
        {400, "Bad Request"},
        {403, "Forbidden"},
        {404, "Not Found"},
        {405, "Method Not Allowed"},
        {408, "Request Timeout"},
        {413, "Content Too Large"},
        {414, "URI Too Long"},
        {426, "Upgrade Required"},
        {431, "Request Header Fields Too Large"},
        {500, "Internal Server Error"},
        {503, "Service Unavailable"},
        {505, "HTTP Version Not Supported"},
    };
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (known[i].status == status)
            return known[i].phrase;
    return "";
}

static void count(unsigned status)
{
    static const enum hg_counter classes[] = {[1] = HG_COUNT_HTTP_1XX,
        [2] = HG_COUNT_HTTP_2XX,
        [3] = HG_COUNT_HTTP_3XX,
        [4] = HG_COUNT_HTTP_4XX,
        [5] = HG_COUNT_HTTP_5XX};
    hg_count(classes[status / 100]);
    if (status >= 400 && status != 404)
        hg_count(HG_COUNT_REFUSED_HTTP);
}

static HG_PRINTF(2, 3) void put(struct hg_http_answer *a, const char *fmt, ...)
{
    va_list args;
    va_start(args, fmt);
    int n = vsnprintf(a->head + a->head_size, sizeof a->head - a->head_size, fmt, args);
    va_end(args);
    if (n > 0 && (size_t)n < sizeof a->head - a->head_size)
        a->head_size += (size_t)n;
}

static void begin(struct hg_http_answer *a, unsigned status)
{
    char date[64];
    time_t now = time(NULL);
    struct tm tm;
    a->status = status;
    a->head_size = 0;
    count(status);
    put(a, "HTTP/1.1 %u %s\r\n", status, phrase(status));
    if (gmtime_r(&now, &tm) && strftime(date, sizeof date, "%a, %d %b %Y %H:%M:%S GMT", &tm))
        put(a, "Date: %s\r\n", date);
}

// The page may load from where it came, run what is in files only, and stand in no frame.
static const char strict[] =
    "X-Content-Type-Options: nosniff\r\n"
    "X-Frame-Options: DENY\r\n"
    "Referrer-Policy: no-referrer\r\n"
    "Cross-Origin-Opener-Policy: same-origin\r\n"
    "Cross-Origin-Resource-Policy: same-origin\r\n"
    "Permissions-Policy: camera=(), geolocation=(), microphone=()\r\n"
    "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self' blob: data:; font-src 'self'; connect-src 'self'; worker-src 'self'; "
    "manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n";

static void end(struct hg_http_answer *a)
{
    put(a, "%s", strict);
    put(a, "Connection: %s\r\n\r\n", a->close ? "close" : "keep-alive");
}

// `type` NULL: no body.
static void end_body(struct hg_http_answer *a, const char *type, size_t size)
{
    put(a, "Content-Length: %zu\r\n", size);
    if (type)
        put(a, "Content-Type: %s\r\n", type);
    end(a);
}

static void put_text(struct hg_http_answer *a, const char *text)
{
    put(a, "Cache-Control: no-store\r\n");
    a->body = (const uint8_t *)text;
    a->body_size = strlen(text);
    end_body(a, plain, a->body_size);
}

static void answer_text(struct hg_http_answer *a, unsigned status, const char *text)
{
    begin(a, status);
    put_text(a, text);
}

// A rule is broken: what comes next in the connection cannot be believed.
static void refuse(struct hg_http_answer *a, unsigned status, const char *text)
{
    a->close = true;
    answer_text(a, status, text);
}

// ---- paths --------------------------------------------------------------------------------------

static int digit(char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    c |= 0x20;
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

// Terminated, with escapes resolved. False: an escape is malformed, or there is a control
// character.
static bool decode_path(struct hg_http_text path, char out[HG_HTTP_TARGET_BYTES + 1])
{
    size_t n = 0;
    for (size_t i = 0; i < path.size; i++) {
        int c = (unsigned char)path.data[i];
        if (c == '%') {
            const int high = i + 2 < path.size ? digit(path.data[i + 1]) : -1;
            const int low = i + 2 < path.size ? digit(path.data[i + 2]) : -1;
            if (high < 0 || low < 0)
                return false;
            c = high << 4 | low;
            i += 2;
        }
        if (c < ' ' || c == 0x7f)
            return false;
        out[n++] = (char)c;
    }
    out[n] = 0;
    return true;
}

// A path that wants to leave the folder; browsers resolve such before they ask.
static bool climbs(const char *path)
{
    if (strchr(path, '\\'))
        return true;
    for (const char *at = path; (at = strstr(at, "..")); at += 2)
        if ((at == path || at[-1] == '/') && (!at[2] || at[2] == '/'))
            return true;
    return false;
}

// ---- files --------------------------------------------------------------------------------------

static void answer_file(const struct hg_web *web, const struct hg_http_head *request,
    const char *path, struct hg_http_answer *a)
{
    const struct hg_web_file *file = hg_web_files_find(&web->files, path), *gzip = NULL;
    if (!file) {
        answer_text(
            a, 404, web->files.count ? "not found\n" : "not found: the viewer is not installed\n");
        return;
    }
    const char *type = file->type;
    if (hg_http_lists(request, "Accept-Encoding", "gzip"))
        gzip = hg_web_files_find_gzip(&web->files, file);
    if (gzip)
        file = gzip;
    const bool known = hg_http_lists(request, "If-None-Match", file->etag) ||
                       hg_http_lists(request, "If-None-Match", "*");
    begin(a, known ? 304 : 200);
    put(a, "ETag: %s\r\nCache-Control: no-cache\r\nVary: Accept-Encoding\r\n", file->etag);
    if (known) {
        end(a);
        return;
    }
    if (gzip)
        put(a, "Content-Encoding: gzip\r\n");
    a->body = file->data;
    a->body_size = file->size;
    end_body(a, type, file->size);
}

// ---- what the daemon says of itself -------------------------------------------------------------

static void answer_ready(const struct hg_web *web, struct hg_http_answer *a)
{
    const char *why = web->unready(web->user);
    begin(a, why ? 503 : 200);
    if (why)
        put(a, "Retry-After: 5\r\n");
    put_text(a, why ? why : "ready\n");
}

static bool may_read_metrics(const struct hg_web *web, const struct hg_peer *peer)
{
    static char loopback[] = "loopback";
    static char *items[] = {loopback};
    static const struct hg_text_list usual = {items, 1, 1};
    const struct hg_text_list *given = &web->options->metrics_from;
    return peer->is_local || hg_address_list_has(given->count ? given : &usual, peer->name);
}

static void answer_metrics(
    const struct hg_web *web, const struct hg_peer *peer, struct hg_http_answer *a)
{
    struct hg_writer w = {0};
    if (!may_read_metrics(web, peer)) {
        answer_text(a, 403, "not for this address (metrics-from)\n");
        return;
    }
    web->metrics(web->user, &w);
    if (w.failed) {
        hg_writer_finish(&w);
        answer_text(a, 503, "no memory\n");
        return;
    }
    begin(a, 200);
    put(a, "Cache-Control: no-store\r\n");
    a->body = a->owned = w.data;
    a->body_size = w.size;
    end_body(a, "text/plain; version=0.0.4; charset=utf-8", w.size);
}

// ---- the way to a WebSocket ---------------------------------------------------------------------

// The authority of "SCHEME://AUTHORITY"; empty where the scheme is not one of the daemon's own
// pages. A stream of TLS has https alone: pages of http may be anyone's who is on the way. In the
// clear https passes as well: a proxy in front may have ended TLS, which nothing here says.
static struct hg_http_text own_authority(const struct hg_peer *peer, struct hg_http_text origin)
{
    static const char *const schemes[] = {"https://", "http://"};
    for (size_t i = 0; i < (peer->is_encrypted ? 1 : 2); i++) {
        const size_t size = strlen(schemes[i]);
        if (origin.size > size && memcmp(origin.data, schemes[i], size) == 0)
            return (struct hg_http_text){origin.data + size, origin.size - size};
    }
    return (struct hg_http_text){0};
}

// Pages of other origins may connect where an option says so. Programs that are no browsers name
// no origin. What a page may do once it is connected depends on the token that it knows.
static bool is_origin_allowed(
    const struct hg_web *web, const struct hg_peer *peer, const struct hg_http_head *request)
{
    struct hg_http_text origin, host;
    const size_t origins = hg_http_find(request, "Origin", &origin);
    hg_http_find(request, "Host", &host);
    if (!origins)
        return true;
    for (size_t i = 0; i < web->options->allowed_origins.count; i++)
        if (hg_http_is_caseless(origin, web->options->allowed_origins.items[i]))
            return origins == 1;
    const struct hg_http_text authority = own_authority(peer, origin);
    return origins == 1 && authority.size && authority.size == host.size &&
           memcmp(authority.data, host.data, host.size) == 0;
}

// What is wrong with a request for a WebSocket; NULL: nothing.
static const char *check_upgrade(const struct hg_http_head *request, struct hg_http_text *key)
{
    if (!hg_http_is(request->method, "GET") || request->minor < 1)
        return "a WebSocket begins with GET and HTTP/1.1\n";
    if (hg_http_find(request, "Sec-WebSocket-Key", key) != 1 ||
        !hg_ws_key_is_valid(key->data, key->size))
        return "Sec-WebSocket-Key is not 16 bytes in base64\n";
    if (!hg_http_lists(request, "Sec-WebSocket-Protocol", HG_WEB_SUBPROTOCOL))
        return "expected the subprotocol " HG_WEB_SUBPROTOCOL "\n";
    return NULL;
}

static void answer_upgrade(const struct hg_web *web, const struct hg_peer *peer,
    const struct hg_http_head *request, struct hg_http_answer *a)
{
    struct hg_http_text version, key;
    char accept[HG_WS_ACCEPT_CHARS + 1];
    hg_http_find(request, "Sec-WebSocket-Version", &version);
    if (!hg_http_lists(request, "Upgrade", "websocket") ||
        !hg_http_lists(request, "Connection", "upgrade") || !hg_http_is(version, "13")) {
        a->close = true;
        begin(a, 426);
        put(a, "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n");
        put_text(a, "this is the place of a WebSocket of version 13\n");
        return;
    }
    if (!is_origin_allowed(web, peer, request)) {
        hg_count(HG_COUNT_REFUSED_ORIGIN);
        refuse(a, 403, "pages of this origin may not connect (allowed-origins)\n");
        return;
    }
    const char *wrong = check_upgrade(request, &key);
    if (wrong || hg_ws_accept(key.data, accept)) {
        refuse(a, wrong ? 400 : 500, wrong ? wrong : "no SHA-1\n");
        return;
    }
    begin(a, 101);
    put(a, "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: %s\r\n", accept);
    put(a, "Sec-WebSocket-Protocol: " HG_WEB_SUBPROTOCOL "\r\n\r\n");
    a->upgrade = true;
    a->close = false;
}

// ---- requests -----------------------------------------------------------------------------------

// As it was sent, without escapes: rules of proxies see that, and would be passed by /%6detrics.
static bool is_path(const struct hg_http_head *request, const char *path)
{
    return request->path.size == strlen(path) &&
           memcmp(request->path.data, path, request->path.size) == 0;
}

static void answer_path(const struct hg_web *web, const struct hg_peer *peer,
    const struct hg_http_head *request, struct hg_http_answer *a)
{
    char path[HG_HTTP_TARGET_BYTES + 1];
    if (!decode_path(request->path, path) || climbs(path)) {
        hg_count(HG_COUNT_REFUSED_PATH);
        refuse(a, 400, "the path is malformed\n");
    } else if (is_path(request, "/hgp")) {
        answer_upgrade(web, peer, request, a);
    } else if (is_path(request, "/healthz")) {
        answer_text(a, 200, "ok\n");
    } else if (is_path(request, "/readyz")) {
        answer_ready(web, a);
    } else if (is_path(request, "/metrics")) {
        answer_metrics(web, peer, a);
    } else {
        answer_file(web, request, path, a);
    }
}

static bool has_body(const struct hg_http_head *request)
{
    struct hg_http_text value;
    uint64_t length = 0;
    if (hg_http_find(request, "Transfer-Encoding", &value))
        return true;
    return hg_http_find(request, "Content-Length", &value) &&
           !(hg_http_number(value, UINT64_MAX, &length) && length == 0);
}

void hg_http_answer(const struct hg_web *web, const struct hg_peer *peer,
    const struct hg_http_head *request, enum hg_status parsed, bool last,
    struct hg_http_answer *out)
{
    *out = (struct hg_http_answer){.close = true};
    if (parsed) {
        answer_text(out, request->status, request->reason);
        return;
    }
    const bool keep = hg_http_lists(request, "Connection", "keep-alive");
    const bool is_head = hg_http_is(request->method, "HEAD");
    out->close =
        last || (request->minor < 1 && !keep) || hg_http_lists(request, "Connection", "close");
    if (!is_head && !hg_http_is(request->method, "GET")) {
        out->close = true;
        begin(out, 405);
        put(out, "Allow: GET, HEAD\r\n");
        put_text(out, "GET and HEAD are served\n");
    } else if (has_body(request)) {
        refuse(out, 413, "requests with a body are not taken\n");
    } else {
        answer_path(web, peer, request, out);
    }
    if (is_head)
        out->body_size = 0;
}

void hg_http_answer_refusal(const char *reason, struct hg_http_answer *out)
{
    *out = (struct hg_http_answer){.close = true};
    begin(out, reason ? 503 : 408);
    if (reason)
        put(out, "Retry-After: 5\r\n");
    put_text(out, reason ? reason : "the request did not come in time (handshake-timeout)\n");
}

void hg_http_answer_finish(struct hg_http_answer *answer)
{
    struct hg_writer owner = {.data = answer->owned};
    hg_writer_finish(&owner);
    answer->owned = NULL;
}
