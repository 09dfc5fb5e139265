// session.c - a viewer's session: the thread that owns the connection, and what it shares with the
// window.
#include "client/view/session.h"

#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "client/view/session_state.h"

enum { POLL_MS = 200 };
static const uint64_t second_ns = 1000000000;

// ---- shared state ------------------------------------------------------------------------------

void hg_view_tell(struct hg_view_session *s)
{
    s->changed(s->user);
}

static void wake_up(struct hg_view_session *s)
{
    const uint64_t one = 1;
    const ssize_t n = write(s->wake_fd, &one, sizeof one);
    (void)n; // full: the wake is pending already
}

void hg_view_say_stage(struct hg_view_session *s, const char *stage, double share)
{
    pthread_mutex_lock(&s->lock);
    struct hg_view_status *status = &s->shown.status;
    status->state = HG_VIEW_OPENING;
    status->share = share;
    snprintf(status->text, sizeof status->text, "%s", stage);
    pthread_mutex_unlock(&s->lock);
    hg_view_tell(s);
}

void hg_view_say(struct hg_view_session *s, const char *fmt, ...)
{
    char text[HG_VIEW_TEXT_BYTES], clean[HG_VIEW_TEXT_BYTES];
    va_list args;
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    hg_cli_clean(clean, sizeof clean, text, strlen(text));
    pthread_mutex_lock(&s->lock);
    s->shown.status.messages++;
    snprintf(s->shown.status.message, sizeof s->shown.status.message, "%s", clean);
    pthread_mutex_unlock(&s->lock);
    hg_view_tell(s);
}

void hg_view_say_error(struct hg_view_session *s, const struct hg_error *err)
{
    char text[HG_VIEW_TEXT_BYTES];
    hg_error_format(err, text, sizeof text);
    hg_view_say(s, "%s", text);
}

enum hg_status hg_view_send(
    struct hg_view_session *s, enum hgp_type type, const void *message, struct hg_error *err)
{
    uint32_t request;
    return helio_send(s->work.render.cli.h, type, message, &request, err);
}

// ---- frames ------------------------------------------------------------------------------------

static void take_facts(const struct hgp_frame *frame, struct hg_view_facts *facts)
{
    *facts = (struct hg_view_facts){.number = frame->number,
        .revision = frame->scene_revision,
        .input_seq = frame->input_seq,
        .samples = frame->samples,
        .missing_pages = frame->missing_pages,
        .missing_clusters = frame->missing_clusters,
        .bytes = frame->data.size,
        .encoding = frame->encoding,
        .mode = frame->has_mode ? frame->mode : HGP_render_mode_REALTIME,
        .settled = frame->settled,
        .lossless = frame->lossless,
        .has_hash = frame->has_hash,
        .noise = frame->has_noise ? frame->noise : -1,
        .exposure_ev = frame->has_exposure_ev ? frame->exposure_ev : 0};
    if (frame->has_hash)
        memcpy(facts->hash, frame->hash, sizeof facts->hash);
    for (uint32_t i = 0; i < frame->stages.count && i < HG_VIEW_STAGES_MAX; i++) {
        const struct hgp_stage_time *stage = &frame->stages.items[i];
        hg_cli_clean(facts->stages[i].name, sizeof facts->stages[i].name, stage->name.data,
            stage->name.size);
        facts->stages[i].ns = stage->ns;
        facts->stage_count = i + 1;
    }
}

// A frame of a stream that cannot be decoded: the next one is to be a key frame; after some of
// these in a row the server takes the next encoding of the list.
static void note_failure(struct hg_view_session *s, const struct hgp_frame *frame)
{
    enum { FAILURES_MAX = 3 };
    struct hg_view_stream *stream = &s->work.stream;
    struct hgp_key_frame ask = {.view = HG_CLI_VIEW};
    struct hg_error ignored; // a connection that failed is found out when it is read
    stream->awaits_key = true;
    stream->failures += !frame->has_depends;
    if (stream->failures == FAILURES_MAX) {
        stream->failures = 0;
        ask.has_failed = true;
        ask.failed = (uint8_t)frame->encoding;
    }
    (void)hg_view_send(s, HGP_T_key_frame, &ask, &ignored);
}

// Into the session's own picture. False: there is nothing to show of it.
static bool decode_frame(struct hg_view_session *s, const struct hgp_frame *frame)
{
    struct hg_error err = {0};
    struct hg_view_picture *mine = &s->work.picture;
    struct hg_view_stream *stream = &s->work.stream;
    const bool is_stream = hg_view_is_stream(frame->encoding);
    const uint64_t begin_ns = hg_clock_now_ns();
    if (is_stream && frame->has_depends && stream->awaits_key)
        return false;
    const enum hg_status status = hg_view_decode(&s->work.decoder, frame, &mine->pixels, &err);
    if (status && is_stream)
        note_failure(s, frame);
    if (status) {
        hg_view_say_error(s, &err);
        return false;
    }
    if (is_stream)
        *stream = (struct hg_view_stream){0};
    take_facts(frame, &mine->facts);
    mine->facts.received_ns = begin_ns;
    if (hg_warp_copy(&s->work.depth, &mine->depth, &err))
        hg_view_say_error(s, &err); // the picture is shown all the same
    mine->facts.decode_ns = hg_clock_now_ns() - begin_ns;
    return true;
}

static void show_picture(struct hg_view_session *s)
{
    struct hg_view_picture *mine = &s->work.picture;
    pthread_mutex_lock(&s->lock);
    const struct hg_view_picture before = s->shown.picture;
    s->shown.picture = *mine;
    *mine = before;
    s->shown.status.dropped += s->shown.has_picture;
    s->shown.has_picture = true;
    pthread_mutex_unlock(&s->lock);
    hg_view_tell(s);
}

// Credit for a frame, and when it came: the server's controller goes by that.
static void give_credit(struct hg_view_session *s, const struct helio_message *frame)
{
    struct hg_error ignored; // a connection that failed is found out when it is read
    if (helio_taken(s->work.render.cli.h, frame, &ignored) == HG_E_AGAIN)
        hg_view_say(s, "the connection was lost and is being made again");
}

static void take_other(struct hg_view_session *s, const struct helio_message *m)
{
    struct hg_error err = {0};
    if (m->type == HGP_T_error) {
        hg_cli_error_of(&m->body->error, &err);
        hg_view_say_error(s, &err);
    } else if (m->type == HGP_T_notice) {
        hg_view_say(s, "%.*s", (int)m->body->notice.reason.size,
            m->body->notice.reason.data ? m->body->notice.reason.data : "");
    } else if (m->type == HGP_T_drain) {
        hg_view_say(s, "this session ends in %u s: %.*s", m->body->drain.deadline_ms / 1000,
            (int)m->body->drain.reason.size,
            m->body->drain.reason.size ? m->body->drain.reason.data : "");
    } else if (m->type == HGP_T_json) {
        struct hg_view_flow flow;
        hg_view_read_flow(m->body->json.text.data, m->body->json.text.size, &flow);
        pthread_mutex_lock(&s->lock);
        s->shown.status.flow = flow;
        pthread_mutex_unlock(&s->lock);
    } else if (m->type == HGP_T_pong) {
        pthread_mutex_lock(&s->lock);
        s->shown.status.rtt_ns = hg_clock_now_ns() - m->body->pong.nonce;
        pthread_mutex_unlock(&s->lock);
    }
}

// Every frame's: those that are not shown may bring the depth of the ones that are.
static void take_depth(struct hg_view_session *s, const struct hgp_frame *frame)
{
    struct hg_error err = {0};
    if (hg_warp_take(&s->work.depth, frame, &err))
        hg_view_say_error(s, &err);
}

// Of the frames that have come the newest is shown; those that later ones depend on are decoded,
// too.
static void take_messages(struct hg_view_session *s)
{
    struct helio_message *m, *newest = NULL;
    struct hg_error ignored;
    uint32_t frames = 0;
    uint64_t bytes = 0;
    bool decoded = false;
    while (helio_next(s->work.render.cli.h, &m, &ignored) == HG_OK) {
        if (m->type != HGP_T_frame || m->body->frame.view != HG_CLI_VIEW) {
            take_other(s, m);
            helio_message_free(m);
            continue;
        }
        if (m->request == 0)
            give_credit(s, m);
        frames++;
        bytes += m->body->frame.data.size + m->body->frame.depth.size;
        take_depth(s, &m->body->frame);
        helio_message_free(newest);
        newest = m;
        if (hg_view_is_stream(m->body->frame.encoding)) {
            decoded = decode_frame(s, &m->body->frame);
            helio_message_free(m);
            newest = NULL;
        }
    }
    if (!frames)
        return;
    pthread_mutex_lock(&s->lock);
    s->shown.status.frames += frames;
    s->shown.status.bytes += bytes;
    s->shown.status.dropped += frames - 1;
    pthread_mutex_unlock(&s->lock);
    if (newest)
        decoded = decode_frame(s, &newest->body->frame);
    if (decoded)
        show_picture(s);
    helio_message_free(newest);
}

// ---- the thread --------------------------------------------------------------------------------

static void ping(struct hg_view_session *s)
{
    struct helio_info info;
    const uint64_t now_ns = hg_clock_now_ns();
    const struct hgp_ping message = {.nonce = now_ns};
    struct hg_error ignored;
    if (now_ns - s->work.ping_ns < second_ns)
        return;
    s->work.ping_ns = now_ns;
    helio_get_info(s->work.render.cli.h, &info);
    pthread_mutex_lock(&s->lock);
    s->shown.status.reconnects = info.reconnects;
    const bool statistics = s->wanted.statistics;
    pthread_mutex_unlock(&s->lock);
    const struct hgp_stats_query query = {.view = HG_CLI_VIEW};
    if (statistics)
        (void)hg_view_send(s, HGP_T_stats_query, &query, &ignored); // what is wrong the ping says
    if (hg_view_send(s, HGP_T_ping, &message, &ignored) == HG_E_AGAIN)
        hg_view_say(s, "the connection was lost and is being made again");
}

static bool is_asked_to_leave(struct hg_view_session *s)
{
    pthread_mutex_lock(&s->lock);
    const bool leave = s->wanted.stop || s->wanted.open;
    pthread_mutex_unlock(&s->lock);
    return leave;
}

static void sleep_until_woken(struct hg_view_session *s, int fd, bool write)
{
    uint64_t count;
    struct pollfd p[2] = {{.fd = fd, .events = (short)(POLLIN | (write ? POLLOUT : 0))},
        {.fd = s->wake_fd, .events = POLLIN}};
    if (poll(p, 2, POLL_MS) > 0 && p[1].revents && read(s->wake_fd, &count, sizeof count) < 0)
        return; // it was taken already
}

// Until the window wants something else, or the connection ends.
static enum hg_status serve(struct hg_view_session *s, struct hg_error *err)
{
    struct helio *h = s->work.render.cli.h;
    pthread_mutex_lock(&s->lock);
    s->shown.status.state = HG_VIEW_OPEN;
    s->shown.status.text[0] = 0;
    pthread_mutex_unlock(&s->lock);
    hg_view_tell(s);
    while (!is_asked_to_leave(s)) {
        enum hg_status status = helio_process(h, err);
        if (status)
            return status;
        take_messages(s);
        hg_view_do_wanted(s);
        ping(s);
        status = helio_process(h, err);
        if (status)
            return status;
        sleep_until_woken(s, helio_fd(h), helio_want_write(h));
    }
    return HG_OK;
}

static void fail(struct hg_view_session *s, const struct hg_error *err)
{
    char text[HG_VIEW_TEXT_BYTES];
    hg_error_format(err, text, sizeof text);
    const enum hg_cli_exit code = hg_cli_report(&s->work.render.cli, s->work.render.doing, err);
    pthread_mutex_lock(&s->lock);
    struct hg_view_status *status = &s->shown.status;
    status->state = HG_VIEW_FAILED;
    status->exit_code = (int)code;
    hg_cli_clean(status->text, sizeof status->text, text, strlen(text));
    pthread_mutex_unlock(&s->lock);
    hg_view_tell(s);
}

// A file that was dropped: what the options say of another file's camera does not hold for it.
static void take_path(struct hg_view_session *s)
{
    struct hg_view_work *work = &s->work;
    pthread_mutex_lock(&s->lock);
    const bool other = s->wanted.open && s->wanted.path[0];
    if (other)
        memcpy(work->path, s->wanted.path, sizeof work->path);
    s->wanted.open = s->wanted.has_camera = s->wanted.has_pose = s->wanted.has_clip = false;
    s->wanted.count = 0;
    pthread_mutex_unlock(&s->lock);
    if (!other)
        return;
    struct hg_cli_options *o = &work->options;
    o->args[0] = work->path;
    o->arg_count = 1;
    o->has_camera = o->has_view = o->has_orbit = o->has_eye = o->has_target = false;
    o->has_up = o->has_variant = o->has_join = false;
    o->join = NULL;
    o->upload = o->has_upload = o->connect != NULL;
}

static void run_once(struct hg_view_session *s)
{
    struct hg_view_work *work = &s->work;
    struct hg_error err = {0};
    take_path(s);
    work->render = (struct hg_cli_render){.o = &work->options,
        .size = work->options.has_size
                    ? work->options.size
                    : (struct hg_cli_size){HGP_STANDARD_width, HGP_STANDARD_height},
        .format = {.encoding = HGP_encoding_ZSTD_RGBA8, .quality = 85},
        .doing = HG_CLI_DOING_ARGUMENTS};
    hg_cli_init(&work->render.cli, &work->options);
    enum hg_status status = hg_view_open_scene(s, &err);
    if (!status) {
        work->render.doing = HG_CLI_DOING_RENDER;
        status = serve(s, &err);
    }
    if (status && !is_asked_to_leave(s)) {
        err.status = status;
        fail(s, &err);
        while (!is_asked_to_leave(s) && !hg_cli_is_stopped())
            sleep_until_woken(s, -1, false);
    }
    hg_cli_disconnect(&work->render.cli);
}

static void *run(void *user)
{
    struct hg_view_session *s = user;
    for (;;) {
        pthread_mutex_lock(&s->lock);
        const bool stop = s->wanted.stop;
        pthread_mutex_unlock(&s->lock);
        if (stop || hg_cli_is_stopped())
            break;
        run_once(s);
    }
    hg_view_tell(s);
    return NULL;
}

// ---- for the window ----------------------------------------------------------------------------

enum hg_status hg_view_session_create(const struct hg_cli_options *options,
    void (*changed)(void *user), void *user, struct hg_view_session **out, struct hg_error *err)
{
    struct hg_view_session *s = hg_calloc(1, sizeof *s);
    *out = NULL;
    if (!s)
        return hg_error_set(err, HG_E_NOMEM, "view", NULL, "no memory");
    pthread_mutex_init(&s->lock, NULL);
    s->changed = changed;
    s->user = user;
    s->work.options = *options;
    s->wanted.input_seq = 1; // what the view begins with
    s->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    enum hg_status status = s->wake_fd < 0 ? HG_E_IO : HG_OK;
    if (!status && options->record)
        status = hg_cli_recorder_create(options->record, &s->work.recorder, err);
    if (!status && pthread_create(&s->thread, NULL, run, s))
        status = hg_error_set(err, HG_E_NOMEM, "view", NULL, "no thread can be started");
    s->is_running = !status;
    if (status)
        hg_view_session_destroy(s);
    else
        *out = s;
    return status;
}

void hg_view_picture_finish(struct hg_view_picture *picture)
{
    hg_view_pixels_finish(&picture->pixels);
    hg_warp_depth_finish(&picture->depth);
}

void hg_view_session_destroy(struct hg_view_session *s)
{
    struct hg_error err = {0};
    if (!s)
        return;
    if (s->is_running) {
        pthread_mutex_lock(&s->lock);
        s->wanted.stop = true;
        pthread_mutex_unlock(&s->lock);
        wake_up(s);
        pthread_join(s->thread, NULL);
    }
    if (hg_cli_recorder_finish(s->work.recorder, &err))
        hg_cli_report(NULL, HG_CLI_DOING_OUTPUT, &err);
    hg_view_decoder_finish(&s->work.decoder);
    hg_view_picture_finish(&s->work.picture);
    hg_view_picture_finish(&s->shown.picture);
    hg_warp_depth_finish(&s->work.depth);
    hg_tree_finish(&s->shown.nodes);
    if (s->wake_fd >= 0)
        close(s->wake_fd);
    pthread_mutex_destroy(&s->lock);
    hg_free(s);
}

void hg_view_session_open(struct hg_view_session *s, const char *path)
{
    pthread_mutex_lock(&s->lock);
    s->wanted.open = true;
    snprintf(s->wanted.path, sizeof s->wanted.path, "%s", path ? path : "");
    pthread_mutex_unlock(&s->lock);
    wake_up(s);
}

void hg_view_session_status(struct hg_view_session *s, struct hg_view_status *out)
{
    pthread_mutex_lock(&s->lock);
    *out = s->shown.status;
    pthread_mutex_unlock(&s->lock);
}

void hg_view_session_scene(struct hg_view_session *s, struct hg_view_scene *out)
{
    pthread_mutex_lock(&s->lock);
    *out = s->shown.scene;
    pthread_mutex_unlock(&s->lock);
}

bool hg_view_session_take(struct hg_view_session *s, struct hg_view_picture *picture)
{
    pthread_mutex_lock(&s->lock);
    const bool has = s->shown.has_picture;
    if (has) {
        const struct hg_view_picture newest = s->shown.picture;
        s->shown.picture = *picture;
        *picture = newest;
        s->shown.has_picture = false;
    }
    pthread_mutex_unlock(&s->lock);
    return has;
}

uint64_t hg_view_session_camera(struct hg_view_session *s, const struct hgp_view_camera *camera)
{
    pthread_mutex_lock(&s->lock);
    struct hg_view_wanted *wanted = &s->wanted;
    wanted->camera = *camera;
    wanted->camera.view = HG_CLI_VIEW;
    wanted->camera.input_seq = ++wanted->input_seq;
    wanted->has_camera = true;
    const uint64_t seq = wanted->input_seq;
    pthread_mutex_unlock(&s->lock);
    wake_up(s);
    return seq;
}

void hg_view_session_pose(struct hg_view_session *s, double time_s)
{
    pthread_mutex_lock(&s->lock);
    s->wanted.pose_s = time_s;
    s->wanted.has_pose = true;
    pthread_mutex_unlock(&s->lock);
    wake_up(s);
}

void hg_view_session_clip(struct hg_view_session *s, const struct hg_clipping_list *planes)
{
    pthread_mutex_lock(&s->lock);
    s->wanted.clip = *planes;
    s->wanted.has_clip = true;
    pthread_mutex_unlock(&s->lock);
    wake_up(s);
}

bool hg_view_session_ask(struct hg_view_session *s, const struct hg_view_request *request)
{
    pthread_mutex_lock(&s->lock);
    struct hg_view_wanted *wanted = &s->wanted;
    const bool room = wanted->count < HG_VIEW_REQUESTS_MAX;
    if (room)
        wanted->requests[(wanted->first + wanted->count++) % HG_VIEW_REQUESTS_MAX] = *request;
    pthread_mutex_unlock(&s->lock);
    wake_up(s);
    return room;
}

void hg_view_session_want_statistics(struct hg_view_session *s, bool wanted)
{
    pthread_mutex_lock(&s->lock);
    s->wanted.statistics = wanted;
    s->shown.status.flow.is_known &= wanted;
    pthread_mutex_unlock(&s->lock);
}

bool hg_view_session_fitted(struct hg_view_session *s, struct hgp_view_camera *camera)
{
    pthread_mutex_lock(&s->lock);
    *camera = s->shown.fitted;
    const bool has = s->shown.status.fits > 0;
    pthread_mutex_unlock(&s->lock);
    return has;
}

bool hg_view_session_answer(
    struct hg_view_session *s, uint32_t number, struct hg_view_answer *answer)
{
    pthread_mutex_lock(&s->lock);
    const bool has = s->shown.status.answers - number < HG_VIEW_ANSWERS_MAX;
    *answer = s->shown.answers[number % HG_VIEW_ANSWERS_MAX];
    pthread_mutex_unlock(&s->lock);
    return has;
}

bool hg_view_session_nodes(struct hg_view_session *s, struct hg_tree *tree)
{
    pthread_mutex_lock(&s->lock);
    const bool has = s->shown.has_nodes;
    *tree = s->shown.nodes;
    s->shown.nodes = (struct hg_tree){0};
    s->shown.has_nodes = false;
    pthread_mutex_unlock(&s->lock);
    return has;
}
