#include "tests/support/shaper.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"

enum { PAIRS = 8, PIECE_BYTES = 1400, QUEUE_BYTES = 256 << 10, SOCKET_BYTES = 16 << 10 };
#define NO_LIMIT 1e12

// ---- token bucket -------------------------------------------------------------------------------

static double tokens_at(const struct shaper_bucket *b, uint64_t now_ns)
{
    const double tokens = b->tokens + b->rate * (double)(now_ns - b->since_ns) * 1e-9;
    return tokens < b->burst ? tokens : b->burst;
}

void shaper_bucket_init(struct shaper_bucket *b, double rate, double burst, uint64_t now_ns)
{
    *b = (struct shaper_bucket){rate, burst, burst, now_ns};
}

void shaper_bucket_set_rate(struct shaper_bucket *b, double rate, uint64_t now_ns)
{
    b->tokens = tokens_at(b, now_ns);
    b->since_ns = now_ns;
    b->rate = rate;
}

static double needed(const struct shaper_bucket *b, size_t bytes)
{
    return (double)bytes < b->burst ? (double)bytes : b->burst;
}

bool shaper_bucket_take(struct shaper_bucket *b, size_t bytes, uint64_t now_ns)
{
    const double tokens = tokens_at(b, now_ns);
    if (b->rate <= 0 || tokens < needed(b, bytes))
        return false;
    b->tokens = tokens - (double)bytes;
    b->since_ns = now_ns;
    return true;
}

uint64_t shaper_bucket_wait_ns(const struct shaper_bucket *b, size_t bytes, uint64_t now_ns)
{
    const double missing = needed(b, bytes) - tokens_at(b, now_ns);
    if (b->rate <= 0)
        return UINT64_MAX;
    return missing > 0 ? (uint64_t)(missing / b->rate * 1e9) + 1 : 0;
}

// ---- one direction ------------------------------------------------------------------------------

struct piece {
    struct piece *next;
    uint64_t release_ns; // once it has passed the bucket
    size_t size, sent;
    uint8_t bytes[PIECE_BYTES];
};

struct pieces {
    struct piece *first, **end;
    size_t bytes;
};

struct direction {
    struct shaper *shaper;
    int from, to;
    struct shaper_bucket bucket;
    struct pieces queue, line; // before and behind the bucket
    bool ended, told;          // `from` has ended, and `to` was told
    bool is_down;
};

static void push(struct pieces *list, struct piece *p)
{
    p->next = NULL;
    if (!list->first)
        list->end = &list->first;
    *list->end = p;
    list->end = &p->next;
    list->bytes += p->size;
}

static struct piece *pop(struct pieces *list)
{
    struct piece *p = list->first;
    list->first = p->next;
    list->bytes -= p->size;
    return p;
}

static size_t queue_limit(const struct direction *d)
{
    const size_t limit = d->shaper->options.queue_bytes;
    return limit ? limit : QUEUE_BYTES;
}

static double rate_at(struct shaper *s, uint64_t now_ns)
{
    const double fixed = atomic_load(&s->rate);
    double rate = s->options.rate > 0 ? s->options.rate : NO_LIMIT;
    for (uint32_t i = 0; i < s->options.step_count; i++)
        if (now_ns - s->started_ns >= s->options.steps[i].at_ns)
            rate = s->options.steps[i].rate;
    return fixed >= 0 ? fixed : rate;
}

// False: the connection broke.
static bool take_in(struct direction *d)
{
    while (!d->ended && d->queue.bytes < queue_limit(d)) {
        struct piece *p = malloc(sizeof *p);
        if (!p)
            return false;
        const ssize_t n = recv(d->from, p->bytes, sizeof p->bytes, MSG_DONTWAIT);
        if (n <= 0) {
            const bool later = n < 0 && (errno == EAGAIN || errno == EINTR);
            free(p);
            d->ended = n == 0;
            return n == 0 || later;
        }
        p->size = (size_t)n;
        p->sent = 0;
        push(&d->queue, p);
    }
    return true;
}

static void pass_bucket(struct direction *d, uint64_t now_ns)
{
    const struct shaper_options *o = &d->shaper->options;
    shaper_bucket_set_rate(&d->bucket, d->is_down ? rate_at(d->shaper, now_ns) : NO_LIMIT, now_ns);
    while (d->queue.first && shaper_bucket_take(&d->bucket, d->queue.first->size, now_ns)) {
        struct piece *p = pop(&d->queue);
        p->release_ns = now_ns + o->delay_ns;
        if (o->jitter_ns)
            p->release_ns += (uint64_t)random() % o->jitter_ns;
        push(&d->line, p);
    }
}

// False: the connection broke.
static bool give_out(struct direction *d, uint64_t now_ns)
{
    while (d->line.first && d->line.first->release_ns <= now_ns) {
        struct piece *p = d->line.first;
        const ssize_t n =
            send(d->to, p->bytes + p->sent, p->size - p->sent, MSG_DONTWAIT | MSG_NOSIGNAL);
        if (n < 0)
            return errno == EAGAIN || errno == EINTR;
        p->sent += (size_t)n;
        if (d->is_down)
            atomic_fetch_add(&d->shaper->down_bytes, (uint64_t)n);
        if (p->sent < p->size)
            return true;
        free(pop(&d->line));
    }
    if (d->ended && !d->told && !d->queue.first && !d->line.first) {
        shutdown(d->to, SHUT_WR);
        d->told = true;
    }
    return true;
}

// When it has something to do without any event.
static uint64_t next_ns(const struct direction *d, uint64_t now_ns)
{
    uint64_t ns = UINT64_MAX;
    if (d->line.first && d->line.first->release_ns > now_ns)
        ns = d->line.first->release_ns - now_ns;
    if (d->queue.first) {
        const uint64_t wait_ns = shaper_bucket_wait_ns(&d->bucket, d->queue.first->size, now_ns);
        ns = wait_ns < ns ? wait_ns : ns;
    }
    return ns;
}

static void finish_direction(struct direction *d)
{
    while (d->queue.first)
        free(pop(&d->queue));
    while (d->line.first)
        free(pop(&d->line));
}

// ---- connections --------------------------------------------------------------------------------

struct pair {
    bool used;
    int client, server;
    struct direction down, up;
};

static void close_pair(struct pair *p)
{
    finish_direction(&p->down);
    finish_direction(&p->up);
    close(p->client);
    close(p->server);
    *p = (struct pair){0};
}

static int connect_target(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    if (fd >= 0 && connect(fd, (struct sockaddr *)&address, sizeof address) == 0)
        return fd;
    if (fd >= 0)
        close(fd);
    return -1;
}

static void begin_direction(struct direction *d, struct shaper *s, int from, int to, bool is_down)
{
    const int small = SOCKET_BYTES; // nothing waits where it is not shaped
    *d = (struct direction){.shaper = s, .from = from, .to = to, .is_down = is_down};
    shaper_bucket_init(&d->bucket, NO_LIMIT, 2 * PIECE_BYTES, hg_clock_now_ns());
    setsockopt(from, SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
}

static void accept_client(struct shaper *s, struct pair *pairs)
{
    const int on = 1;
    struct pair *p = NULL;
    const int client = accept4(s->listener, NULL, NULL, SOCK_CLOEXEC);
    for (int i = 0; i < PAIRS && !p; i++)
        p = pairs[i].used ? NULL : &pairs[i];
    const int server = client >= 0 && p ? connect_target(s->target) : -1;
    if (server < 0) {
        if (client >= 0)
            close(client);
        return;
    }
    setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    *p = (struct pair){.used = true, .client = client, .server = server};
    begin_direction(&p->down, s, server, client, true);
    begin_direction(&p->up, s, client, server, false);
}

static bool serve_direction(struct direction *d, uint64_t now_ns)
{
    if (!take_in(d))
        return false;
    pass_bucket(d, now_ns);
    return give_out(d, now_ns);
}

static short events_of(const struct direction *in, const struct direction *out, uint64_t now_ns)
{
    const bool read = !in->ended && in->queue.bytes < queue_limit(in);
    const bool write = out->line.first && out->line.first->release_ns <= now_ns;
    return (short)((read ? POLLIN : 0) | (write ? POLLOUT : 0));
}

// Waits for an event, or for what is due; true: the end.
static bool wait_for(struct shaper *s, struct pair *pairs)
{
    struct pollfd fds[2 * PAIRS + 2] = {
        {.fd = s->stop_fd, .events = POLLIN}, {.fd = s->listener, .events = POLLIN}};
    const uint64_t now_ns = hg_clock_now_ns(), most_ns = 5000000; // rates change with time
    uint64_t ns = most_ns;
    for (int i = 0; i < PAIRS; i++) {
        struct pair *p = &pairs[i];
        fds[2 + 2 * i] = (struct pollfd){.fd = -1};
        fds[3 + 2 * i] = (struct pollfd){.fd = -1};
        if (!p->used)
            continue;
        fds[2 + 2 * i] = (struct pollfd){p->client, events_of(&p->up, &p->down, now_ns), 0};
        fds[3 + 2 * i] = (struct pollfd){p->server, events_of(&p->down, &p->up, now_ns), 0};
        const uint64_t down_ns = next_ns(&p->down, now_ns), up_ns = next_ns(&p->up, now_ns);
        ns = down_ns < ns ? down_ns : ns;
        ns = up_ns < ns ? up_ns : ns;
    }
    const struct timespec limit = {.tv_nsec = (long)ns};
    ppoll(fds, sizeof fds / sizeof *fds, &limit, NULL);
    if (fds[1].revents)
        accept_client(s, pairs);
    return fds[0].revents != 0;
}

static void *shaper_main(void *arg)
{
    struct shaper *s = arg;
    struct pair pairs[PAIRS] = {0};
    while (!wait_for(s, pairs)) {
        for (int i = 0; i < PAIRS; i++) {
            struct pair *p = &pairs[i];
            const uint64_t now_ns = hg_clock_now_ns();
            const bool ok =
                !p->used || (serve_direction(&p->down, now_ns) && serve_direction(&p->up, now_ns));
            if (p->used && (!ok || (p->down.told && p->up.told)))
                close_pair(p);
        }
    }
    for (int i = 0; i < PAIRS; i++)
        if (pairs[i].used)
            close_pair(&pairs[i]);
    return NULL;
}

bool shaper_start(struct shaper *s, const char *target, const struct shaper_options *options)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;
    *s = (struct shaper){.options = *options, .stop_fd = -1, .started_ns = hg_clock_now_ns()};
    atomic_store(&s->rate, -1);
    snprintf(s->target, sizeof s->target, "%s", target);
    s->listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    s->stop_fd = eventfd(0, EFD_CLOEXEC);
    if (s->listener >= 0 && s->stop_fd >= 0 &&
        bind(s->listener, (struct sockaddr *)&address, sizeof address) == 0 &&
        listen(s->listener, PAIRS) == 0 &&
        getsockname(s->listener, (struct sockaddr *)&address, &size) == 0) {
        s->port = ntohs(address.sin_port);
        if (pthread_create(&s->thread, NULL, shaper_main, s) == 0)
            return true;
    }
    if (s->listener >= 0)
        close(s->listener);
    if (s->stop_fd >= 0)
        close(s->stop_fd);
    return false;
}

void shaper_set_rate(struct shaper *s, double rate)
{
    atomic_store(&s->rate, rate);
}

void shaper_stop(struct shaper *s)
{
    const uint64_t one = 1;
    const ssize_t told = write(s->stop_fd, &one, sizeof one);
    if (told == (ssize_t)sizeof one)
        pthread_join(s->thread, NULL);
    close(s->listener);
    close(s->stop_fd);
}
