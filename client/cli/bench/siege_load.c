// siege_load.c - clients of a siege. See siege.h.
#include <string.h>

#include "base/clock.h"
#include "base/sha256.h"
#include "base/slice.h"
#include "client/cli/bench/siege.h"

enum { VIEWS = 8, BURST = 64, PATIENCE_MS = 20, NODES = 16, LATE_ROUNDS = 4 };
#define OPEN_NS 10000000000u
#define FULL_NS 2000000u

// ---- what both kinds do -------------------------------------------------------------------------

static enum hg_status open_view(
    struct hg_siege_client *c, uint32_t view, uint32_t side, struct hg_error *err)
{
    const struct hgp_view_set set = {.view = view,
        .has_width = true,
        .width = side,
        .has_height = true,
        .height = side,
        .has_samples = true,
        .samples = 16,
        .has_gi = true,
        .gi = HGP_gi_NONE};
    return helio_call_for(c->h, HGP_T_view_set, &set, HGP_T_ok, NULL, err);
}

static struct hgp_view_camera next_camera(struct hg_siege_client *c, uint32_t view)
{
    const float shift = 0.01f * (float)(++c->seq % 100);
    return (struct hgp_view_camera){.view = view,
        .input_seq = c->seq,
        .has_eye = true,
        .eye = {4 + shift, 2, 4},
        .has_target = true,
        .target = {0, 1, 0}};
}

static enum hg_status take_frame(
    struct hg_siege_client *c, uint32_t view, bool settled, struct hg_error *err)
{
    const struct hgp_view_camera camera = next_camera(c, view);
    struct helio_message *frame;
    enum hg_status status = helio_send(c->h, HGP_T_view_camera, &camera, NULL, err);
    if (status)
        return status;
    status = helio_frame(
        c->h, &(struct hgp_frame_request){.view = view, .settled = settled}, &frame, err);
    helio_message_free(frame);
    return status;
}

// A triangle in white light: what is measured is whose turn it is.
static enum hg_status make_scene(struct hg_siege_client *c, struct hg_error *err)
{
    static const float corners[] = {-1, -1, 0, 1, -1, 0, 0, 1, 0};
    struct hgp_mesh_part part = {.mode = HGP_primitive_mode_TRIANGLES,
        .positions = {(const uint8_t *)corners, sizeof corners}};
    const struct hgp_mesh_set mesh = {.mesh = c->scene.first_id, .parts = {&part, 1}};
    const struct hgp_node_set node = {
        .node = c->scene.first_id, .has_mesh = true, .mesh = c->scene.first_id};
    const struct hgp_environment_set sky = {.has_kind = true,
        .kind = HGP_environment_kind_COLOR,
        .has_color = true,
        .color = {1, 1, 1}};
    enum hg_status status = helio_call(c->h, HGP_T_environment_set, &sky, NULL, err);
    if (!status)
        status = helio_call(c->h, HGP_T_mesh_set, &mesh, NULL, err);
    return status ? status : helio_call(c->h, HGP_T_node_set, &node, NULL, err);
}

static enum hg_status open_session(struct hg_siege_client *c, struct hg_error *err)
{
    const struct helio_options options = {
        .url = c->url, .token = c->token, .timeout_ns = OPEN_NS, .max_receive_bytes = 64 << 20};
    enum hg_status status = helio_connect(&options, &c->h, err);
    if (status)
        return status;
    helio_set_timeout(c->h, 10 * OPEN_NS);
    status = helio_scene_open(c->h, "", &c->scene, err);
    if (!status)
        status = make_scene(c, err);
    for (uint32_t i = 1; i <= c->views && !status; i++)
        status = open_view(c, i, c->side, err);
    return status ? status : take_frame(c, 1, true, err); // all pipelines are there
}

// So many messages a second at most: a flood that takes all of the processors' time measures these.
// Rounds in equal intervals are paced by them.
static void pace(struct hg_siege_client *c)
{
    if (++c->sent % BURST == 0 && !c->interval_ns)
        hg_clock_sleep_ns(BURST * UINT64_C(1000000000) / c->rate);
}

// Sends without reading what comes back: what the library has taken in stays there.
static enum hg_status push(
    struct hg_siege_client *c, enum hgp_type type, const void *message, struct hg_error *err)
{
    uint32_t request;
    pace(c);
    const enum hg_status status = helio_send(c->h, type, message, &request, err);
    if (status == HG_E_AGAIN)
        hg_clock_sleep_ns(FULL_NS); // the daemon does not take it: what is measured needs the cores
    else if (status)
        return status;
    return helio_process(c->h, err);
}

// As above, for messages whose answers are small: they are thrown away. In equal intervals one by
// one, as those that behave.
static enum hg_status push_many(
    struct hg_siege_client *c, enum hgp_type type, const void *message, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    const int count = c->interval_ns ? 1 : BURST;
    for (int i = 0; i < count && !status; i++)
        status = push(c, type, message, err);
    for (struct helio_message *m; !status && helio_next(c->h, &m, NULL) == HG_OK;)
        helio_message_free(m);
    return status;
}

// ---- classes ------------------------------------------------------------------------------------

static enum hg_status pings(struct hg_siege_client *c, struct hg_error *err)
{
    return push(c, HGP_T_ping, &(struct hgp_ping){.nonce = ++c->seq}, err);
}

static enum hg_status ping(struct hg_siege_client *c, struct hg_error *err)
{
    uint64_t ns;
    return helio_ping(c->h, &ns, err);
}

static enum hg_status frames_unread(struct hg_siege_client *c, struct hg_error *err)
{
    const uint32_t view = 1 + (uint32_t)(c->seq % VIEWS);
    const struct hgp_view_camera camera = next_camera(c, view);
    enum hg_status status = push(c, HGP_T_view_camera, &camera, err);
    if (!status)
        status = push(c, HGP_T_frame_request, &(struct hgp_frame_request){.view = view}, err);
    hg_clock_sleep_ns(PATIENCE_MS * 1000000u);
    return status;
}

static enum hg_status frame(struct hg_siege_client *c, struct hg_error *err)
{
    return take_frame(c, 1 + (uint32_t)(c->seq % VIEWS), false, err);
}

static enum hg_status settle_all(struct hg_siege_client *c, struct hg_error *err)
{
    uint32_t waiting = 0;
    enum hg_status status = HG_OK;
    for (uint32_t i = 1; i <= VIEWS && !status; i++, waiting++) {
        const struct hgp_view_camera camera = next_camera(c, i);
        status = push(c, HGP_T_view_camera, &camera, err);
        if (!status)
            status = push(c, HGP_T_frame_request,
                &(struct hgp_frame_request){.view = i, .settled = true}, err);
    }
    while (!status && waiting && !atomic_load(&c->stop)) {
        struct helio_message *m;
        status = helio_wait(c->h, PATIENCE_MS * 1000000u, err);
        status = status == HG_E_TIMEOUT ? HG_OK : status;
        while (helio_next(c->h, &m, NULL) == HG_OK) {
            waiting -= m->type == HGP_T_frame && waiting > 0;
            helio_message_free(m);
        }
    }
    return status;
}

static enum hg_status settle(struct hg_siege_client *c, struct hg_error *err)
{
    return take_frame(c, 1 + (uint32_t)(c->seq % VIEWS), true, err);
}

static const struct hgp_pick middle = {.view = 1, .x = 1, .y = 1};

static enum hg_status picks(struct hg_siege_client *c, struct hg_error *err)
{
    return push_many(c, HGP_T_pick, &middle, err);
}

static enum hg_status pick(struct hg_siege_client *c, struct hg_error *err)
{
    return helio_call(c->h, HGP_T_pick, &middle, NULL, err);
}

static struct hgp_node_set next_edit(struct hg_siege_client *c)
{
    return (struct hgp_node_set){.node = c->scene.first_id + ++c->seq % NODES,
        .has_translation = true,
        .translation = {(float)(c->seq % 1000), 0, 0}};
}

static enum hg_status edits(struct hg_siege_client *c, struct hg_error *err)
{
    const struct hgp_node_set edit = next_edit(c);
    return push_many(c, HGP_T_node_set, &edit, err);
}

static enum hg_status edit(struct hg_siege_client *c, struct hg_error *err)
{
    const struct hgp_node_set edit = next_edit(c);
    return helio_call(c->h, HGP_T_node_set, &edit, NULL, err);
}

static enum hg_status upload_with(struct hg_siege_client *c,
    enum hg_status (*send)(
        struct hg_siege_client *c, enum hgp_type type, const void *message, struct hg_error *err),
    struct hg_error *err)
{
    const uint64_t content[2] = {++c->seq, (uint64_t)(uintptr_t)c};
    struct hgp_upload upload = {
        .total = sizeof content, .data = {(const uint8_t *)content, sizeof content}};
    enum hg_status status = hg_sha256(content, sizeof content, upload.hash);
    return status ? status : send(c, HGP_T_upload, &upload, err);
}

static enum hg_status call(
    struct hg_siege_client *c, enum hgp_type type, const void *message, struct hg_error *err)
{
    return helio_call(c->h, type, message, NULL, err);
}

static enum hg_status uploads(struct hg_siege_client *c, struct hg_error *err)
{
    enum hg_status status = upload_with(c, push, err);
    for (struct helio_message *m; !status && helio_next(c->h, &m, NULL) == HG_OK;)
        helio_message_free(m);
    return status;
}

static enum hg_status upload(struct hg_siege_client *c, struct hg_error *err)
{
    return upload_with(c, call, err);
}

// Leaves again before its session is open.
static enum hg_status knock(struct hg_siege_client *c, struct hg_error *err)
{
    struct helio *h;
    const struct helio_options options = {.url = c->url, .token = "wrong-token-1"};
    pace(c);
    enum hg_status status = helio_start(&options, &h, err);
    if (!status)
        status = helio_process(h, err);
    helio_destroy(h);
    return status == HG_E_CLOSED ? HG_OK : status;
}

static enum hg_status visit(struct hg_siege_client *c, struct hg_error *err)
{
    struct helio *h;
    const struct helio_options options = {.url = c->url, .token = c->token, .timeout_ns = OPEN_NS};
    enum hg_status status = helio_connect(&options, &h, err);
    helio_destroy(h);
    return status;
}

const struct hg_siege_class hg_siege_classes[] = {
    {"pings that are not read", pings, ping, false, false},
    {"frames that are not read", frames_unread, frame, false, false},
    {"eight pictures at once", settle_all, settle, false, false},
    {"picks", picks, pick, true, false},
    {"edits", edits, edit, true, false},
    {"uploads", uploads, upload, false, false},
    {"connections", knock, visit, true, true},
};
const uint32_t hg_siege_class_count = sizeof hg_siege_classes / sizeof *hg_siege_classes;

// ---- threads ------------------------------------------------------------------------------------

enum hg_status hg_siege_frame(struct hg_siege_client *c, struct hg_error *err)
{
    return take_frame(c, 1, false, err);
}

enum hg_status hg_siege_ping(struct hg_siege_client *c, struct hg_error *err)
{
    return ping(c, err);
}

static void note(struct hg_siege_client *c, uint64_t ns)
{
    struct hg_siege_times *times = c->times;
    atomic_fetch_add(&c->rounds, 1);
    if (times && atomic_load(&c->measured) && times->count < HG_SIEGE_SAMPLES)
        times->ns[times->count++] = ns;
}

// Rounds begin in equal intervals. Those that are late, since a core was not to be had, are made up
// for, but not many of them at once.
static void await_interval(const struct hg_siege_client *c, uint64_t *due_ns)
{
    const uint64_t now_ns = hg_clock_now_ns(), late_ns = LATE_ROUNDS * c->interval_ns;
    if (*due_ns > now_ns)
        hg_clock_sleep_ns(*due_ns - now_ns);
    else if (now_ns - *due_ns > late_ns)
        *due_ns = now_ns - late_ns;
    *due_ns += c->interval_ns;
}

static void *client_main(void *arg)
{
    struct hg_siege_client *c = arg;
    uint64_t due_ns = hg_clock_now_ns();
    if (c->times) // it stands for one on another machine: its own waits for a core do not count
        hg_slice_set(HG_SLICE_SHORT_NS);
    while (!atomic_load(&c->stop)) {
        const bool opened = c->h != NULL;
        enum hg_status status = opened ? HG_OK : open_session(c, &c->err);
        if (c->interval_ns)
            await_interval(c, &due_ns);
        const uint64_t begin_ns = hg_clock_now_ns();
        if (!status)
            status = c->round(c, &c->err);
        if (!status)
            note(c, hg_clock_now_ns() - begin_ns);
        if (status) {
            c->failures++;
            helio_destroy(c->h);
            c->h = NULL;
        }
        if (status || c->pause_ns)
            hg_clock_sleep_ns(status ? PATIENCE_MS * 1000000u : c->pause_ns);
    }
    helio_destroy(c->h);
    c->h = NULL;
    return NULL;
}

enum hg_status hg_siege_client_start(struct hg_siege_client *c)
{
    return pthread_create(&c->thread, NULL, client_main, c) == 0 ? HG_OK : HG_E_LIMIT;
}

void hg_siege_client_stop(struct hg_siege_client *c)
{
    atomic_store(&c->stop, true);
    pthread_join(c->thread, NULL);
}
