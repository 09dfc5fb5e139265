#include "server/worker/encode/encode_queue.h"

#include <pthread.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/jobs.h"
#include "base/log.h"
#include "base/sha256.h"
#include "server/worker/encode/picture_extremes.h"
#include "server/worker/encode/rate_control.h"

enum {
    FRAME_DATA_LIMIT = 512 << 20, // of frame.data
    STREAM_FRAMES = 2,            // one that is being encoded, one behind it
    MIN_THREADS = 2,              // besides the one for small frames
    SMALL_PX = 1 << 18,
    DEADLINE_NS_PER_PX = 400, // some times as long as slow encoders take
    MAX_THREADS = 16,
    MAX_STAGES = 64,
    SENT_FRAMES = 4, // of a stream, until the render thread takes notice
};

// An encoder of a stream between its frames. Used by the thread that runs the stream.
struct encoder_state {
    bool is_open, wants_key;
    uint32_t width, height; // px, of the frames
    uint64_t number;        // of the newest frame
    void *state;
};

struct encode_stream {
    struct encode_queue *queue;
    struct encode_stream *next_ready;
    struct encode_request *first, **end; // waiting, oldest first
    _Atomic uint32_t frames;             // waiting and being encoded
    uint64_t deadline_ns;                // of the first one, while the stream is ready
    bool running, closed;
    struct rate_control rate;
    struct hg_control_sent sent[SENT_FRAMES]; // a ring, under the lock
    uint32_t sent_first, sent_count;
    _Atomic uint32_t failed; // encodings, 1 << enum hgp_encoding
    struct encoder_state states[ENCODER_COUNT];
};

struct encoder_thread {
    struct encode_queue *queue;
    pthread_t thread;
    struct watch watch;
    bool only_small; // frames, which never wait behind large ones
};

struct encode_queue {
    struct worker *w;
    encoder_find_fn *find;
    pthread_mutex_t lock; // of the streams' lists and flags, and of what follows
    pthread_cond_t changed;
    struct encode_stream *ready; // with frames, not running; earliest deadline first
    bool stop;
    uint32_t thread_count;
    struct encoder_thread threads[MAX_THREADS + 1];
};

// ---- one frame ----------------------------------------------------------------------------------

static void close_state(const struct encoder_ops *ops, struct encoder_state *s)
{
    if (s->is_open && ops->close)
        ops->close(s->state);
    *s = (struct encoder_state){0};
}

static enum hg_status open_state(const struct encoder_ops *ops, struct encoder_state *s,
    const struct encode_request *request, struct hg_error *err)
{
    const struct hgp_frame *f = &request->frame;
    if (s->is_open && s->width == f->width && s->height == f->height)
        return HG_OK;
    close_state(ops, s);
    enum hg_status status = ops->open ? ops->open(request, &s->state, err) : HG_OK;
    if (status)
        return status;
    s->is_open = true;
    s->width = f->width;
    s->height = f->height;
    return HG_OK;
}

// The picture must fit the data of a frame message.
static enum hg_status check_size(
    const struct encode_request *request, size_t size, struct hg_error *err)
{
    if (request->parts || size <= FRAME_DATA_LIMIT)
        return HG_OK;
    return hg_error_set(err, HG_E_LIMIT, "frame", "data",
        "%zu bytes are more than a message holds (%d); choose another encoding or size", size,
        FRAME_DATA_LIMIT);
}

// Of settled pictures, so that a client can warn of one that shows nothing.
static void note_extremes(
    const struct encode_request *request, enum hg_pixel_format format, struct hgp_frame *frame)
{
    if (!frame->settled || request->is_legend)
        return;
    const struct picture_extremes seen =
        hg_picture_extremes(request->pixels->data, (uint64_t)frame->width * frame->height, format);
    frame->has_black = true;
    frame->black = seen.black;
    frame->has_clipped = format != HG_PIXEL_RGBA32F;
    frame->clipped = seen.clipped;
}

static struct encoder_state *state_of(struct encode_stream *stream, enum hgp_encoding encoding)
{
    const struct encoder_ops *ops = stream->queue->find(encoding);
    return &stream->states[ops->shares ? ops->shares - 1 : (uint32_t)encoding];
}

// A key frame is asked for because the client may have none of what was sent, of any encoder.
static void want_keys(struct encode_stream *stream)
{
    for (uint32_t i = 0; i < ENCODER_COUNT; i++)
        stream->states[i].wants_key = true;
}

static enum hg_status run_encoder(struct encode_stream *stream, struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    const enum hgp_encoding encoding = request->frame.encoding;
    const struct encoder_ops *ops = stream->queue->find(encoding);
    struct encoder_state *s = state_of(stream, encoding);
    enum hg_status status = open_state(ops, s, request, err);
    // A picture that is sent again cannot name itself as the one that it takes.
    request->key_frame = s->wants_key || (s->number && request->frame.number == s->number);
    if (!status)
        status = ops->encode(s->state, request, out, err);
    if (!status && out->data.failed)
        status = hg_error_set(err, HG_E_NOMEM, "frame", NULL, "no memory for its data");
    if (status)
        close_state(ops, s); // the next frame opens another
    else
        s->wants_key = false;
    return status;
}

// A codec that cannot go on does not stop the view: the frame is sent as JPEG, and the view's
// schedule takes the next codec.
static enum hg_status fall_back(struct encode_stream *stream, struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    const struct encoder_ops *ops = stream->queue->find(request->frame.encoding);
    if (!ops->open || request->frame.encoding == HGP_encoding_JPEG ||
        ops->pixels != HG_PIXEL_RGBA8 || request->to.request)
        return err->status;
    hg_warn(WORKER, "encoder %s: %s; JPEG takes its place", ops->name, err->reason);
    atomic_fetch_or(&stream->failed, 1u << request->frame.encoding);
    request->frame.encoding = HGP_encoding_JPEG;
    hg_writer_finish(&out->data);
    *out = (struct encode_output){0};
    *err = (struct hg_error){0};
    return run_encoder(stream, request, out, err);
}

static bool is_stream(const struct encode_stream *stream, enum hgp_encoding encoding)
{
    return stream->queue->find(encoding)->open != NULL;
}

// What the frame says of its data.
static void describe(
    struct encode_stream *stream, const struct encode_output *out, struct hgp_frame *frame)
{
    struct encoder_state *s = state_of(stream, frame->encoding);
    frame->lossless = stream->queue->find(frame->encoding)->lossless && !out->lossy;
    frame->has_depends = out->depends;
    frame->depends = out->depends ? (uint32_t)(frame->number - s->number) : 0;
    frame->has_codec = out->codec[0] != 0;
    frame->codec = hgp_str_make(out->codec);
    s->number = frame->number;
}

static enum hg_status encode(struct encode_stream *stream, struct encode_request *request,
    struct hgp_frame *frame, struct encode_output *out, struct hg_error *err)
{
    if (request->key_frame)
        want_keys(stream);
    if (!stream->queue->find(frame->encoding)->lossless ||
        frame->encoding == HGP_encoding_TILES_JPEG)
        request->quality = hg_rate_control_next(
            &stream->rate, request->quality, request->bitrate, hg_clock_now_ns());
    enum hg_status status = run_encoder(stream, request, out, err);
    if (status)
        status = fall_back(stream, request, out, err);
    if (status)
        return status;
    frame->encoding = request->frame.encoding;
    describe(stream, out, frame);
    hg_rate_control_spent(&stream->rate, out->data.size,
        !frame->lossless && (out->depends || !is_stream(stream, frame->encoding)));
    note_extremes(request, stream->queue->find(frame->encoding)->pixels, frame);
    status = check_size(request, out->data.size ? out->data.size : request->pixels->size, err);
    if (status || !frame->settled || !frame->lossless)
        return status;
    frame->has_hash = true;
    return hg_sha256(request->pixels->data, request->pixels->size, frame->hash);
}

static uint32_t list_stages(const struct encode_request *request, uint64_t encode_ns,
    struct hgp_stage_time stages[MAX_STAGES])
{
    uint32_t n = 0;
    const struct hg_frame_info *info = &request->info;
    for (; n < info->stage_count && n < MAX_STAGES - 3; n++)
        stages[n] = (struct hgp_stage_time){hgp_str_make(info->stages[n].name), info->stages[n].ns};
    stages[n++] = (struct hgp_stage_time){hgp_str_make("read"), request->read_ns};
    if (request->depth)
        stages[n++] = (struct hgp_stage_time){hgp_str_make("depth"), request->depth->read_ns};
    stages[n++] = (struct hgp_stage_time){hgp_str_make("encode"), encode_ns};
    return n;
}

static void note_sent(struct encode_stream *stream, const struct hg_control_sent *sent)
{
    struct encode_queue *q = stream->queue;
    pthread_mutex_lock(&q->lock);
    if (stream->sent_count == SENT_FRAMES) {
        stream->sent_first = (stream->sent_first + 1) % SENT_FRAMES;
        stream->sent_count--;
    }
    stream->sent[(stream->sent_first + stream->sent_count++) % SENT_FRAMES] = *sent;
    pthread_mutex_unlock(&q->lock);
}

bool hg_encode_stream_next_sent(struct encode_stream *stream, struct hg_control_sent *out)
{
    struct encode_queue *q = stream->queue;
    pthread_mutex_lock(&q->lock);
    const bool found = stream->sent_count > 0;
    if (found) {
        *out = stream->sent[stream->sent_first];
        stream->sent_first = (stream->sent_first + 1) % SENT_FRAMES;
        stream->sent_count--;
    }
    pthread_mutex_unlock(&q->lock);
    return found;
}

// What became of it is noted first: what the client says of it must not come before.
static void send_frame(struct encode_stream *stream, const struct encode_request *request,
    struct hgp_frame *frame, const struct encode_output *out, uint64_t encode_ns)
{
    struct hgp_stage_time stages[MAX_STAGES];
    const uint8_t *data = out->data.size ? out->data.data : request->pixels->data;
    const size_t size = out->data.size ? out->data.size : request->pixels->size;
    frame->stages.items = stages;
    frame->stages.count = list_stages(request, encode_ns, stages);
    frame->has_encode_end_ns = frame->has_sent_ns = true;
    frame->encode_end_ns = frame->sent_ns = hg_clock_now_ns();
    if (!request->to.request)
        note_sent(stream, &(struct hg_control_sent){.number = frame->number,
                              .bytes = size + frame->depth.size,
                              .encode_ns = encode_ns,
                              .sent_ns = frame->sent_ns,
                              .quality = request->quality,
                              .lossy = !frame->lossless});
    hg_reply_frame(request->to, frame, request->parts, data, size);
}

// Depth is of use to a client that has it; a frame without is whole.
static void add_depth(
    const struct encode_request *request, struct hgp_frame *frame, struct encode_output *out)
{
    struct hg_error err = {0};
    if (!request->depth)
        return;
    enum hg_status status = hg_depth_encode(request->depth, &out->depth, &err);
    if (status || out->depth.failed) {
        hg_warn(WORKER, "a frame goes without its depth: %s", err.reason);
        return;
    }
    frame->has_depth = true;
    frame->depth = (struct hgp_bytes){out->depth.data, (uint32_t)out->depth.size};
}

static void encode_and_send(
    struct encode_stream *stream, struct encode_request *request, struct watch *watch)
{
    struct worker *w = stream->queue->w;
    struct hgp_frame frame = request->frame;
    struct encode_output out = {0};
    struct hg_error err = {0};
    const uint64_t start = hg_clock_now_ns();
    frame.has_encode_begin_ns = true;
    frame.encode_begin_ns = start;
    hg_watch_begin(
        watch, (struct watch_work){request->to.channel, request->to.request, request->frame.view});
    enum hg_status status = encode(stream, request, &frame, &out, &err);
    add_depth(request, &frame, &out);
    hg_watch_end(watch); // sending may wait for the peer
    if (status) {
        if (!err.status)
            hg_error_set(&err, status, "frame", NULL, "cannot be encoded");
        if (!request->to.request)
            note_sent(stream, &(struct hg_control_sent){.failed = true});
        hg_reply_error(request->to, &err);
    } else {
        send_frame(stream, request, &frame, &out, hg_clock_now_ns() - start);
        atomic_store(&w->encode_ns, hg_clock_now_ns() - start);
    }
    hg_writer_finish(&out.data);
    hg_writer_finish(&out.depth);
}

// ---- streams ------------------------------------------------------------------------------------

static void destroy_stream(struct encode_stream *stream)
{
    for (uint32_t i = 0; i < ENCODER_COUNT; i++)
        if (stream->states[i].is_open)
            close_state(stream->queue->find((enum hgp_encoding)i), &stream->states[i]);
    for (struct encode_request *next; stream->first; stream->first = next) {
        next = stream->first->next;
        hg_encode_request_destroy(stream->first);
    }
    hg_free(stream);
}

static uint64_t pixels_of(const struct encode_stream *stream)
{
    const struct hgp_frame *frame = &stream->first->frame;
    return (uint64_t)frame->width * frame->height;
}

// Under the lock. Frames in motion are done by when they are due. Deadlines of the others grow with
// their size, so that small ones do not wait for all large ones, and no large one for ever.
static void make_ready(struct encode_stream *stream)
{
    struct encode_queue *q = stream->queue;
    struct encode_stream **link = &q->ready;
    const uint64_t due_ns = stream->first->due_ns;
    stream->deadline_ns =
        due_ns ? due_ns : hg_clock_now_ns() + DEADLINE_NS_PER_PX * pixels_of(stream);
    while (*link && (*link)->deadline_ns <= stream->deadline_ns)
        link = &(*link)->next_ready;
    stream->next_ready = *link;
    *link = stream;
    pthread_cond_broadcast(&q->changed);
}

struct encode_stream *hg_encode_stream_open(struct encode_queue *queue)
{
    struct encode_stream *stream = hg_calloc(1, sizeof *stream);
    if (!stream)
        return NULL;
    stream->queue = queue;
    stream->end = &stream->first;
    return stream;
}

void hg_encode_stream_close(struct encode_stream *stream)
{
    if (!stream)
        return;
    struct encode_queue *q = stream->queue;
    pthread_mutex_lock(&q->lock);
    stream->closed = true;
    const bool idle = !stream->running && !stream->first;
    pthread_mutex_unlock(&q->lock);
    if (idle)
        destroy_stream(stream);
}

bool hg_encode_stream_has_room(const struct encode_stream *stream)
{
    return atomic_load(&stream->frames) < STREAM_FRAMES;
}

void hg_encode_stream_push(struct encode_stream *stream, struct encode_request *request)
{
    struct encode_queue *q = stream->queue;
    request->next = NULL;
    atomic_fetch_add(&stream->frames, 1);
    pthread_mutex_lock(&q->lock);
    const bool ready = !stream->first && !stream->running;
    *stream->end = request;
    stream->end = &request->next;
    if (ready)
        make_ready(stream);
    pthread_mutex_unlock(&q->lock);
}

uint32_t hg_encode_stream_failed(const struct encode_stream *stream)
{
    return atomic_load(&stream->failed);
}

// ---- threads ------------------------------------------------------------------------------------

static struct encode_stream **find_ready(struct encode_queue *q, bool only_small)
{
    struct encode_stream **link = &q->ready;
    while (*link && only_small && pixels_of(*link) > SMALL_PX)
        link = &(*link)->next_ready;
    return link;
}

// The stream whose turn it is, with its oldest request; NULL: the end.
static struct encode_stream *begin(
    struct encode_queue *q, bool only_small, struct encode_request **request)
{
    pthread_mutex_lock(&q->lock);
    while (!*find_ready(q, only_small) && !q->stop)
        pthread_cond_wait(&q->changed, &q->lock);
    struct encode_stream **link = find_ready(q, only_small), *stream = q->stop ? NULL : *link;
    if (stream) {
        *link = stream->next_ready;
        *request = stream->first;
        stream->first = stream->first->next;
        if (!stream->first)
            stream->end = &stream->first;
        stream->running = true;
    }
    pthread_mutex_unlock(&q->lock);
    return stream;
}

static void end(struct encode_queue *q, struct encode_stream *stream)
{
    pthread_mutex_lock(&q->lock);
    stream->running = false;
    const bool last = stream->closed && !stream->first;
    if (stream->first)
        make_ready(stream);
    if (!last)
        atomic_fetch_sub(&stream->frames, 1);
    pthread_mutex_unlock(&q->lock); // from here on the stream may be gone
    if (last)
        destroy_stream(stream);
    hg_worker_wake(q->w);
}

static void *encoder_main(void *arg)
{
    struct encoder_thread *self = arg;
    struct encode_queue *q = self->queue;
    struct encode_request *request;
    for (struct encode_stream *stream; (stream = begin(q, self->only_small, &request));) {
        encode_and_send(stream, request, &self->watch);
        hg_encode_request_destroy(request);
        end(q, stream);
    }
    return NULL;
}

static uint32_t default_threads(void)
{
    const unsigned cores = hg_jobs_cores();
    return cores < MIN_THREADS ? MIN_THREADS : cores > MAX_THREADS ? MAX_THREADS : cores;
}

static bool start_thread(struct encode_queue *q, bool only_small)
{
    struct encoder_thread *t = &q->threads[q->thread_count];
    t->queue = q;
    t->only_small = only_small;
    hg_watch_add(&q->w->watch, &t->watch);
    if (pthread_create(&t->thread, NULL, encoder_main, t) == 0)
        return true;
    hg_watch_remove(&q->w->watch, &t->watch);
    return false;
}

enum hg_status hg_encode_queue_create(
    struct worker *w, uint32_t threads, encoder_find_fn *find, struct encode_queue **out)
{
    struct encode_queue *q = *out = hg_calloc(1, sizeof *q);
    if (!q)
        return HG_E_NOMEM;
    q->w = w;
    q->find = find;
    pthread_mutex_init(&q->lock, NULL);
    pthread_cond_init(&q->changed, NULL);
    const uint32_t wanted = threads ? threads : default_threads(),
                   large = wanted < MAX_THREADS ? wanted : MAX_THREADS;
    while (q->thread_count <= large && start_thread(q, q->thread_count == large))
        q->thread_count++;
    if (q->thread_count > 0)
        return HG_OK;
    hg_encode_queue_destroy(q);
    *out = NULL;
    return HG_E_LIMIT;
}

void hg_encode_queue_destroy(struct encode_queue *q)
{
    if (!q)
        return;
    pthread_mutex_lock(&q->lock);
    q->stop = true;
    pthread_cond_broadcast(&q->changed);
    pthread_mutex_unlock(&q->lock);
    for (uint32_t i = 0; i < q->thread_count; i++) {
        pthread_join(q->threads[i].thread, NULL);
        hg_watch_remove(&q->w->watch, &q->threads[i].watch);
    }
    for (struct encode_stream *next; q->ready; q->ready = next) {
        next = q->ready->next_ready;
        destroy_stream(q->ready);
    }
    pthread_cond_destroy(&q->changed);
    pthread_mutex_destroy(&q->lock);
    hg_free(q);
}

const struct encoder_ops *hg_encode_queue_encoder(
    const struct encode_queue *queue, enum hgp_encoding encoding)
{
    return queue->find(encoding);
}
