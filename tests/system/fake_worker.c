// fake_worker.c - a worker without a renderer: keeps scenes as merged messages, answers as the real
// one does, and falls over on request. For tests of the broker.
//
// A frame's data begins with the SHA-256 of everything that the frame shows (scene, view, camera),
// so that equal frames mean equal states. The rest is filled up to width x height x 4 bytes.
// info_query is answered by a MiB of blanks. A view's `seed` delays its frames by so many ms; asset
// paths "slow=MS" delay their load.
//
// Tripwires: fake_tripwires.h.
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/sha256.h"
#include "tests/system/fake_scene.h"
#include "tests/system/fake_tripwires.h"

enum { LINK_FD = 3, BUCKETS = 4096, MAX_VIEWS = 16, MAX_DELAYED = 256, PULSE_MS = 100 };

struct scene {
    struct scene *next;
    char key[256];
    uint32_t users;
    uint64_t revision;
    struct fake_scene state;
};

struct view {
    uint32_t number, credit;
    struct hg_packet *params, *camera;
    uint64_t frames, sent_ns, moved_ns; // moved: when its camera came
    struct hg_packet *looks[64];        // view_clip, view_overrides, view_variant: those that count
    uint32_t look_count;
};

struct channel {
    struct channel *next; // in its bucket
    uint32_t number;
    struct scene *scene;
    uint32_t first_id, id_count;
    char roots[64]; // of session_tenant
    bool in_batch;
    struct view views[MAX_VIEWS];
    bool subscribed;           // one of them may have credit
    uint64_t blocked_until_ns; // a slow load runs; later messages wait
    struct hg_packet *waiting[1024];
    uint32_t waiting_count;
};

struct delayed {
    struct hg_packet *packet; // NULL = free
    uint64_t due_ns;
};

static struct channel *channels[BUCKETS]; // by number
static struct scene *scenes[BUCKETS];     // by key
static struct delayed delayed[MAX_DELAYED];
static struct hg_outq out;
static struct fake_trip tripped;

// ---- answers ------------------------------------------------------------------------------------

static void push(uint32_t channel, uint32_t request, struct hg_packet *packet)
{
    if (!packet || hg_outq_push(&out, packet, request, channel))
        abort();
}

static void answer(const struct hgp_header *to, enum hgp_type type, const void *message)
{
    push(to->channel, to->request, hg_packet_encode(type, message));
}

static void refuse(const struct hgp_header *to, enum hg_status status, const char *reason)
{
    answer(to, HGP_T_error,
        &(struct hgp_error){.code = (uint16_t)status,
            .what = hgp_str_make(hgp_find(to->type)->name),
            .reason = hgp_str_make(reason)});
}

static void refuse_limit(const struct hgp_header *to, const char *limit, uint32_t retry_after_ms)
{
    const struct hgp_limited limited = {
        .request = to->request, .limit = hgp_str_make(limit), .retry_after_ms = retry_after_ms};
    push(to->channel, 0, hg_packet_encode(HGP_T_limited, &limited));
    refuse(to, HG_E_LIMIT, "too many");
}

static void accept_edit(struct channel *c, const struct hgp_header *to)
{
    c->scene->revision += !c->in_batch;
    if (to->request)
        answer(to, HGP_T_ok, &(struct hgp_ok){.revision = c->scene->revision});
}

// ---- scenes -------------------------------------------------------------------------------------

static void edit(struct channel *c, struct hg_packet *packet)
{
    enum hg_status status = fake_scene_apply(&c->scene->state, packet, c->first_id, c->id_count);
    if (status)
        refuse(&packet->header, status, hg_status_text(status));
    else
        accept_edit(c, &packet->header);
}

static void finish_load(struct channel *c, struct hg_packet *packet, uint32_t asset)
{
    enum hg_status status = fake_scene_apply(&c->scene->state, packet, 1, UINT32_MAX);
    if (status) {
        refuse(&packet->header, status, hg_status_text(status));
        return;
    }
    c->scene->revision += !c->in_batch;
    answer(&packet->header, HGP_T_asset_loaded,
        &(struct hgp_asset_loaded){
            .asset = asset, .revision = c->scene->revision, .nodes = 1, .triangles = 12});
}

static void asset_load(struct channel *c, struct hg_packet *packet, const struct hgp_asset_load *m)
{
    char path[64];
    snprintf(path, sizeof path, "%.*s", (int)m->path.size, m->path.data ? m->path.data : "");
    if (strcmp(path, "fail") == 0)
        refuse(&packet->header, HG_E_FORMAT, "a broken file");
    else if (strncmp(path, "within=", 7) == 0 && strcmp(path + 7, c->roots) != 0)
        refuse(&packet->header, HG_E_PERM, "the session's files lie elsewhere");
    else if (strncmp(path, "slow=", 5) == 0 && !c->blocked_until_ns) {
        c->blocked_until_ns = hg_clock_now_ns() + strtoull(path + 5, NULL, 10) * 1000000;
        c->waiting[c->waiting_count++] = hg_packet_ref(packet);
        answer(&packet->header, HGP_T_progress,
            &(struct hgp_progress){.stage = hgp_str_make("load"), .total = 1});
    } else
        finish_load(c, packet, m->asset);
}

// ---- views --------------------------------------------------------------------------------------

static struct view *find_view(struct channel *c, uint32_t number)
{
    for (int i = 0; i < MAX_VIEWS; i++)
        if (c->views[i].number == number)
            return &c->views[i];
    return NULL;
}

// The state that a frame shows, whatever the order in which it came about.
static void digest(struct channel *c, struct view *view, uint8_t hash[32])
{
    struct hg_sha256 *h = hg_sha256_create();
    if (!h)
        abort();
    fake_scene_hash(&c->scene->state, h);
    hg_sha256_update(h, view->params->payload, view->params->header.length);
    if (view->camera)
        hg_sha256_update(h, view->camera->payload, view->camera->header.length);
    for (uint32_t i = 0; i < view->look_count; i++)
        hg_sha256_update(h, view->looks[i]->payload, view->looks[i]->header.length);
    hg_sha256_end(h, hash);
}

static struct hgp_view_set params_of(const struct view *view)
{
    struct hgp_view_set m = {0};
    if (hgp_decode(1, HGP_T_view_set,
            hg_reader_make(view->params->payload, view->params->header.length), NULL, &m, NULL))
        abort();
    return m;
}

static struct hg_packet *make_frame(struct channel *c, struct view *view)
{
    struct hgp_view_set params = params_of(view);
    uint32_t width = params.has_width ? params.width : 1280;
    uint32_t height = params.has_height ? params.height : 720;
    uint64_t input_seq = 0;
    if (view->camera) {
        struct hgp_view_camera camera;
        if (hgp_decode(1, HGP_T_view_camera,
                hg_reader_make(view->camera->payload, view->camera->header.length), NULL, &camera,
                NULL))
            abort();
        input_seq = camera.input_seq;
    }
    size_t size = (size_t)width * height * 4;
    uint8_t *data = hg_calloc(size < 32 ? 32 : size, 1);
    if (!data)
        abort();
    digest(c, view, data);
    const uint64_t now_ns = hg_clock_now_ns(), moved_ns = view->moved_ns ? view->moved_ns : now_ns;
    struct hg_packet *packet =
        hg_packet_encode(HGP_T_frame, &(struct hgp_frame){.view = view->number,
                                          .number = ++view->frames,
                                          .scene_revision = c->scene->revision,
                                          .input_seq = input_seq,
                                          .width = width,
                                          .height = height,
                                          .samples = 1,
                                          .settled = true,
                                          .lossless = true,
                                          .has_input_ns = true,
                                          .input_ns = moved_ns,
                                          .has_taken_ns = true,
                                          .taken_ns = moved_ns,
                                          .has_render_begin_ns = true,
                                          .render_begin_ns = now_ns,
                                          .has_render_end_ns = true,
                                          .render_end_ns = now_ns,
                                          .has_encode_begin_ns = true,
                                          .encode_begin_ns = now_ns,
                                          .has_encode_end_ns = true,
                                          .encode_end_ns = now_ns,
                                          .has_sent_ns = true,
                                          .sent_ns = now_ns,
                                          .data = {data, (uint32_t)(size < 32 ? 32 : size)}});
    hg_free(data);
    return packet;
}

static void delay(struct hg_packet *packet, uint64_t due_ns)
{
    for (int i = 0; i < MAX_DELAYED; i++)
        if (!delayed[i].packet) {
            delayed[i] = (struct delayed){hg_packet_ref(packet), due_ns};
            return;
        }
    abort();
}

static void frame_request(
    struct channel *c, struct hg_packet *packet, const struct hgp_frame_request *m)
{
    struct view *view = find_view(c, m->view);
    if (!view || !m->view) {
        refuse(&packet->header, HG_E_NOTFOUND, "no such view");
        return;
    }
    struct hgp_view_set params = params_of(view);
    if (params.has_seed && params.seed && !(packet->header.flags & 0x8000)) {
        packet->header.flags |= 0x8000; // answered when it comes back
        delay(packet, hg_clock_now_ns() + params.seed * 1000000ull);
        return;
    }
    push(packet->header.channel, packet->header.request, make_frame(c, view));
}

// Of a frame that is delayed.
static void frame_cancel(const struct hg_packet *packet, const struct hgp_frame_cancel *m)
{
    for (int i = 0; i < MAX_DELAYED; i++) {
        struct hg_packet *frame = delayed[i].packet;
        if (!frame || frame->header.channel != packet->header.channel ||
            frame->header.request != m->request)
            continue;
        refuse(&frame->header, HG_E_CANCELLED, "cancelled");
        delayed[i].packet = NULL;
        hg_packet_unref(frame);
    }
    if (packet->header.request)
        answer(&packet->header, HGP_T_ok, &(struct hgp_ok){0});
}

static void view_set(struct channel *c, struct hg_packet *packet, uint32_t number)
{
    struct view *view = find_view(c, number);
    if (!view)
        view = find_view(c, 0);
    if (!view) {
        refuse_limit(&packet->header, "fake-views", 250);
        return;
    }
    view->number = number;
    fake_merge(&view->params, packet);
    if (packet->header.request)
        answer(&packet->header, HGP_T_ok, &(struct hgp_ok){.revision = c->scene->revision});
}

static void drop_view(struct view *view)
{
    hg_packet_unref(view->params);
    hg_packet_unref(view->camera);
    for (uint32_t i = 0; i < view->look_count; i++)
        hg_packet_unref(view->looks[i]);
    *view = (struct view){0};
}

// A newer view_clip takes the place of an older one, view_overrides only with clear.
static void take_look(struct view *view, struct hg_packet *packet, const union hgp_any *m)
{
    const uint16_t type = packet->header.type;
    const bool replaces =
        type == HGP_T_view_clip || (type == HGP_T_view_overrides && m->view_overrides.clear);
    uint32_t kept = 0;
    for (uint32_t i = 0; i < view->look_count; i++) {
        if (replaces && view->looks[i]->header.type == type)
            hg_packet_unref(view->looks[i]);
        else
            view->looks[kept++] = view->looks[i];
    }
    view->look_count = kept;
    if (kept == sizeof view->looks / sizeof *view->looks)
        abort();
    view->looks[view->look_count++] = hg_packet_ref(packet);
}

// When it came is no part of the state.
static void merge_camera(struct view *view, const struct hgp_view_camera *m)
{
    struct hgp_view_camera camera = *m;
    camera.has_received_ns = false;
    view->moved_ns = m->has_received_ns ? m->received_ns : 0;
    struct hg_packet *packet = hg_packet_encode(HGP_T_view_camera, &camera);
    fake_merge(&view->camera, packet);
    hg_packet_unref(packet);
}

static void view_message(struct channel *c, struct hg_packet *packet, const union hgp_any *m)
{
    struct hg_reader r = hg_reader_make(packet->payload, packet->header.length);
    if (packet->header.type == HGP_T_view_camera || packet->header.type == HGP_T_delivered ||
        packet->header.type == HGP_T_view_clip || packet->header.type == HGP_T_view_overrides)
        hg_read_u32(&r); // bitmap
    uint32_t number = hg_read_u32(&r);
    struct view *view = number ? find_view(c, number) : NULL;
    if (!view) {
        refuse(&packet->header, HG_E_NOTFOUND, "no such view");
        return;
    }
    switch (packet->header.type) {
    case HGP_T_view_camera:
        merge_camera(view, &m->view_camera);
        return; // never answered
    case HGP_T_delivered:
        return;
    case HGP_T_credit:
        view->credit += m->credit.frames;
        c->subscribed = true;
        return;
    case HGP_T_subscribe:
        view->credit = m->subscribe.credit_frames;
        c->subscribed = true;
        break;
    case HGP_T_view_clip:
    case HGP_T_view_overrides:
    case HGP_T_view_variant:
        take_look(view, packet, m);
        break;
    default:
        drop_view(view);
    }
    if (packet->header.request)
        answer(&packet->header, HGP_T_ok, &(struct hgp_ok){.revision = c->scene->revision});
}

// ---- sessions -----------------------------------------------------------------------------------

static struct channel *find_channel(uint32_t number)
{
    struct channel *c = channels[number % BUCKETS];
    while (c && c->number != number)
        c = c->next;
    return c;
}

// By FNV-1a.
static struct scene **bucket_of(const char *key, size_t size)
{
    uint32_t hash = 2166136261u;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ (uint8_t)key[i]) * 16777619u;
    return &scenes[hash % BUCKETS];
}

static struct scene *hold_scene(struct hgp_str key)
{
    struct scene **bucket = bucket_of(key.data, key.size);
    for (struct scene *it = *bucket; it; it = it->next)
        if (strlen(it->key) == key.size && memcmp(it->key, key.data, key.size) == 0) {
            it->users++;
            return it;
        }
    struct scene *scene = hg_calloc(1, sizeof *scene);
    if (!scene)
        abort();
    snprintf(scene->key, sizeof scene->key, "%.*s", (int)key.size, key.data);
    scene->users = 1;
    scene->next = *bucket;
    *bucket = scene;
    return scene;
}

static void attach(uint32_t number, const struct hgp_session_attach *m)
{
    struct channel *c = find_channel(number) ? NULL : hg_calloc(1, sizeof *c);
    if (!c)
        abort(); // attached twice
    c->next = channels[number % BUCKETS];
    channels[number % BUCKETS] = c;
    c->number = number;
    c->scene = hold_scene(m->scene);
    c->first_id = m->first_id;
    c->id_count = m->id_count;
}

static void detach(struct channel *c)
{
    for (int i = 0; i < MAX_VIEWS; i++)
        drop_view(&c->views[i]);
    for (uint32_t i = 0; i < c->waiting_count; i++)
        hg_packet_unref(c->waiting[i]);
    if (--c->scene->users == 0) {
        struct scene **link = bucket_of(c->scene->key, strlen(c->scene->key));
        while (*link != c->scene)
            link = &(*link)->next;
        *link = c->scene->next;
        fake_scene_finish(&c->scene->state);
        hg_free(c->scene);
    }
    struct channel **link = &channels[c->number % BUCKETS];
    while (*link != c)
        link = &(*link)->next;
    *link = c->next;
    hg_free(c);
}

// ---- dispatch -----------------------------------------------------------------------------------

// A large text, for a large answer.
static char blanks[1 << 20];

static void serve(struct channel *c, struct hg_packet *packet, const union hgp_any *m)
{
    const struct hgp_header *to = &packet->header;
    switch (to->type) {
    case HGP_T_session_detach:
        detach(c);
        return;
    case HGP_T_session_tenant:
        snprintf(c->roots, sizeof c->roots, "%.*s", (int)m->session_tenant.roots.size,
            m->session_tenant.has_roots ? (const char *)m->session_tenant.roots.data : "");
        return;
    case HGP_T_replay_end:
        if (c->scene->revision < m->replay_end.revision)
            c->scene->revision = m->replay_end.revision;
        return;
    case HGP_T_asset_load:
        asset_load(c, packet, &m->asset_load);
        return;
    case HGP_T_batch_begin:
    case HGP_T_batch_end:
        if (c->in_batch == (to->type == HGP_T_batch_begin)) {
            refuse(to, HG_E_STATE, "batch");
            return;
        }
        c->in_batch = to->type == HGP_T_batch_begin;
        accept_edit(c, to);
        return;
    case HGP_T_view_set:
        view_set(c, packet, m->view_set.view);
        return;
    case HGP_T_frame_request:
        frame_request(c, packet, &m->frame_request);
        return;
    case HGP_T_frame_cancel:
        frame_cancel(packet, &m->frame_cancel);
        return;
    case HGP_T_view_close:
    case HGP_T_view_camera:
    case HGP_T_view_clip:
    case HGP_T_view_overrides:
    case HGP_T_view_variant:
    case HGP_T_subscribe:
    case HGP_T_credit:
    case HGP_T_delivered:
        view_message(c, packet, m);
        return;
    case HGP_T_image_query:
        if (m->image_query.offset + m->image_query.data.size < m->image_query.size)
            answer(to, HGP_T_ok, &(struct hgp_ok){0});
        else
            answer(to, HGP_T_json, &(struct hgp_json){.text = hgp_str_make("{}")});
        return;
    case HGP_T_info_query: // large
        answer(to, HGP_T_json, &(struct hgp_json){.text = {blanks, sizeof blanks}});
        return;
    case HGP_T_stats_query:
        answer(to, HGP_T_json, &(struct hgp_json){.text = hgp_str_make("{\"fake\":true}")});
        return;
    default:
        edit(c, packet);
    }
}

static void handle(struct hg_packet *packet)
{
    const struct hgp_header *to = &packet->header;
    struct hg_arena arena = {0};
    union hgp_any any;
    struct hgp_fault fault;
    if (hgp_decode(
            1, to->type, hg_reader_make(packet->payload, to->length), &arena, &any, &fault)) {
        fprintf(
            stderr, "fake_worker: message 0x%04x does not decode: %s\n", to->type, fault.reason);
        abort(); // the broker lets nothing bad through
    }
    struct channel *c = to->channel ? find_channel(to->channel) : NULL;
    if (!(to->flags & 0x8000))
        fake_trip_message(&tripped, to);
    if (tripped.hung || fake_trip_sticks(&tripped, to)) {
    } else if (to->type == HGP_T_session_attach) {
        attach(to->channel, &any.session_attach);
    } else if (!c) {
        refuse(to, HG_E_STATE, "no session on this channel");
    } else if (c->blocked_until_ns && to->type != HGP_T_session_detach && !(to->flags & 0x8000)) {
        if (c->waiting_count == 1024)
            abort();
        c->waiting[c->waiting_count++] = hg_packet_ref(packet);
    } else {
        serve(c, packet, &any);
    }
    hg_arena_finish(&arena);
}

// ---- time ---------------------------------------------------------------------------------------

static void run_waiting(struct channel *c)
{
    struct hg_packet *waiting[1024];
    uint32_t count = c->waiting_count;
    memcpy(waiting, c->waiting, sizeof waiting);
    c->waiting_count = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (i == 0) { // the load that was slow
            struct hg_arena arena = {0};
            union hgp_any any;
            if (hgp_decode(1, HGP_T_asset_load,
                    hg_reader_make(waiting[0]->payload, waiting[0]->header.length), &arena, &any,
                    NULL))
                abort();
            finish_load(c, waiting[0], any.asset_load.asset);
            hg_arena_finish(&arena);
            c->blocked_until_ns = 0;
        } else {
            handle(waiting[i]);
        }
        hg_packet_unref(waiting[i]);
    }
}

static void run_delayed(uint64_t now_ns)
{
    for (int i = 0; i < MAX_DELAYED; i++)
        if (delayed[i].packet && now_ns >= delayed[i].due_ns) {
            struct hg_packet *packet = delayed[i].packet;
            delayed[i].packet = NULL;
            if (find_channel(packet->header.channel))
                handle(packet);
            hg_packet_unref(packet);
        }
    for (int i = 0; i < BUCKETS; i++)
        for (struct channel *c = channels[i], *next; c; c = next) {
            next = c->next;
            if (c->blocked_until_ns && now_ns >= c->blocked_until_ns)
                run_waiting(c);
        }
}

static void run_subscription(struct channel *c, uint64_t now_ns)
{
    c->subscribed = false;
    for (int k = 0; k < MAX_VIEWS; k++) {
        struct view *view = &c->views[k];
        if (view->credit && now_ns - view->sent_ns >= 3000000) {
            view->credit--;
            view->sent_ns = now_ns;
            push(c->number, 0, make_frame(c, view));
        }
        c->subscribed |= view->credit > 0;
    }
}

// Subscribed views show a frame every few ms while they have credit.
static void run_subscriptions(uint64_t now_ns)
{
    for (int i = 0; i < BUCKETS; i++)
        for (struct channel *c = channels[i]; c; c = c->next)
            if (c->subscribed)
                run_subscription(c, now_ns);
}

static void send_pulse(uint64_t now_ns)
{
    static uint64_t sent_ns;
    if (now_ns - sent_ns < PULSE_MS * 1000000ull)
        return;
    sent_ns = now_ns;
    if (tripped.busy.channel)
        push(0, 0, hg_packet_encode(HGP_T_busy, &tripped.busy));
    push(0, 0,
        hg_packet_encode(
            HGP_T_pulse, &(struct hgp_pulse){
                             .busy_ns = tripped.busy_since_ns ? now_ns - tripped.busy_since_ns : 0,
                             .rss_bytes = 4096}));
}

static void run(void)
{
    struct hgp_framer in = {.frames = &hg_packet_frames};
    struct hg_transport link;
    hg_transport_open(&link, &hg_transport_unix, LINK_FD);
    for (;;) {
        struct pollfd p = {LINK_FD, (short)(POLLIN | (out.head ? POLLOUT : 0)), 0};
        poll(&p, 1, tripped.hung ? -1 : 2);
        while (tripped.hung)
            pause();
        uint64_t now_ns = hg_clock_now_ns();
        if (p.revents & (POLLIN | POLLHUP)) {
            enum hg_status status = hg_packet_receive(&in, &link);
            struct hg_packet *packet;
            while (hg_packet_next(&in, UINT32_MAX, &packet) == HG_OK && packet) {
                handle(packet);
                hg_packet_unref(packet);
            }
            if (status == HG_E_CLOSED)
                exit(0);
        }
        run_delayed(now_ns);
        run_subscriptions(now_ns);
        send_pulse(now_ns);
        if (hg_outq_flush(&out, &link))
            exit(0);
    }
}

int main(int argc, char **argv)
{
    memset(blanks, ' ', sizeof blanks);
    for (int i = 1; i < argc; i++)
        if (strcmp(argv[i], "--device-info") == 0) {
            puts("{\"name\":\"fake\"}");
            return 7; // whatever it is, the daemon passes it on
        } else if (strcmp(argv[i], "--compile-shaders") == 0) {
            return fake_trip("die", "compile", false); // there are none
        }
    char pid[32];
    int n = snprintf(pid, sizeof pid, "%d\n", (int)getpid());
    fake_note("pid", pid, (size_t)n);
    if (fake_trip("die", "start", false) || fake_trip("kill", "start", true))
        return 1;
    push(0, 0,
        hg_packet_encode(HGP_T_worker_ready, &(struct hgp_worker_ready){.pid = (uint32_t)getpid(),
                                                 .device = hgp_str_make("{\"name\":\"fake\"}")}));
    run();
}
