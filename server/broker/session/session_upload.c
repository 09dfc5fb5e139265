#include "server/broker/session/session_upload.h"

#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>

#include "base/alloc.h"
#include "base/sha256.h"
#include "server/broker/session/session_audit.h"
#include "server/broker/session/session_sync.h"
#include "server/broker/storage/upload.h"

// Until others of the session may be done.
enum { RETRY_UPLOAD_MS = 1000, RETRY_VERIFIED_MS = 10000 };
// That wait for the disk: of a session, and of all. Above that uploads are not taken.
enum { UNWRITTEN_BYTES = 8 << 20, ALL_UNWRITTEN_BYTES = 64 << 20 };

static bool is_arriving(const struct hg_upload *upload)
{
    return upload && !hg_upload_is_committed(upload);
}

static struct hg_upload **find_slot(struct hg_session *s, const uint8_t hash[32])
{
    for (size_t i = 0; i < HG_SESSION_UPLOADS; i++)
        if (is_arriving(s->uploads[i]) && memcmp(hg_upload_hash(s->uploads[i]), hash, 32) == 0)
            return &s->uploads[i];
    return NULL;
}

static struct hg_upload **free_slot(struct hg_session *s)
{
    for (size_t i = 0; i < HG_SESSION_UPLOADS; i++)
        if (!s->uploads[i])
            return &s->uploads[i];
    return NULL;
}

// Whose the session's uploads are: its tenant's. NULL: no memory.
static struct hg_upload_owner *owner_of(const struct hg_session *s)
{
    uint8_t key[32];
    const struct hg_options *o = s->table->options;
    if (hg_sha256(s->tenant, strlen(s->tenant), key))
        return NULL;
    struct hg_upload_owner *owner = hg_upload_store_owner(s->table->store, key);
    if (owner) // a file that is verified counts as long as the worker has it
        hg_upload_owner_set_quota(
            owner, &(struct hg_upload_usage){.bytes = o->max_upload_bytes > s->bytes.verified
                                                          ? o->max_upload_bytes - s->bytes.verified
                                                          : 0,
                       .files = o->max_upload_files});
    return owner;
}

bool hg_session_upload_has(struct hg_session *s, const uint8_t hash[32])
{
    const struct hg_upload_owner *owner = owner_of(s);
    return owner &&
           hg_upload_store_has(s->table->store, s->table->pool->is_shared ? NULL : owner, hash);
}

enum hg_status hg_session_upload_may_keep(struct hg_session *s, const char *what,
    const struct hgp_asset_file *files, uint32_t count, struct hg_error *err)
{
    struct hg_upload_store *store = s->table->store;
    const struct hg_upload_owner *owner = owner_of(s);
    uint64_t need = 0;
    if (!owner)
        return hg_error_set(err, HG_E_NOMEM, what, NULL, "no memory");
    for (uint32_t i = 0; i < count; i++)
        need += hg_upload_store_pin_bytes(store, files[i].hash);
    const uint64_t room = need ? hg_upload_owner_pin_room(store, owner) : 0;
    if (need <= room)
        return HG_OK;
    hg_error_set(err, HG_E_LIMIT, what, NULL,
        "uploads that scenes use may not take %llu MiB more: this tenant has %llu MiB left of its "
        "share of the upload store (upload-store, %llu MiB)",
        (unsigned long long)(need >> 20), (unsigned long long)(room >> 20),
        (unsigned long long)(s->table->options->upload_store_bytes >> 20));
    return hg_error_limit(err, "upload-store", 0);
}

static enum hg_status begin(struct hg_session *s, const struct hgp_upload *m,
    struct hg_upload ***slot, struct hg_error *err)
{
    const struct hg_options *o = s->table->options;
    struct hg_upload_owner *owner = owner_of(s);
    if (!owner)
        return hg_error_set(err, HG_E_NOMEM, "upload", NULL, "no memory");
    if (m->offset)
        return hg_error_set(err, HG_E_STATE, "upload", "offset",
            "the first piece of a content starts at 0, not at %llu", (unsigned long long)m->offset);
    if (m->total > o->max_upload_bytes || s->bytes.verified > o->max_upload_bytes - m->total) {
        hg_error_set(err, HG_E_LIMIT, "upload", "total",
            "%llu bytes, beside %llu of a file that is verified, are more than the quota of %llu "
            "MiB (max-upload)",
            (unsigned long long)m->total, (unsigned long long)s->bytes.verified,
            (unsigned long long)(o->max_upload_bytes >> 20));
        return hg_error_limit(
            err, "max-upload", m->total > o->max_upload_bytes ? 0 : RETRY_VERIFIED_MS);
    }
    *slot = free_slot(s);
    if (!*slot) {
        hg_error_set(err, HG_E_LIMIT, "upload", NULL,
            "%d contents of this session are under way already", HG_SESSION_UPLOADS);
        return hg_error_limit(err, "uploads-per-session", RETRY_UPLOAD_MS);
    }
    enum hg_status status = hg_upload_begin(s->table->store, owner, m->hash, m->total, *slot, err);
    if (!status)
        hg_upload_set_session(**slot, s->number);
    return status;
}

// Gives it up, unless it is complete; then `ended` answers.
static enum hg_status take_piece(struct hg_session *s, struct hg_packet *packet,
    const struct hgp_upload *m, struct hg_error *err)
{
    struct hg_upload **slot = find_slot(s, m->hash);
    enum hg_status status = slot ? HG_OK : begin(s, m, &slot, err);
    if (status)
        return status;
    struct hg_upload *upload = *slot;
    if (m->offset != hg_upload_offset(upload) || m->total != hg_upload_total(upload))
        status = hg_error_set(err, HG_E_STATE, "upload", "offset",
            "the next piece of this content starts at %llu of %llu",
            (unsigned long long)hg_upload_offset(upload),
            (unsigned long long)hg_upload_total(upload));
    else
        status = hg_upload_append(upload,
            &(struct hg_upload_piece){packet, m->data.data, m->data.size, packet->header.request},
            err);
    if (status) {
        *slot = NULL;
        hg_upload_abort(upload);
        return status;
    }
    s->bytes.uploaded += m->data.size;
    s->table->store_watch.unwritten += m->data.size;
    if (hg_upload_offset(upload) < hg_upload_total(upload))
        return HG_OK;
    status = hg_upload_commit(upload, packet->header.request, s->table->scenes.log != NULL, err);
    if (status)
        *slot = NULL;
    return status;
}

// A piece behind one that failed: its sender learns the first reason, once.
static bool follows_failure(const struct hg_session *s, const struct hgp_upload *m)
{
    return s->failed && m->offset && memcmp(s->failed->hash, m->hash, 32) == 0;
}

// Keeps the reason for the pieces that follow.
static void note_failure(struct hg_session *s, const uint8_t hash[32], const struct hg_error *err)
{
    if (!s->failed && !(s->failed = hg_calloc(1, sizeof *s->failed)))
        return; // pieces behind it are refused for their place
    memcpy(s->failed->hash, hash, 32);
    s->failed->err = *err;
}

static void refuse(
    struct hg_session *s, uint32_t request, const uint8_t hash[32], const struct hg_error *err)
{
    note_failure(s, hash, err);
    if (s->conn)
        hg_conn_fail(s->conn, request, err);
}

static void tell_audit(
    const struct hg_session *s, const uint8_t hash[32], uint64_t total, enum hg_status status)
{
    char hex[HG_SHA256_HEX], detail[120];
    hg_sha256_hex(hash, hex);
    snprintf(detail, sizeof detail, "sha256:%s, %llu bytes", hex, (unsigned long long)total);
    hg_session_audit(s, "upload", status, detail);
}

static void answer(struct hg_session *s, uint32_t request)
{
    if (!s->conn || !request)
        return;
    hg_outq_hold(&s->conn->out, hg_state_log_position(s->table->scenes.log));
    hg_conn_send(s->conn, request, HGP_T_ok, &(struct hgp_ok){0});
}

void hg_session_upload(struct hg_session *s, struct hg_packet *packet, const struct hgp_upload *m)
{
    struct hg_error err = {0};
    const uint32_t request = packet->header.request;
    const bool running = find_slot(s, m->hash) != NULL;
    if (!running && follows_failure(s, m)) {
        if (request)
            hg_conn_fail(s->conn, request, &s->failed->err);
        return;
    }
    // Another session has sent it meanwhile: nothing is stored twice.
    if (!running && hg_session_upload_has(s, m->hash)) {
        if (m->offset + m->data.size < m->total)
            return;
        tell_audit(s, m->hash, m->total, HG_OK);
        answer(s, request);
    } else if (take_piece(s, packet, m, &err)) {
        tell_audit(s, m->hash, m->total, err.status);
        refuse(s, request, m->hash, &err);
    }
}

// ---- what the disk says -------------------------------------------------------------------------

// The session of an upload, whose slot is free then. NULL: it has ended.
static struct hg_session *leave_slot(struct hg_session_table *table, struct hg_upload *upload)
{
    const uint32_t number = hg_upload_session(upload);
    struct hg_session *s = number ? hg_session_find(table, number) : NULL;
    for (size_t i = 0; s && i < HG_SESSION_UPLOADS; i++)
        if (s->uploads[i] == upload)
            s->uploads[i] = NULL;
    return s;
}

static void written(void *user, size_t bytes)
{
    struct hg_session_table *table = user;
    table->store_watch.unwritten -= bytes;
}

static void failed(
    void *user, struct hg_upload *upload, uint32_t request, const struct hg_error *err)
{
    struct hg_session *s = leave_slot(user, upload);
    if (s) {
        tell_audit(s, hg_upload_hash(upload), hg_upload_total(upload), err->status);
        refuse(s, request, hg_upload_hash(upload), err);
    }
    hg_upload_abort(upload);
}

// With a state log the content is synced before its answer is sent: edits name it.
static void ended(void *user, struct hg_upload *upload, const struct hg_error *why)
{
    struct hg_session_table *table = user;
    struct hg_session *s = leave_slot(table, upload);
    struct hg_error err = *why;
    const bool synced = table->scenes.log != NULL;
    if (!err.status && synced) {
        struct hg_session_synced content = {.session = s ? s->number : 0,
            .request = hg_upload_request(upload),
            .hash = hg_upload_hash(upload)};
        hg_upload_take_files(upload, &content.content_fd, &content.folder_fd);
        if (hg_session_sync_begin(table, &content, &err))
            hg_upload_store_forget(table->store, hg_upload_hash(upload));
    }
    if (!s)
        return;
    tell_audit(s, hg_upload_hash(upload), hg_upload_total(upload), err.status);
    if (err.status)
        refuse(s, hg_upload_request(upload), hg_upload_hash(upload), &err);
    else if (!synced)
        answer(s, hg_upload_request(upload));
}

static void store_ready(struct hg_source *source, uint32_t events)
{
    const struct hg_session_table *table = source->owner;
    (void)events;
    hg_disk_queue_poll(hg_upload_store_queue(table->store));
}

enum hg_status hg_session_upload_watch(
    struct hg_session_table *table, struct hg_loop *loop, struct hg_error *err)
{
    hg_upload_store_listen(table->store, &(struct hg_upload_news){table, written, failed, ended});
    table->store_watch.source =
        (struct hg_source){.fd = hg_disk_queue_fd(hg_upload_store_queue(table->store)),
            .events = EPOLLIN,
            .ready = store_ready,
            .owner = table};
    return hg_loop_add(loop, &table->store_watch.source)
               ? hg_error_set(err, HG_E_LIMIT, "uploads", NULL, "cannot watch the disk")
               : HG_OK;
}

void hg_session_upload_unwatch(struct hg_session_table *table, struct hg_loop *loop)
{
    if (!table->store_watch.source.owner)
        return;
    hg_disk_queue_wait(hg_upload_store_queue(table->store));
    hg_loop_remove(loop, &table->store_watch.source);
    hg_upload_store_listen(table->store, &(struct hg_upload_news){0});
}

// ---- what waits ---------------------------------------------------------------------------------

struct waiting {
    uint64_t bytes;
    uint32_t slots, committed;
};

static struct waiting count_waiting(const struct hg_session *s)
{
    struct waiting w = {0};
    for (size_t i = 0; i < HG_SESSION_UPLOADS; i++)
        if (s->uploads[i]) {
            w.slots++;
            w.bytes += hg_upload_unwritten(s->uploads[i]);
            w.committed += hg_upload_is_committed(s->uploads[i]);
        }
    return w;
}

bool hg_session_upload_must_wait(const struct hg_session *s, const struct hgp_framer *in)
{
    uint16_t type;
    if (hg_session_upload_is_quiet(s->table) || !hgp_framer_peek(in, &type))
        return false;
    if (type == HGP_T_upload) {
        const struct waiting w = count_waiting(s);
        return w.bytes >= UNWRITTEN_BYTES ||
               s->table->store_watch.unwritten >= ALL_UNWRITTEN_BYTES ||
               (w.committed && w.slots == HG_SESSION_UPLOADS);
    }
    return (type == HGP_T_upload_query || type == HGP_T_asset_load ||
               type == HGP_T_environment_set) &&
           count_waiting(s).committed;
}

bool hg_session_upload_is_due(const struct hg_session *s)
{
    return count_waiting(s).committed || hg_session_sync_waits(s->table, s);
}

bool hg_session_upload_is_quiet(const struct hg_session_table *table)
{
    return hg_disk_queue_is_idle(hg_upload_store_queue(table->store));
}

void hg_session_upload_query(
    struct hg_session *s, uint32_t request, const struct hgp_upload_query *m)
{
    struct hgp_flag flags[1024];
    for (uint32_t i = 0; i < m->contents.count; i++)
        flags[i] = (struct hgp_flag){.value = hg_session_upload_has(s, m->contents.items[i].hash)};
    if (request)
        hg_conn_send(s->conn, request, HGP_T_upload_have,
            &(struct hgp_upload_have){.have = {flags, m->contents.count}});
}

void hg_session_upload_check_times(struct hg_session *s, uint64_t now_ns)
{
    const uint64_t timeout_ns = s->table->options->upload_timeout_ns;
    for (size_t i = 0; i < HG_SESSION_UPLOADS && s->conn; i++) {
        struct hg_upload *upload = s->uploads[i];
        struct hg_error err = {0};
        // What waits for the disk is not late by fault of its client.
        if (!is_arriving(upload) || hg_upload_unwritten(upload) ||
            now_ns < hg_upload_progress_ns(upload) + timeout_ns)
            continue;
        hg_error_set(&err, HG_E_TIMEOUT, "upload", NULL,
            "no piece of this content came for %.0f s (upload-timeout); it was given up at %llu of "
            "%llu bytes",
            (double)timeout_ns * 1e-9, (unsigned long long)hg_upload_offset(upload),
            (unsigned long long)hg_upload_total(upload));
        note_failure(s, hg_upload_hash(upload), &err);
        hg_conn_fail(s->conn, 0, &err);
        hg_upload_abort(upload);
        s->uploads[i] = NULL;
    }
}

void hg_session_upload_abort_all(struct hg_session *s)
{
    hg_session_sync_unask(s);
    for (size_t i = 0; i < HG_SESSION_UPLOADS; i++) {
        if (s->uploads[i] && !is_arriving(s->uploads[i]))
            hg_upload_set_session(s->uploads[i], 0);
        else
            hg_upload_abort(s->uploads[i]);
        s->uploads[i] = NULL;
    }
}

void hg_session_upload_fail_all(struct hg_session *s, const struct hg_error *err)
{
    for (size_t i = 0; i < HG_SESSION_UPLOADS; i++) {
        struct hg_upload *upload = s->uploads[i];
        if (!is_arriving(upload))
            continue;
        refuse(s, 0, hg_upload_hash(upload), err);
        hg_upload_abort(upload);
        s->uploads[i] = NULL;
    }
}

// ---- files that are verified --------------------------------------------------------------------

static uint64_t all_verified_bytes(const struct hg_session_table *table)
{
    uint64_t sum = 0;
    for (const struct hg_session *it = table->first; it; it = it->next)
        sum += it->bytes.verified;
    return sum;
}

// A session has one at a time: the next one begins where the worker is done with it.
static enum hg_status begin_verify(struct hg_session *s, uint64_t size, struct hg_error *err)
{
    const struct hg_options *o = s->table->options;
    const uint64_t before = s->bytes.verified;
    s->bytes.verified = 0;
    const struct hg_upload_owner *owner = owner_of(s);
    const uint64_t used = owner ? hg_upload_owner_usage(owner).bytes : 0;
    const uint64_t left = o->max_upload_bytes > used ? o->max_upload_bytes - used : 0;
    const uint64_t others = all_verified_bytes(s->table);
    if (size <= left && others <= o->upload_store_bytes && size <= o->upload_store_bytes - others) {
        s->bytes.verified = size;
        return HG_OK;
    }
    s->bytes.verified = before;
    hg_error_set(err, HG_E_LIMIT, "image_query", "size", "%llu bytes are more than %s leaves",
        (unsigned long long)size,
        size > left ? "this session's quota (max-upload)" : "upload-store");
    const bool never = size > o->max_upload_bytes || size > o->upload_store_bytes;
    return hg_error_limit(
        err, size > left ? "max-upload" : "upload-store", never ? 0 : RETRY_VERIFIED_MS);
}

// What was counted when the file began is what may come of it.
enum hg_status hg_session_upload_verify(
    struct hg_session *s, const struct hgp_image_query *m, struct hg_error *err)
{
    const uint64_t size = m->has_size ? m->size : 0;
    if (!m->has_offset)
        return HG_OK;
    if (m->offset && size != s->bytes.verified)
        return hg_error_set(err, HG_E_INVAL, "image_query", "size",
            "is %llu, and was %llu where the file began", (unsigned long long)size,
            (unsigned long long)s->bytes.verified);
    if (m->offset > size || m->data.size > size - m->offset)
        return hg_error_set(err, HG_E_INVAL, "image_query", "data",
            "%llu bytes at offset %llu exceed the file size of %llu",
            (unsigned long long)m->data.size, (unsigned long long)m->offset,
            (unsigned long long)size);
    return m->offset ? HG_OK : begin_verify(s, size, err);
}

void hg_session_upload_verified(struct hg_session *s, const struct hg_request *request)
{
    for (const struct hg_request *it = s->first; it; it = it->next)
        if (it != request && it->packet->header.type == HGP_T_image_query)
            return; // another one is on its way
    s->bytes.verified = 0;
}
