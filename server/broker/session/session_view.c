#include "server/broker/session/session_view.h"

#include "base/alloc.h"
#include "base/log.h"
#include "protocol/view_params.h"
#include "server/broker/session/session_allow.h"

enum { TOLD_WAIT_NS = 1000000000, TELL_AGAIN_S = 60 };

struct hg_session_view *hg_session_view_find(struct hg_session *s, uint32_t number)
{
    for (struct hg_session_view *it = s->views; it; it = it->next)
        if (it->number == number)
            return it;
    return NULL;
}

uint64_t hg_session_view_pixels(const struct hg_session *s)
{
    uint64_t pixels = 0;
    for (const struct hg_session_view *it = s->views; it; it = it->next)
        pixels += (uint64_t)it->width * it->height;
    return pixels;
}

static struct hg_session_view *add_view(struct hg_session *s, uint32_t number)
{
    struct hg_session_view *view = hg_calloc(1, sizeof *view);
    if (!view)
        return NULL;
    view->number = number;
    view->next = s->views;
    s->views = view;
    return view;
}

static uint32_t count_views(const struct hg_session *s)
{
    uint32_t count = 0;
    for (const struct hg_session_view *it = s->views; it; it = it->next)
        count++;
    return count;
}

static enum hg_status check_pixels(const struct hg_session *s, const struct hg_session_view *view,
    uint32_t width, uint32_t height, struct hg_error *err)
{
    uint64_t old = view ? (uint64_t)view->width * view->height : 0;
    uint64_t total = hg_session_view_pixels(s) - old + (uint64_t)width * height;
    if (total <= s->table->options->max_pixels)
        return HG_OK;
    hg_error_set(err, HG_E_LIMIT, "view_set", "width",
        "%llu pixels in all views of this session are more than its quota of %u (max-pixels)",
        (unsigned long long)total, s->table->options->max_pixels);
    return hg_error_limit(err, "max-pixels", 0);
}

enum hg_status hg_session_view_ask(
    struct hg_session *s, const struct hgp_view_set *m, struct hg_error *err)
{
    struct hg_session_view *view = hg_session_view_find(s, m->view);
    uint32_t width = m->has_width ? m->width : view ? view->width : HGP_STANDARD_width;
    uint32_t height = m->has_height ? m->height : view ? view->height : HGP_STANDARD_height;
    if (!view && s->table->draining)
        return hg_error_set(err, HG_E_STATE, "view_set", NULL, "the daemon is shutting down");
    if (!view && hg_session_allow_begin(s->table, s->role, "view_set", err))
        return err->status;
    if (!view && count_views(s) >= s->table->options->max_views) {
        hg_error_set(err, HG_E_LIMIT, "view_set", "view",
            "this session has %u views, as many as its quota allows (max-views)", count_views(s));
        return hg_error_limit(err, "max-views", 0);
    }
    enum hg_status status = check_pixels(s, view, width, height, err);
    if (!status && !view && !(view = add_view(s, m->view)))
        status = hg_error_set(err, HG_E_NOMEM, "view_set", NULL, "no memory for a view");
    if (status)
        return status;
    if (view->width != width || view->height != height)
        view->frame_bytes = (uint64_t)width * height * 4; // until the first one tells
    view->width = width;
    view->height = height;
    return HG_OK;
}

struct hg_session_view *hg_session_view_take(
    struct hg_session *s, uint32_t number, struct hg_packet *params, struct hg_error *err)
{
    struct hgp_view_set m;
    enum hg_status status = hgp_decode(HGP_VERSION_MAX, HGP_T_view_set,
        hg_reader_make(params->payload, params->header.length), NULL, &m, NULL);
    if (status || m.view != number) {
        hg_error_set(err, status ? status : HG_E_FORMAT, "view_set", NULL, "of another view");
        return NULL;
    }
    if (hg_session_view_ask(s, &m, err))
        return NULL;
    struct hg_session_view *view = hg_session_view_find(s, number);
    hg_packet_unref(view->params);
    view->params = hg_packet_ref(params);
    view->accepted = true;
    return view;
}

// Newer fields over older ones. `camera` of view_camera counts only in the message that has it.
enum hg_status hg_session_view_merge(struct hg_packet **into, struct hg_packet *from)
{
    if (!*into) {
        *into = hg_packet_ref(from);
        return HG_OK;
    }
    enum hgp_type type = (enum hgp_type)from->header.type;
    union hgp_any older, newer;
    enum hg_status status = hgp_decode(HGP_VERSION_MAX, (uint16_t)type,
        hg_reader_make((*into)->payload, (*into)->header.length), NULL, &older, NULL);
    if (!status)
        status = hgp_decode(HGP_VERSION_MAX, (uint16_t)type,
            hg_reader_make(from->payload, from->header.length), NULL, &newer, NULL);
    if (status)
        return status;
    if (type == HGP_T_view_camera)
        older.view_camera.has_camera = false;
    hgp_merge(type, &older, &newer);
    struct hg_packet *merged = hg_packet_encode(type, &older);
    if (!merged)
        return HG_E_NOMEM;
    hg_packet_unref(*into);
    *into = merged;
    return HG_OK;
}

void hg_session_view_note_camera(struct hg_session *s, struct hg_packet *packet)
{
    struct hg_reader r = hg_reader_make(packet->payload, packet->header.length);
    hg_read_u32(&r); // bitmap
    struct hg_session_view *view = hg_session_view_find(s, hg_read_u32(&r));
    if (view && hg_session_view_merge(&view->camera, packet))
        hg_warn(SESSION, "no memory to remember a camera");
    else if (view)
        view->unrecorded = true;
}

void hg_session_view_reset(struct hg_session_view *view)
{
    hg_packet_unref(view->params);
    hg_packet_unref(view->camera);
    view->params = view->camera = NULL;
    for (uint32_t i = 0; i < view->looks.count; i++)
        hg_packet_unref(view->looks.items[i]);
    hg_free(view->looks.items);
    view->looks = (struct hg_session_looks){0};
    view->accepted = false;
    view->last_number = view->number_base = 0;
}

void hg_session_view_clear(struct hg_session *s, struct hg_session_view *view)
{
    struct hg_link *link = s->scene->link;
    if (!view->suspect)
        return;
    view->suspect = view->held = false;
    link->trial.waiting--;
    link->feed.pump = true;
    if (link->trial.session == s && !link->trial.id && link->trial.view == view->number)
        link->trial.session = NULL;
}

void hg_session_view_remove(struct hg_session *s, struct hg_session_view *view)
{
    struct hg_session_view **link = &s->views;
    while (*link != view)
        link = &(*link)->next;
    *link = view->next;
    hg_session_view_clear(s, view);
    hg_session_view_reset(view);
    hg_free(view);
}

// ---- pixels per second --------------------------------------------------------------------------

uint64_t hg_session_view_wait_ns(struct hg_session *s, const char **limit)
{
    struct hg_session_table *table = s->table;
    const struct hg_options *o = table->options;
    const struct hg_pixel_limits limits = {
        .own = s->scope.max_pixels ? s->scope.max_pixels : o->max_pixel_rate,
        .all = o->pixel_rate_total,
        .own_name = s->scope.max_pixels ? "pixels" : "max-pixel-rate"};
    if (!s->pace.account) // without memory for one only the total counts
        s->pace.account = hg_pixel_account_ref(
            &table->pixels, s->resume.has_token ? s->resume.token : NULL, table->loop->now_ns);
    return hg_pixel_wait_ns(&table->pixels, s->pace.account, &limits, table->loop->now_ns, limit);
}

void hg_session_view_count(
    struct hg_session *s, const struct hg_packet *packet, const struct hgp_frame *frame)
{
    const uint64_t pixels = (uint64_t)frame->width * frame->height;
    s->pace.frames++;
    s->pace.pixels += pixels;
    s->pace.frame_bytes += packet->header.length;
    hg_pixel_take(&s->table->pixels, s->pace.account, pixels);
}

// Notifies the client of a wait that users notice, at most once in TELL_AGAIN_S: the worker does
// not know of it.
static void tell_wait(struct hg_session *s, uint64_t wait_ns, const char *limit)
{
    const uint64_t now_ns = s->table->loop->now_ns;
    struct hg_error err = {0};
    if (wait_ns < TOLD_WAIT_NS || !s->conn || s->conn->state != HG_CONN_OPEN ||
        (s->pace.wait_told_ns &&
            now_ns - s->pace.wait_told_ns < (uint64_t)TELL_AGAIN_S * 1000000000))
        return;
    s->pace.wait_told_ns = now_ns;
    hg_error_set(&err, HG_E_LIMIT, "view", NULL,
        "frames come late, as they have more pixels than %s allows; smaller ones come sooner",
        limit);
    hg_error_limit(&err, limit, (uint32_t)(wait_ns / 1000000));
    hg_conn_fail(s->conn, 0, &err);
}

// Whether a frame may be begun; else the view waits.
static bool has_pixels(struct hg_session *s)
{
    const char *limit;
    const uint64_t wait_ns = hg_session_view_wait_ns(s, &limit);
    s->pace.waits |= wait_ns > 0;
    if (wait_ns)
        tell_wait(s, wait_ns, limit);
    return !wait_ns;
}

void hg_session_view_tick(struct hg_session_table *table)
{
    struct hg_session *first = table->first;
    while (first && first->number != table->pixel_turn) // who was first waits longest the next time
        first = first->next;
    first = first && first->next ? first->next : table->first;
    for (struct hg_session *it = first; it;) {
        if (it->pace.waits && it->scene) {
            it->pace.waits = false;
            hg_session_view_grant_all(it);
        }
        it = it->next ? it->next : table->first;
        if (it == first)
            break;
    }
    table->pixel_turn = first ? first->number : 0;
}

// ---- credit -------------------------------------------------------------------------------------

static uint32_t most_credit(const struct hg_session *s, const struct hg_session_view *view)
{
    uint32_t window = s->table->options->frame_window;
    return view->credit < window ? view->credit : window;
}

static bool is_slow(const struct hg_session *s)
{
    return !s->conn || hg_conn_is_slow(s->conn);
}

bool hg_session_view_may_grant(const struct hg_session *s, uint64_t bytes)
{
    if (!s->conn)
        return true;
    uint64_t before = s->conn->out.bytes + s->answers.granted_bytes;
    for (const struct hg_session_view *it = s->views; it; it = it->next)
        before += it->granted * it->frame_bytes;
    bool may = !before || before + bytes <= hg_conn_output_limit(s->conn);
    s->conn->starved |= !may;
    return may;
}

uint32_t hg_session_view_take_window(struct hg_session *s, struct hg_session_view *view)
{
    uint32_t most = most_credit(s, view);
    view->granted = 0;
    if (!has_pixels(s)) { // subscribed without credit: grant() does it later
        view->resubscribe = most > 0;
        most = 0;
    }
    while (
        view->granted < most && (!view->granted || hg_session_view_may_grant(s, view->frame_bytes)))
        view->granted++;
    view->turn = ++s->answers.turns;
    view->credit_ns = s->table->loop->now_ns;
    return view->granted;
}

void hg_session_view_subscribe(struct hg_session *s, struct hg_session_view *view)
{
    struct hg_link *link = s->scene->link;
    if (!has_pixels(s)) { // grant() does it later
        view->granted = 0;
        view->resubscribe = true;
        return;
    }
    hg_link_send(link, s->number, hg_link_next_id(link), HGP_T_subscribe,
        &(struct hgp_subscribe){
            .view = view->number, .credit_frames = hg_session_view_take_window(s, view)});
}

// One frame more.
static void grant(struct hg_session *s, struct hg_session_view *view)
{
    if (view->resubscribe) { // frames were dropped: the worker shows the present state again
        view->resubscribe = false;
        hg_link_send(s->scene->link, s->number, 0, HGP_T_subscribe,
            &(struct hgp_subscribe){
                .view = view->number, .credit_frames = hg_session_view_take_window(s, view)});
        return;
    }
    hg_link_send(s->scene->link, s->number, 0, HGP_T_credit,
        &(struct hgp_credit){.view = view->number, .frames = 1});
    view->granted++;
    view->turn = ++s->answers.turns;
    view->credit_ns = s->table->loop->now_ns;
}

// Whose turn it is: of those that may have one more, the one whose turn is longest ago.
static struct hg_session_view *next_view(struct hg_session *s)
{
    struct hg_session_view *best = NULL;
    for (struct hg_session_view *it = s->views; it; it = it->next)
        if (it->accepted && !it->held && it->granted < most_credit(s, it) &&
            (!best || it->turn < best->turn))
            best = it;
    return best;
}

void hg_session_view_grant_all(struct hg_session *s)
{
    struct hg_session_view *view;
    while (s->attached && !is_slow(s) && (view = next_view(s)) &&
           hg_session_view_may_grant(s, view->frame_bytes) && has_pixels(s))
        grant(s, view);
}
