#include "server/broker/state/state_log.h"

#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/cond.h"
#include "base/file.h"
#include "base/log.h"
#include "server/broker/state/state_file.h"

enum { PARTS = 64, COPY_BYTES = 1 << 20, STEP_BYTES = 4 << 20, ITEM_BYTES = 128 };

static const uint64_t retry_ns = 1000000000;

// A record, a file that is to be synced, or a snapshot.
struct item {
    struct item *next;
    uint64_t position;
    struct hg_packet *packet; // of the loop: the thread reads it and gives it back
    uint8_t *head;
    size_t head_size;
    uint8_t prefix[HG_STATE_PREFIX_BYTES];
    int fd;                     // -1: a record
    struct hg_state_sync *sync; // of the loop; NULL: only logged
    enum hg_status status;      // of the sync
    struct snapshot *snapshot;
    bool waits; // counted in backlog_bytes
};

struct list {
    struct item *first, **last;
};

struct snapshot {
    struct list items;
    bool failed; // no memory for all of it
};

// Between the loop and the thread, under the lock.
struct shared {
    pthread_mutex_t lock;
    pthread_cond_t wake;
    struct list queue; // to the thread
    struct list done;  // back
    uint64_t reached;
    enum hg_status status;
    uint64_t bytes, base_bytes; // of the file; after the last rewrite
    bool rewritten;             // a rewrite has ended, well or not
    uint64_t covered;           // position of the newest snapshot that was written
    bool stop;
};

// Of the thread.
struct writer {
    struct hg_state_folder folder;
    uint64_t position; // of the newest record that was taken
    uint64_t synced_ns;
    bool dirty;
    enum hg_status status;
    struct item *rewriting; // the item of the snapshot that is being written; NULL = none
    struct item *next;      // of the snapshot's items
    int new_fd;
    enum hg_status rewrite_status;
    enum hg_status rewrite_told;    // how the one before ended
    uint64_t new_bytes, from_bytes; // of the old file, from where on it is copied
};

struct hg_state_log {
    struct hg_state_log_options options;
    int event_fd;
    pthread_t thread;
    bool running;
    struct shared shared;
    struct writer writer;
    // Of the loop.
    uint64_t position, backlog_bytes;
    struct hg_outq_reached reached;
    uint64_t lost; // position of a record for which there was no memory; 0 = none
    uint64_t bytes, base_bytes;
    enum hg_status status;
    bool rewriting;
    uint64_t retry_ns; // when a broken log is tried again
    struct snapshot *snapshot;
};

static void add(struct list *list, struct item *item)
{
    item->next = NULL;
    if (!list->first)
        list->last = &list->first;
    *list->last = item;
    list->last = &item->next;
}

static void append_list(struct list *list, struct list *more)
{
    if (!more->first)
        return;
    if (!list->first)
        list->last = &list->first;
    *list->last = more->first;
    list->last = more->last;
    *more = (struct list){0};
}

static size_t item_bytes(const struct item *item)
{
    return ITEM_BYTES + item->head_size + (item->packet ? item->packet->header.length : 0);
}

// ---- the thread: writing ------------------------------------------------------------------------

// HG_OK, or why not all was written.
static enum hg_status write_all(int fd, struct iovec *parts, int count)
{
    while (count) {
        ssize_t n = writev(fd, parts, count);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return hg_status_from_errno(errno);
        for (; count && (size_t)n >= parts->iov_len; parts++, count--)
            n -= (ssize_t)parts->iov_len;
        if (count) {
            parts->iov_base = (uint8_t *)parts->iov_base + n;
            parts->iov_len -= (size_t)n;
        }
    }
    return HG_OK;
}

static size_t record_bytes(const struct item *item)
{
    return HG_STATE_PREFIX_BYTES + item->head_size +
           (item->packet ? item->packet->header.length : 0);
}

static int gather(struct item *item, struct iovec *parts)
{
    const uint8_t *rest = item->packet ? item->packet->payload : NULL;
    size_t rest_size = item->packet ? item->packet->header.length : 0;
    hg_state_prefix_encode(item->prefix, item->head, item->head_size, rest, rest_size);
    parts[0] = (struct iovec){item->prefix, sizeof item->prefix};
    parts[1] = (struct iovec){item->head, item->head_size};
    parts[2] = (struct iovec){(void *)rest, rest_size};
    return rest_size ? 3 : 2;
}

// Writes records from `item` on, at most about `most` bytes, and returns the first that is left or
// is no record.
static struct item *write_records(
    int fd, struct item *item, uint64_t most, uint64_t *bytes, enum hg_status *status)
{
    struct iovec parts[PARTS];
    *status = HG_OK;
    for (uint64_t written = 0; item && item->fd < 0 && !item->snapshot && written < most;) {
        int count = 0;
        uint64_t size = 0;
        for (; item && item->fd < 0 && !item->snapshot && count + 3 <= PARTS && size < COPY_BYTES;
             item = item->next) {
            count += gather(item, parts + count);
            size += record_bytes(item);
        }
        *status = write_all(fd, parts, count);
        if (*status)
            return item;
        *bytes += size;
        written += size;
    }
    return item;
}

static void break_log(struct hg_state_log *log, enum hg_status status, const char *action)
{
    struct writer *w = &log->writer;
    if (!w->status)
        hg_fault(JOURNAL, status, "the log in %s: cannot %s: %s; %s", log->options.folder, action,
            strerror(errno),
            log->options.go_on ? "nothing survives the daemon until that is over"
                               : "edits are not answered and refused until that is over");
    w->status = status;
    w->rewrite_status =
        status; // of one under way: what comes after its snapshot is not in the file
    if (ftruncate(w->folder.log_fd, (off_t)w->folder.bytes) != 0)
        hg_debug(JOURNAL, "cannot cut the log: %s", strerror(errno));
}

static void sync_log(struct hg_state_log *log)
{
    struct writer *w = &log->writer;
    if (w->dirty && !w->status && fdatasync(w->folder.log_fd) != 0)
        break_log(log, hg_status_from_errno(errno), "sync");
    w->dirty = false;
    w->synced_ns = hg_clock_now_ns();
}

// ---- the thread: rewriting ----------------------------------------------------------------------

static void begin_rewrite(struct hg_state_log *log, struct item *item)
{
    struct writer *w = &log->writer;
    w->rewriting = item;
    w->next = item->snapshot->items.first;
    w->from_bytes = w->folder.bytes;
    w->new_bytes = HG_STATE_HEADER_BYTES;
    w->rewrite_status =
        item->snapshot->failed ? HG_E_NOMEM : hg_state_folder_begin(&w->folder, &w->new_fd);
}

// What was appended to the old file meanwhile.
static enum hg_status copy_tail(struct writer *w)
{
    uint8_t *buffer = hg_realloc(NULL, COPY_BYTES, 1);
    enum hg_status status = buffer ? HG_OK : HG_E_NOMEM;
    while (!status && w->from_bytes < w->folder.bytes) {
        uint64_t left = w->folder.bytes - w->from_bytes;
        ssize_t n = pread(w->folder.log_fd, buffer, left < COPY_BYTES ? (size_t)left : COPY_BYTES,
            (off_t)w->from_bytes);
        if (n <= 0)
            status = n < 0 ? hg_status_from_errno(errno) : HG_E_IO;
        else
            status = write_all(w->new_fd, &(struct iovec){buffer, (size_t)n}, 1);
        w->from_bytes += status ? 0 : (uint64_t)n;
        w->new_bytes += status ? 0 : (uint64_t)n;
    }
    hg_free(buffer);
    return status;
}

// The new file in the old one's place, with all that the old one has got meanwhile.
static enum hg_status replace(struct hg_state_log *log)
{
    struct writer *w = &log->writer;
    const int before = w->folder.log_fd;
    enum hg_status status = w->status ? HG_OK : copy_tail(w);
    if (status)
        return status;
    status = hg_state_folder_replace(&w->folder, w->new_fd, w->new_bytes);
    w->new_fd = -1;
    w->dirty &= status != HG_OK;
    if (status && w->folder.log_fd != before)
        break_log(log, status, "sync the folder");
    return status;
}

static void end_rewrite(struct hg_state_log *log, enum hg_status status)
{
    struct writer *w = &log->writer;
    struct shared *s = &log->shared;
    if (status) { // a broken log is tried again every second, and said to fail once
        hg_log_write(status == w->rewrite_told ? HG_LOG_DEBUG : HG_LOG_WARN, HG_LOG_JOURNAL, status,
            0, "the log in %s cannot be rewritten: %s", log->options.folder,
            hg_status_text(status));
        hg_state_folder_abort(&w->folder, w->new_fd);
        w->new_fd = -1;
    } else if (w->status) {
        hg_info(JOURNAL, "the log in %s is complete again", log->options.folder);
        w->status = HG_OK;
    }
    w->rewrite_told = status;
    pthread_mutex_lock(&s->lock);
    s->rewritten = true;
    if (!status)
        s->covered = w->rewriting->position;
    // After a failure the log may double once more before the next try.
    s->base_bytes = w->folder.bytes;
    append_list(&s->done, &w->rewriting->snapshot->items);
    add(&s->done, w->rewriting);
    pthread_mutex_unlock(&s->lock);
    w->rewriting = NULL;
}

static void step_rewrite(struct hg_state_log *log)
{
    struct writer *w = &log->writer;
    enum hg_status status = w->rewrite_status;
    if (!status)
        w->next = write_records(w->new_fd, w->next, STEP_BYTES, &w->new_bytes, &status);
    if (!status && w->next)
        return;
    end_rewrite(log, status ? status : replace(log));
}

// ---- the thread: its round ----------------------------------------------------------------------

static void sync_item(struct item *item)
{
    item->status = fsync(item->fd) == 0 ? HG_OK : hg_status_from_errno(errno);
    if (item->status)
        hg_fault(JOURNAL, HG_E_IO, "cannot sync a file: %s", strerror(errno));
    close(item->fd);
    item->fd = -1;
}

// A broken log appends nothing: what comes is in the snapshot that mends it, or comes behind that.
static void write_batch(struct hg_state_log *log, struct list *batch, struct list *done)
{
    struct writer *w = &log->writer;
    enum hg_status status;
    for (struct item *it = batch->first, *next; it;) {
        struct item *end;
        if (it->fd >= 0)
            sync_item(it);
        if (it->snapshot) {
            next = it->next;
            w->position = it->position;
            begin_rewrite(log, it);
            while (w->status && w->rewriting)
                step_rewrite(log);
            it = next;
            continue;
        }
        if (w->status || !it->head) {
            end = it->next;
        } else {
            end = write_records(w->folder.log_fd, it, UINT64_MAX, &w->folder.bytes, &status);
            w->dirty = true;
            if (status)
                break_log(log, status, "write");
        }
        for (; it != end; it = next) {
            next = it->next;
            w->position = it->position;
            add(done, it);
        }
    }
    *batch = (struct list){0};
}

static void report(struct hg_state_log *log, struct list *done)
{
    struct writer *w = &log->writer;
    struct shared *s = &log->shared;
    pthread_mutex_lock(&s->lock);
    append_list(&s->done, done);
    if (!w->status)
        s->reached = w->position;
    s->status = w->status;
    s->bytes = w->folder.bytes;
    pthread_mutex_unlock(&s->lock);
    if (eventfd_write(log->event_fd, 1) != 0)
        hg_debug(JOURNAL, "eventfd: %s", strerror(errno));
}

// What waits; false: nothing ever will.
static bool take(struct hg_state_log *log, struct list *batch)
{
    struct writer *w = &log->writer;
    struct shared *s = &log->shared;
    uint64_t until_ns = w->rewriting ? 0
                        : w->dirty   ? w->synced_ns + log->options.sync_interval_ns
                                     : HG_COND_FOREVER;
    pthread_mutex_lock(&s->lock);
    while (!s->queue.first && !s->stop && until_ns && hg_cond_wait(&s->wake, &s->lock, until_ns))
        ;
    append_list(batch, &s->queue);
    bool more = batch->first || !s->stop || w->rewriting;
    pthread_mutex_unlock(&s->lock);
    return more;
}

static void *run(void *user)
{
    struct hg_state_log *log = user;
    struct writer *w = &log->writer;
    struct list batch = {0}, done = {0};
    while (take(log, &batch)) {
        bool any = batch.first || w->rewriting;
        write_batch(log, &batch, &done);
        if (w->rewriting)
            step_rewrite(log);
        if (log->options.wait_for_sync ||
            hg_clock_now_ns() >= w->synced_ns + log->options.sync_interval_ns)
            sync_log(log);
        if (any)
            report(log, &done);
    }
    sync_log(log);
    return NULL;
}

// ---- the loop -----------------------------------------------------------------------------------

static void destroy_item(struct item *item)
{
    hg_packet_unref(item->packet);
    hg_free(item->snapshot);
    hg_free(item->head);
    if (item->fd >= 0)
        close(item->fd);
    hg_free(item);
}

static void destroy_list(struct list *list)
{
    for (struct item *it = list->first, *next; it; it = next) {
        next = it->next;
        if (it->snapshot)
            destroy_list(&it->snapshot->items);
        destroy_item(it);
    }
    *list = (struct list){0};
}

static void push(struct hg_state_log *log, struct item *item)
{
    struct shared *s = &log->shared;
    pthread_mutex_lock(&s->lock);
    item->position = ++log->position;
    item->waits = !item->snapshot;
    log->backlog_bytes += item->waits ? item_bytes(item) : 0;
    add(&s->queue, item);
    pthread_cond_signal(&s->wake);
    pthread_mutex_unlock(&s->lock);
}

// Something is missing in the log: only a snapshot helps.
static uint64_t lose(struct hg_state_log *log)
{
    if (!log->status)
        hg_fault(JOURNAL, HG_E_NOMEM, "the log in %s: no memory for a record", log->options.folder);
    log->status = HG_E_NOMEM;
    log->lost = ++log->position;
    return log->lost;
}

uint64_t hg_state_log_append(
    struct hg_state_log *log, struct hg_writer *head, struct hg_packet *packet)
{
    struct item *item = log && !head->failed ? hg_calloc(1, sizeof *item) : NULL;
    if (!item) {
        hg_writer_finish(head);
        if (log && log->snapshot)
            log->snapshot->failed = true;
        return !log ? 0 : log->snapshot ? log->position : lose(log);
    }
    *item = (struct item){.fd = -1,
        .head = head->data,
        .head_size = head->size,
        .packet = packet ? hg_packet_ref(packet) : NULL};
    *head = (struct hg_writer){0};
    if (!log->snapshot) {
        push(log, item);
    } else {
        item->position = log->position;
        add(&log->snapshot->items, item);
    }
    return log->position;
}

void hg_state_log_sync_file(struct hg_state_log *log, int fd, struct hg_state_sync *sync)
{
    struct item *item = log && fd >= 0 ? hg_calloc(1, sizeof *item) : NULL;
    if (item) {
        item->fd = fd;
        item->sync = sync;
        if (sync)
            sync->left++;
        push(log, item);
    } else if (fd >= 0) {
        close(fd);
        if (sync)
            sync->status = HG_E_NOMEM;
    }
}

uint64_t hg_state_log_position(const struct hg_state_log *log)
{
    return log ? log->position : 0;
}

const struct hg_outq_reached *hg_state_log_reached(const struct hg_state_log *log)
{
    return &log->reached;
}

enum hg_status hg_state_log_refusal(const struct hg_state_log *log)
{
    return log && !log->options.go_on ? log->status : HG_OK;
}

bool hg_state_log_is_broken(const struct hg_state_log *log)
{
    return log && log->status;
}

bool hg_state_log_is_behind(const struct hg_state_log *log)
{
    return log && log->backlog_bytes > HG_STATE_LOG_BACKLOG;
}

int hg_state_log_fd(const struct hg_state_log *log)
{
    return log->event_fd;
}

static void end_sync(const struct item *item)
{
    if (!item->sync)
        return;
    item->sync->left--;
    if (item->status && !item->sync->status)
        item->sync->status = item->status;
}

bool hg_state_log_poll(struct hg_state_log *log)
{
    struct shared *s = &log->shared;
    eventfd_t count;
    const struct hg_outq_reached before = log->reached;
    if (eventfd_read(log->event_fd, &count) != 0)
        return false;
    pthread_mutex_lock(&s->lock);
    struct list done = s->done;
    s->done = (struct list){0};
    uint64_t reached = s->reached;
    bool rewritten = s->rewritten;
    s->rewritten = false;
    if (s->covered >= log->lost)
        log->lost = 0;
    log->status = s->status ? s->status : log->lost ? HG_E_NOMEM : HG_OK;
    log->bytes = s->bytes;
    log->base_bytes = s->base_bytes;
    pthread_mutex_unlock(&s->lock);
    log->rewriting &= !rewritten;
    for (struct item *it = done.first; it; it = it->next) {
        log->backlog_bytes -= it->waits ? item_bytes(it) : 0;
        end_sync(it);
    }
    destroy_list(&done);
    log->reached.durable = log->status ? log->reached.durable : reached;
    if (log->status && log->options.go_on)
        log->reached.durable = UINT64_MAX;
    log->reached.kept = log->status ? UINT64_MAX : reached;
    log->reached.status = log->status;
    return log->reached.durable != before.durable || log->reached.kept != before.kept;
}

bool hg_state_log_wants_snapshot(const struct hg_state_log *log, uint64_t now_ns)
{
    if (log->rewriting)
        return false;
    if (log->status)
        return now_ns >= log->retry_ns;
    return log->options.is_known || log->bytes > 2 * log->base_bytes + HG_STATE_LOG_SLACK;
}

void hg_state_log_begin_snapshot(struct hg_state_log *log, uint64_t now_ns)
{
    log->retry_ns = now_ns + retry_ns;
    log->snapshot = hg_calloc(1, sizeof *log->snapshot);
}

void hg_state_log_end_snapshot(struct hg_state_log *log)
{
    struct item *item = hg_calloc(1, sizeof *item);
    struct snapshot *snapshot = log->snapshot;
    log->snapshot = NULL;
    if (!item || !snapshot) { // tried again later
        if (snapshot)
            destroy_list(&snapshot->items);
        hg_free(snapshot);
        hg_free(item);
        return;
    }
    item->fd = -1;
    item->snapshot = snapshot;
    log->rewriting = true;
    log->options.is_known = false;
    push(log, item);
}

// ---- over an exec -------------------------------------------------------------------------------

struct hg_state_log *hg_state_log_create_memory(void)
{
    struct hg_state_log *log = hg_calloc(1, sizeof *log);
    if (!log)
        return NULL;
    log->snapshot = hg_calloc(1, sizeof *log->snapshot);
    log->writer.folder = (struct hg_state_folder){.folder_fd = -1, .lock_fd = -1, .log_fd = -1};
    log->event_fd = log->writer.new_fd = -1;
    pthread_mutex_init(&log->shared.lock, NULL);
    hg_cond_init(&log->shared.wake);
    if (log->snapshot)
        return log;
    hg_state_log_close(log);
    return NULL;
}

enum hg_status hg_state_log_write_memory(struct hg_state_log *log, int fd)
{
    uint8_t header[HG_STATE_HEADER_BYTES];
    uint64_t bytes = 0;
    hg_state_header_encode(header);
    enum hg_status status = log->snapshot->failed ? HG_E_NOMEM : HG_OK;
    for (const struct item *it = log->snapshot->items.first; it && !status; it = it->next)
        if (record_bytes(it) - HG_STATE_PREFIX_BYTES > HG_STATE_BODY_LIMIT)
            status = HG_E_LIMIT;
    if (!status)
        status = write_all(fd, &(struct iovec){header, sizeof header}, 1);
    if (!status)
        (void)write_records(fd, log->snapshot->items.first, UINT64_MAX, &bytes, &status);
    return status;
}

// ---- opening ------------------------------------------------------------------------------------

// Signals are for the loop.
static enum hg_status start_thread(struct hg_state_log *log, struct hg_error *err)
{
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int rc = pthread_create(&log->thread, NULL, run, log);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (rc)
        return hg_error_set(err, HG_E_NOMEM, log->options.folder, NULL,
            "--state-dir: cannot start a thread: %s", strerror(rc));
    log->running = true;
    return HG_OK;
}

enum hg_status hg_state_log_open(const struct hg_state_log_options *options,
    hg_state_take *take_record, void *user, struct hg_state_log **out, struct hg_error *err)
{
    struct hg_state_log *log = hg_calloc(1, sizeof *log);
    *out = NULL;
    if (!log)
        return hg_error_set(err, HG_E_NOMEM, options->folder, NULL, "no memory");
    log->options = *options;
    log->writer.new_fd = -1;
    pthread_mutex_init(&log->shared.lock, NULL);
    hg_cond_init(&log->shared.wake);
    log->event_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    enum hg_status status =
        hg_state_folder_open(options->folder, take_record, user, &log->writer.folder, err);
    log->bytes = log->shared.bytes = log->writer.folder.bytes;
    log->writer.synced_ns = hg_clock_now_ns();
    if (!status)
        status = start_thread(log, err);
    if (status)
        hg_state_log_close(log);
    else
        *out = log;
    return status;
}

void hg_state_log_close(struct hg_state_log *log)
{
    if (!log)
        return;
    struct shared *s = &log->shared;
    if (log->running) {
        pthread_mutex_lock(&s->lock);
        s->stop = true;
        pthread_cond_signal(&s->wake);
        pthread_mutex_unlock(&s->lock);
        pthread_join(log->thread, NULL);
    }
    if (log->snapshot)
        destroy_list(&log->snapshot->items);
    hg_free(log->snapshot);
    destroy_list(&s->queue);
    destroy_list(&s->done);
    hg_state_folder_close(&log->writer.folder);
    if (log->event_fd >= 0)
        close(log->event_fd);
    pthread_mutex_destroy(&s->lock);
    pthread_cond_destroy(&s->wake);
    hg_free(log);
}
