#include "server/broker/state/handover.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "server/broker/session/session.h"
#include "server/broker/session/session_request.h"
#include "server/broker/session/session_sync.h"
#include "server/broker/session/session_upload.h"
#include "server/broker/session/session_view.h"
#include "server/broker/state/state.h"
#include "server/broker/state/state_file.h"

// Kinds of records, beside those of enum hg_state_kind.
enum { LINK = 0x100, SCENE, SESSION, VIEW, CONN, LISTENER };

// ---- quiet --------------------------------------------------------------------------------------

static bool has_uploads(const struct hg_session *s)
{
    for (size_t i = 0; i < HG_SESSION_UPLOADS; i++)
        if (s->uploads[i])
            return true;
    return false;
}

static bool is_link_quiet(const struct hg_link *link)
{
    if (!link->whose.wanted)
        return true;
    return link->state == HG_LINK_UP && !link->out.head && !link->replay.scene &&
           !link->trial.session && !link->trial.waiting;
}

bool hg_handover_is_quiet(const struct hg_handover *h)
{
    const struct hg_session_table *table = h->sessions;
    if (hg_session_sync_waits(table, NULL) || !hg_session_upload_is_quiet(table))
        return false;
    for (const struct hg_session *it = table->first; it; it = it->next)
        if (it->load.count || has_uploads(it) || it->bytes.verified ||
            (!it->conn && !it->resume.parked_ns) || (it->scene && !it->attached))
            return false;
    for (uint32_t i = 0; i < table->pool->count; i++)
        if (!is_link_quiet(&table->pool->links[i]))
            return false;
    for (const struct hg_conn *it = h->conns->first; it; it = it->next)
        if (it->state != HG_CONN_OPEN || !it->session)
            return false;
    return true;
}

uint32_t hg_handover_shed(const struct hg_handover *h, bool all)
{
    uint32_t count = 0;
    for (struct hg_conn *it = h->conns->first, *next; it; it = next) {
        unsigned kind;
        next = it->next;
        if (hg_conn_is_between(it) ||
            (all && it->state == HG_CONN_OPEN && !hg_conn_kind(it, &kind))) {
            hg_conn_kill(it, "a new program takes over: its client comes again");
            count++;
        }
    }
    return count;
}

static void hurry_session(struct hg_session *s)
{
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_CANCELLED, "request", NULL,
        "the daemon is replaced by a new one (SIGUSR2); ask again");
    for (struct hg_request *it = s->first, *next; it; it = next) {
        next = it->next;
        if (hg_journal_wants(it->packet->header.type))
            continue;
        if (s->conn)
            hg_conn_fail(s->conn, it->client_id, &err);
        hg_session_request_drop(s, it);
    }
    hg_session_upload_verified(s, NULL);
    hg_session_upload_fail_all(s, &err);
}

void hg_handover_hurry(const struct hg_handover *h)
{
    for (struct hg_session *it = h->sessions->first; it; it = it->next)
        hurry_session(it);
    for (struct hg_conn *it = h->conns->first, *next; it; it = next) {
        next = it->next;
        if (it->state != HG_CONN_OPEN)
            hg_conn_kill(it, "the daemon is replaced");
    }
}

// ---- saving -------------------------------------------------------------------------------------

static struct hg_writer begin(uint16_t kind)
{
    struct hg_writer w = {0};
    hg_write_u16(&w, kind);
    return w;
}

static void put_text(struct hg_writer *w, const char *text)
{
    size_t size = text ? strlen(text) : 0;
    hg_write_u16(w, (uint16_t)size);
    if (size)
        hg_write_bytes(w, text, size);
}

static void append(const struct hg_handover *h, struct hg_writer *w)
{
    hg_state_log_append(h->sessions->scenes.log, w, NULL);
}

static void save_link(const struct hg_handover *h, uint32_t index)
{
    const struct hg_link *link = &h->sessions->pool->links[index];
    struct hg_writer w = begin(LINK);
    hg_write_u32(&w, index);
    hg_write_u32(&w, (uint32_t)link->transport.fd);
    hg_write_u32(&w, (uint32_t)link->pid);
    hg_write_u32(&w, link->deaths);
    hg_write_u32(&w, link->last_id);
    hg_write_u8(&w, link->no_spill);
    hg_write_u32(&w, link->whose.weight);
    put_text(&w, link->whose.tenant);
    hg_packet_save_input(&link->in, &w);
    append(h, &w);
}

static void save_camera(struct hg_writer *w, const struct hg_scene_camera *camera)
{
    const struct hg_packet *pose = camera->pose;
    hg_write_u32(w, camera->holder);
    hg_write_u8(w, camera->locked);
    hg_write_u32(w, camera->mover);
    hg_write_u32(w, pose ? pose->header.length : 0);
    if (pose)
        hg_write_bytes(w, pose->payload, pose->header.length);
}

static void save_scene(const struct hg_handover *h, const struct hg_shared_scene *scene)
{
    const uint64_t now_ns = h->sessions->loop->now_ns;
    struct hg_writer w = begin(SCENE);
    hg_write_u32(&w, scene->number);
    hg_write_u32(&w, (uint32_t)(scene->link - h->sessions->pool->links));
    hg_write_u8(&w, scene->in_worker);
    hg_write_u8(&w, scene->on_channel);
    hg_write_u64(&w, scene->revision);
    put_text(&w, scene->key); // as the worker knows it
    hg_write_u64(&w, scene->kept_until_ns > now_ns ? scene->kept_until_ns - now_ns
                     : scene->kept_until_ns        ? 1
                                                   : 0);
    save_camera(&w, &scene->people.camera);
    append(h, &w);
}

static void save_view(
    const struct hg_handover *h, const struct hg_session *s, const struct hg_session_view *view)
{
    struct hg_writer w = begin(VIEW);
    hg_write_u32(&w, s->number);
    hg_write_u32(&w, view->number);
    hg_write_u8(&w, view->subscribed);
    hg_write_u8(&w, view->resubscribe);
    hg_write_u32(&w, view->credit);
    hg_write_u32(&w, view->first_credit);
    hg_write_u32(&w, view->granted);
    hg_write_u64(&w, view->frame_bytes);
    hg_write_u64(&w, view->last_number);
    hg_write_u64(&w, view->number_base);
    append(h, &w);
}

static void save_session(const struct hg_handover *h, const struct hg_session *s)
{
    struct hg_writer w = begin(SESSION);
    hg_write_u32(&w, s->number);
    hg_write_u8(&w, s->resume.has_ticket);
    hg_write_u8(&w, s->attached);
    hg_write_u64(&w, s->resume.parked_ns ? h->sessions->loop->now_ns - s->resume.parked_ns + 1 : 0);
    hg_write_u32(&w, s->load.poisons);
    hg_write_u64(&w, s->bytes.uploaded);
    hg_write_u64(&w, (uint64_t)s->scope.expires_s);
    hg_write_u32(&w, s->scope.max_sessions);
    hg_write_u32(&w, s->scope.max_rate);
    hg_write_u32(&w, s->scope.weight);
    put_text(&w, s->scope.scenes);
    hg_write_u32(&w, s->scope.max_pixels);
    hg_write_u32(&w, s->scope.max_tickets);
    hg_write_u8(&w, s->scope.is_ticket);
    hg_write_u8(&w, s->resume.only);
    hg_write_u64(&w, s->pace.statistics_ns);
    put_text(&w, s->scope.roots);
    append(h, &w);
    for (const struct hg_session_view *it = s->views; it; it = it->next)
        save_view(h, s, it);
}

static void save_conn(const struct hg_handover *h, const struct hg_conn *conn)
{
    struct hg_writer w = begin(CONN);
    unsigned kind;
    if (!hg_conn_kind(conn, &kind)) // hg_handover_shed has closed all such
        return;
    hg_write_u32(&w, (uint32_t)conn->transport.fd);
    hg_write_u8(&w, (uint8_t)kind);
    hg_write_u32(&w, conn->session->number);
    hg_write_u16(&w, conn->version);
    hg_write_u8(&w, conn->peer_ended);
    hg_write_u8(&w, conn->auth.has_token);
    hg_write_bytes(&w, conn->auth.hash, sizeof conn->auth.hash);
    hg_write_f64(&w, conn->rate.per_second);
    put_text(&w, conn->client);
    hg_conn_save(conn, &w);
    append(h, &w);
}

static void save_listener(const struct hg_handover *h, const struct hg_listener *it)
{
    struct hg_writer w = begin(LISTENER);
    hg_write_u32(&w, (uint32_t)it->source.fd);
    put_text(&w, it->unix_path);
    hg_write_u8(&w, it->tls);
    append(h, &w);
}

static void save_all(const struct hg_handover *h)
{
    const struct hg_session_table *table = h->sessions;
    hg_state_put_all(h->sessions);
    for (uint32_t i = 0; i < table->pool->count; i++)
        if (table->pool->links[i].whose.wanted)
            save_link(h, i);
    for (const struct hg_shared_scene *it = table->scenes.first; it; it = it->next)
        save_scene(h, it);
    for (const struct hg_session *it = table->first; it; it = it->next)
        save_session(h, it);
    for (const struct hg_conn *it = h->conns->first; it; it = it->next)
        save_conn(h, it);
    for (const struct hg_listener *it = *h->listeners; it; it = it->next)
        save_listener(h, it);
}

static void keep_fd(int fd, bool keep)
{
    fcntl(fd, F_SETFD, keep ? 0 : FD_CLOEXEC);
}

void hg_handover_keep_open(const struct hg_handover *h)
{
    const struct hg_worker_pool *pool = h->sessions->pool;
    for (uint32_t i = 0; i < pool->count; i++)
        if (pool->links[i].state != HG_LINK_DOWN)
            keep_fd(pool->links[i].transport.fd, true);
    for (const struct hg_conn *it = h->conns->first; it; it = it->next)
        keep_fd(it->transport.fd, true);
    for (const struct hg_listener *it = *h->listeners; it; it = it->next)
        keep_fd(it->source.fd, true);
}

enum hg_status hg_handover_save(const struct hg_handover *h, int *fd, struct hg_error *err)
{
    struct hg_session_table *table = h->sessions;
    struct hg_state_log *real = table->scenes.log, *memory = hg_state_log_create_memory();
    *fd = memory ? memfd_create("heliod", 0) : -1;
    enum hg_status status = !memory ? HG_E_NOMEM : *fd < 0 ? hg_status_from_errno(errno) : HG_OK;
    if (!status) {
        table->scenes.log = table->quarantine->log = memory;
        table->records_all = true;
        save_all(h);
        table->records_all = false;
        table->scenes.log = table->quarantine->log = real;
        status = hg_state_log_write_memory(memory, *fd);
    }
    hg_state_log_close(memory);
    if (status && *fd >= 0)
        close(*fd);
    if (status)
        *fd = -1;
    return status ? hg_error_set(err, status, "SIGUSR2", NULL, "the state cannot be saved: %s",
                        hg_status_text(status))
                  : HG_OK;
}

// ---- loading ------------------------------------------------------------------------------------

static void take_text(struct hg_reader *r, char *out, size_t size)
{
    uint16_t length = hg_read_u16(r);
    const uint8_t *text = hg_read_bytes(r, length);
    snprintf(out, size, "%.*s", text ? (int)length : 0, text ? (const char *)text : "");
}

static enum hg_status load_link(const struct hg_handover *h, struct hg_reader *r)
{
    struct hg_worker_pool *pool = h->sessions->pool;
    uint32_t index = hg_read_u32(r);
    int fd = (int)hg_read_u32(r);
    pid_t pid = (pid_t)hg_read_u32(r);
    if (r->failed || index >= pool->count)
        return HG_E_FORMAT; // max-workers is smaller now: not restored, and refused before
    struct hg_link *link = &pool->links[index];
    link->deaths = hg_read_u32(r);
    link->last_id = hg_read_u32(r);
    link->no_spill = hg_read_u8(r);
    link->whose.weight = hg_read_u32(r);
    take_text(r, link->whose.tenant, sizeof link->whose.tenant);
    link->whose.wanted = true;
    link->whose.idle_ns = link->loop->now_ns;
    keep_fd(fd, false);
    return hg_link_adopt(link, fd, pid, r);
}

// Not there where the program before had no shared cameras.
static bool load_camera(
    const struct hg_session_table *table, struct hg_reader *r, struct hg_scene_camera *out)
{
    struct hgp_view_camera m;
    if (r->failed || r->pos == r->size)
        return !r->failed;
    out->holder = hg_read_u32(r);
    out->locked = hg_read_u8(r) != 0;
    out->mover = hg_read_u32(r);
    out->since_ns = out->moved_ns = table->loop->now_ns;
    const uint32_t size = hg_read_u32(r);
    const uint8_t *pose = size ? hg_read_bytes(r, size) : NULL;
    if (!pose)
        return !r->failed;
    if (hgp_decode(HGP_VERSION_MAX, HGP_T_view_camera, hg_reader_make(pose, size), NULL, &m, NULL))
        return false;
    out->pose = hg_packet_encode(HGP_T_view_camera, &m);
    return out->pose != NULL;
}

static enum hg_status load_scene(const struct hg_handover *h, struct hg_reader *r)
{
    struct hg_session_table *table = h->sessions;
    struct hg_shared_scene *scene = hg_shared_scene_by_number(&table->scenes, hg_read_u32(r));
    uint32_t index = hg_read_u32(r);
    if (!scene || index >= table->pool->count)
        return HG_E_FORMAT;
    struct hg_scene_place place = {.link = &table->pool->links[index]};
    place.in_worker = hg_read_u8(r);
    place.on_channel = hg_read_u8(r);
    place.revision = hg_read_u64(r);
    take_text(r, scene->key, sizeof scene->key);
    uint64_t kept_ns = hg_read_u64(r);
    place.kept_until_ns = kept_ns ? table->loop->now_ns + kept_ns : 0;
    if (!load_camera(table, r, &scene->people.camera) ||
        (!place.kept_until_ns && scene->sessions < 2))
        return HG_E_FORMAT;
    hg_shared_scene_settle(scene, &place);
    return HG_OK;
}

static enum hg_status load_session(const struct hg_handover *h, struct hg_reader *r)
{
    struct hg_session *s = hg_session_find(h->sessions, hg_read_u32(r));
    if (!s)
        return HG_E_FORMAT;
    const uint64_t now_ns = h->sessions->loop->now_ns;
    s->resume.has_ticket = hg_read_u8(r);
    s->attached = hg_read_u8(r);
    uint64_t parked_ns = hg_read_u64(r);
    s->resume.parked_ns = !parked_ns ? 0 : parked_ns < now_ns ? now_ns - parked_ns : 1;
    s->load.poisons = hg_read_u32(r);
    s->bytes.uploaded = hg_read_u64(r);
    s->scope.expires_s = (int64_t)hg_read_u64(r);
    s->scope.max_sessions = hg_read_u32(r);
    s->scope.max_rate = hg_read_u32(r);
    s->scope.weight = hg_read_u32(r);
    take_text(r, s->scope.scenes, sizeof s->scope.scenes);
    if (r->failed || r->pos == r->size) // of a program before
        return HG_OK;
    s->scope.max_pixels = hg_read_u32(r);
    s->scope.max_tickets = hg_read_u32(r);
    s->scope.is_ticket = hg_read_u8(r) != 0;
    s->resume.only = hg_read_u8(r) != 0;
    s->pace.statistics_ns = hg_read_u64(r);
    if (!r->failed && r->pos < r->size)
        take_text(r, s->scope.roots, sizeof s->scope.roots);
    return HG_OK;
}

static enum hg_status load_view(const struct hg_handover *h, struct hg_reader *r)
{
    struct hg_session *s = hg_session_find(h->sessions, hg_read_u32(r));
    uint32_t number = hg_read_u32(r);
    struct hg_session_view *view = s ? hg_session_view_find(s, number) : NULL;
    if (!view) // of a quota that is smaller now
        return s ? HG_OK : HG_E_FORMAT;
    view->subscribed = hg_read_u8(r);
    view->resubscribe = hg_read_u8(r);
    view->credit = hg_read_u32(r);
    view->first_credit = hg_read_u32(r);
    view->granted = hg_read_u32(r);
    view->frame_bytes = hg_read_u64(r);
    view->last_number = hg_read_u64(r);
    view->number_base = hg_read_u64(r);
    view->credit_ns = h->sessions->loop->now_ns;
    return HG_OK;
}

struct saved_conn {
    int fd;
    uint8_t kind;
    bool peer_ended, has_token;
    uint16_t version;
    struct hg_session *session;
    uint8_t hash[32];
    double rate;
    char client[129];
};

static bool read_conn(const struct hg_handover *h, struct hg_reader *r, struct saved_conn *out)
{
    out->fd = (int)hg_read_u32(r);
    out->kind = hg_read_u8(r);
    out->session = hg_session_find(h->sessions, hg_read_u32(r));
    out->version = hg_read_u16(r);
    out->peer_ended = hg_read_u8(r);
    out->has_token = hg_read_u8(r);
    const uint8_t *hash = hg_read_bytes(r, sizeof out->hash);
    if (hash)
        memcpy(out->hash, hash, sizeof out->hash);
    out->rate = hg_read_f64(r);
    take_text(r, out->client, sizeof out->client);
    return !r->failed && out->session && !out->session->conn;
}

static enum hg_status load_conn(const struct hg_handover *h, struct hg_reader *r)
{
    struct saved_conn saved = {0};
    if (!read_conn(h, r, &saved))
        return HG_E_FORMAT;
    keep_fd(saved.fd, false);
    struct hg_conn *conn = hg_conn_adopt(h->conns, saved.fd, saved.kind, r);
    if (!conn)
        return HG_E_NOMEM;
    conn->session = saved.session;
    conn->session->conn = conn;
    conn->number = conn->session->number;
    conn->version = saved.version;
    conn->peer_ended = saved.peer_ended;
    conn->auth.has_token = saved.has_token;
    memcpy(conn->auth.hash, saved.hash, sizeof conn->auth.hash);
    snprintf(conn->auth.name, sizeof conn->auth.name, "%.32s", conn->session->name);
    snprintf(conn->client, sizeof conn->client, "%s", saved.client);
    hg_conn_set_open(conn, saved.rate);
    hg_conn_update(conn);
    return HG_OK;
}

static enum hg_status load_listener(
    const struct hg_handover *h, struct hg_reader *r, struct hg_error *err)
{
    char path[256];
    int fd = (int)hg_read_u32(r);
    take_text(r, path, sizeof path);
    const bool tls = r->pos < r->size && hg_read_u8(r); // none from programs before TLS
    if (r->failed)
        return HG_E_FORMAT;
    keep_fd(fd, false);
    enum hg_status status = hg_listener_adopt(fd, h->listeners, err);
    if (!status && path[0])
        status = hg_listener_own(*h->listeners, path);
    if (!status && tls)
        hg_listener_set_tls(*h->listeners);
    return status;
}

static enum hg_status load_record(
    const struct hg_handover *h, const uint8_t *body, size_t size, struct hg_error *err)
{
    struct hg_reader r = hg_reader_make(body, size);
    switch (hg_read_u16(&r)) {
    case LINK:
        return load_link(h, &r);
    case SCENE:
        return load_scene(h, &r);
    case SESSION:
        return load_session(h, &r);
    case VIEW:
        return load_view(h, &r);
    case CONN:
        return load_conn(h, &r);
    case LISTENER:
        return load_listener(h, &r, err);
    default:
        return hg_state_take_record(h->sessions, body, size);
    }
}

static enum hg_status load_bytes(
    const struct hg_handover *h, struct hg_reader *r, struct hg_error *err)
{
    const uint8_t *body;
    size_t size;
    enum hg_status status = hg_state_header_decode(r);
    while (!status && (status = hg_state_record_next(r, &body, &size)) == HG_OK)
        status = load_record(h, body, size, err);
    return status == HG_E_AGAIN ? HG_OK : status;
}

enum hg_status hg_handover_load(const struct hg_handover *h, int fd, struct hg_error *err)
{
    struct stat st;
    void *data = MAP_FAILED;
    enum hg_status status = HG_E_FORMAT;
    if (fstat(fd, &st) == 0 && st.st_size > 0)
        data = mmap(NULL, (size_t)st.st_size, PROT_READ, MAP_PRIVATE, fd, 0);
    if (data != MAP_FAILED) {
        struct hg_reader r = hg_reader_make(data, (size_t)st.st_size);
        status = load_bytes(h, &r, err);
        munmap(data, (size_t)st.st_size);
    }
    close(fd);
    return status
               ? hg_error_set(err, status, "SIGUSR2", NULL,
                     "what the program before has left makes no sense: %s", hg_status_text(status))
               : HG_OK;
}
