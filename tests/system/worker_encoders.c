// worker_encoders.c - the render thread of a worker with an encoder that the test slows down,
// counts and lets fail. The worker runs in this process, on its queues, without a socket; lavapipe
// will do.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <pthread.h>
#include <string.h>
#include <time.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "server/worker/dispatch.h"
#include "server/worker/encode/encode_queue.h"
#include "server/worker/view/view_codec.h"
#include "tests/support/folder.h"

enum { CHANNEL = 1, SLOW = 1, QUICK = 2, SIDE = 32, SAMPLES = 4, CAMERAS = 12 };
#define ANSWER_TIMEOUT_NS (UINT64_C(120) * 1000000000)

// ---- the encoder --------------------------------------------------------------------------------

// JPEG frames of the test: their data is the number of the frame in its encoder's state.
static struct {
    pthread_mutex_t lock;
    pthread_cond_t changed;
    bool shut; // encoding waits
    bool fails;
    uint32_t opened, closed, begun;
    uint32_t views[8]; // whose frames were begun
} encoder = {.lock = PTHREAD_MUTEX_INITIALIZER, .changed = PTHREAD_COND_INITIALIZER};

static enum hg_status encoder_open(
    const struct encode_request *first, void **state, struct hg_error *err)
{
    (void)first;
    *state = hg_calloc(1, sizeof(uint32_t));
    if (!*state)
        return hg_error_set(err, HG_E_NOMEM, "encoder", NULL, "no memory");
    pthread_mutex_lock(&encoder.lock);
    encoder.opened++;
    pthread_mutex_unlock(&encoder.lock);
    return HG_OK;
}

static enum hg_status encoder_encode(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    uint32_t *frames = state;
    pthread_mutex_lock(&encoder.lock);
    encoder.views[encoder.begun % 8] = request->frame.view;
    encoder.begun++;
    pthread_cond_broadcast(&encoder.changed);
    while (encoder.shut)
        pthread_cond_wait(&encoder.changed, &encoder.lock);
    const bool fails = encoder.fails;
    pthread_mutex_unlock(&encoder.lock);
    if (fails)
        return hg_error_set(err, HG_E_UNSUPPORTED, "encoder", "jpeg", "fails");
    hg_write_u32(&out->data, (*frames)++);
    return HG_OK;
}

static void encoder_close(void *state)
{
    hg_free(state);
    pthread_mutex_lock(&encoder.lock);
    encoder.closed++;
    pthread_cond_broadcast(&encoder.changed);
    pthread_mutex_unlock(&encoder.lock);
}

static const struct encoder_ops *find_encoder(enum hgp_encoding encoding)
{
    static const struct encoder_ops ops = {.name = "test",
        .pixels = HG_PIXEL_RGBA8,
        .open = encoder_open,
        .encode = encoder_encode,
        .close = encoder_close,
        .motion = true};
    return encoding == HGP_encoding_JPEG ? &ops : hg_encoder_find(encoding);
}

static void set_encoder(bool shut, bool fails)
{
    pthread_mutex_lock(&encoder.lock);
    encoder.shut = shut;
    encoder.fails = fails;
    pthread_cond_broadcast(&encoder.changed);
    pthread_mutex_unlock(&encoder.lock);
}

// Until one of the encoder's counts has come that far.
static void await_count(const uint32_t *count, uint32_t least)
{
    struct timespec until;
    int rc = 0;
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_sec += 120;
    pthread_mutex_lock(&encoder.lock);
    while (*count < least && rc == 0)
        rc = pthread_cond_timedwait(&encoder.changed, &encoder.lock, &until);
    pthread_mutex_unlock(&encoder.lock);
    assert_int_equal(rc, 0);
}

static uint32_t count_now(const uint32_t *count)
{
    pthread_mutex_lock(&encoder.lock);
    const uint32_t now = *count;
    pthread_mutex_unlock(&encoder.lock);
    return now;
}

// ---- the worker ---------------------------------------------------------------------------------

struct rig {
    struct worker w;
    pthread_t render;
    uint32_t next_request;
    // The newest message that came:
    struct hg_refbuf *bytes;
    struct hgp_header header;
    struct hg_arena arena;
    union hgp_any message;
};

static uint32_t ask(struct rig *rig, enum hgp_type type, const void *message)
{
    const uint32_t request = ++rig->next_request;
    struct hg_writer bytes = {0};
    struct command *c = hg_calloc(1, sizeof *c);
    assert_non_null(c);
    assert_int_equal(hgp_encode(&bytes, HGP_VERSION_MAX,
                         (struct hgp_envelope){type, request, CHANNEL}, message, NULL),
        HG_OK);
    assert_int_equal(hgp_header_decode(bytes.data, bytes.size, UINT32_MAX, &c->header), HG_OK);
    c->payload = hg_refbuf_create(c->header.length);
    assert_non_null(c->payload);
    memcpy(c->payload->data, bytes.data + HGP_HEADER_BYTES, c->header.length);
    hg_writer_finish(&bytes);
    assert_int_equal(hg_queue_push(&rig->w.inbox, c), HG_OK);
    return request;
}

static void forget(struct rig *rig)
{
    hg_arena_finish(&rig->arena);
    hg_refbuf_unref(rig->bytes);
    rig->bytes = NULL;
}

static void next_message(struct rig *rig)
{
    forget(rig);
    rig->bytes = hg_queue_pop(&rig->w.outbox, ANSWER_TIMEOUT_NS);
    assert_non_null(rig->bytes);
    assert_int_equal(
        hgp_header_decode(rig->bytes->data, rig->bytes->size, UINT32_MAX, &rig->header), HG_OK);
    assert_int_equal(hgp_decode(HGP_VERSION_MAX, rig->header.type,
                         hg_reader_make(rig->bytes->data + HGP_HEADER_BYTES, rig->header.length),
                         &rig->arena, &rig->message, NULL),
        HG_OK);
}

static void expect_ok(struct rig *rig, enum hgp_type type, const void *message)
{
    const uint32_t request = ask(rig, type, message);
    do
        next_message(rig);
    while (rig->header.request != request);
    assert_int_equal(rig->header.type, HGP_T_ok);
}

static const struct hgp_frame *next_frame(struct rig *rig)
{
    do {
        next_message(rig);
        assert_int_not_equal(rig->header.type, HGP_T_error);
    } while (rig->header.type != HGP_T_frame);
    return &rig->message.frame;
}

static void set_view(struct rig *rig, uint32_t view, uint32_t width, enum hgp_encoding encoding)
{
    expect_ok(rig, HGP_T_view_set,
        &(struct hgp_view_set){.view = view,
            .has_width = true,
            .width = width,
            .has_height = true,
            .height = SIDE,
            .has_samples = true,
            .samples = SAMPLES,
            .has_gi = true,
            .gi = HGP_gi_NONE,
            .has_max_fps = true,
            .max_fps = 1000,
            .has_encoding = true,
            .encoding = encoding,
            .has_still_encoding = true,
            .still_encoding = encoding});
}

static struct hgp_view_camera camera(uint32_t view, uint64_t seq)
{
    return (struct hgp_view_camera){.view = view,
        .input_seq = seq,
        .has_eye = true,
        .eye = {0, 0, 3 + 0.1f * (float)seq},
        .has_target = true};
}

static char folder[TEST_FOLDER_MAX]; // the sky, prefiltered once for all workers

static int make_folder(void **state)
{
    (void)state;
    return test_folder_make(folder, "encoders") ? 0 : -1;
}

static int remove_folder(void **state)
{
    (void)state;
    return test_folder_remove(folder) ? 0 : -1;
}

static int start(void **state)
{
    struct rig *rig = hg_calloc(1, sizeof *rig);
    assert_non_null(rig);
    encoder.opened = encoder.closed = encoder.begun = 0;
    set_encoder(false, false);
    rig->w.options.cache_dir = folder;
    assert_int_equal(hg_worker_init(&rig->w), HG_OK);
    assert_int_equal(hg_encode_queue_create(&rig->w, 0, find_encoder, &rig->w.encoders), HG_OK);
    assert_int_equal(pthread_create(&rig->render, NULL, hg_dispatch_main, &rig->w), 0);
    expect_ok(rig, HGP_T_session_attach,
        &(struct hgp_session_attach){.session = 1,
            .role = HGP_role_EDIT,
            .scene = hgp_str_make("a"),
            .first_id = 1000,
            .id_count = 100,
            .max_pixels = 1 << 20});
    *state = rig;
    return 0;
}

static int stop(void **state)
{
    struct rig *rig = *state;
    set_encoder(false, false);
    atomic_store(&rig->w.stop, true);
    hg_worker_wake(&rig->w);
    assert_int_equal(pthread_join(rig->render, NULL), 0);
    hg_encode_queue_destroy(rig->w.encoders);
    forget(rig);
    hg_worker_finish(&rig->w);
    assert_int_equal(encoder.closed, encoder.opened); // no state is left behind
    hg_free(rig);
    return 0;
}

// ---- tests --------------------------------------------------------------------------------------

// The view whose encoder is shut is not stepped any more, the other one gets a frame for every
// camera. Then the first goes on with its newest camera, and those between were not rendered.
static void test_a_slow_encoder_holds_up_its_own_view_alone(void **state)
{
    struct rig *rig = *state;
    set_encoder(true, false);
    set_view(rig, SLOW, SIDE, HGP_encoding_JPEG);
    set_view(rig, QUICK, SIDE, HGP_encoding_RAW_RGBA8);
    for (uint32_t view = SLOW; view <= QUICK; view++) {
        const struct hgp_view_camera first = camera(view, 1);
        expect_ok(rig, HGP_T_view_camera, &first);
    }
    ask(rig, HGP_T_subscribe, &(struct hgp_subscribe){.view = SLOW, .credit_frames = 1000});
    await_count(&encoder.begun, 1);
    struct watch_work work; // whoever waits for it learns what it waits for
    assert_true(hg_watch_longest_ns(&rig->w.watch, &work) > 0);
    assert_int_equal(work.channel, CHANNEL);
    assert_int_equal(work.view, SLOW);
    assert_int_equal(work.request, 0);
    ask(rig, HGP_T_subscribe, &(struct hgp_subscribe){.view = QUICK, .credit_frames = 1000});
    for (uint64_t seq = 2; seq <= CAMERAS; seq++) {
        const struct hgp_view_camera slow = camera(SLOW, seq), quick = camera(QUICK, seq);
        ask(rig, HGP_T_view_camera, &slow);
        ask(rig, HGP_T_view_camera, &quick);
        const struct hgp_frame *frame;
        do {
            frame = next_frame(rig);
            assert_int_equal(frame->view, QUICK);
        } while (frame->input_seq != seq);
    }
    assert_int_equal(count_now(&encoder.begun), 1);

    set_encoder(false, false);
    uint64_t number[3], seq[3];
    for (uint32_t got = 0; got < 3;) {
        const struct hgp_frame *frame = next_frame(rig);
        if (frame->view != SLOW)
            continue;
        number[got] = frame->number;
        seq[got++] = frame->input_seq;
    }
    assert_int_equal(seq[0], 1);
    assert_true(seq[1] < CAMERAS);
    assert_int_equal(seq[2], CAMERAS);
    assert_true(number[0] < number[1]);
    assert_int_equal(number[2], number[1] + 1);
}

// Who waits for the settled frame gets it from a view that is watched through a slow encoder.
static void test_a_settled_frame_behind_a_slow_encoder(void **state)
{
    struct rig *rig = *state;
    const struct hgp_view_camera first = camera(SLOW, 1);
    set_encoder(true, false);
    set_view(rig, SLOW, SIDE, HGP_encoding_JPEG);
    expect_ok(rig, HGP_T_view_camera, &first);
    ask(rig, HGP_T_subscribe, &(struct hgp_subscribe){.view = SLOW, .credit_frames = 1000});
    await_count(&encoder.begun, 1);
    const uint32_t request = ask(rig, HGP_T_frame_request,
        &(struct hgp_frame_request){.view = SLOW,
            .settled = true,
            .has_encoding = true,
            .encoding = HGP_encoding_RAW_RGBA8});
    const uint32_t ping = ask(rig, HGP_T_ping, &(struct hgp_ping){.nonce = 7});
    do
        next_message(rig);
    while (rig->header.request != ping); // the render thread answers, and does not wait
    assert_int_equal(rig->header.type, HGP_T_pong);
    set_encoder(false, false);
    const struct hgp_frame *frame;
    do
        frame = next_frame(rig);
    while (rig->header.request != request);
    assert_true(frame->settled);
    assert_int_equal(frame->samples, SAMPLES);
    assert_int_equal(frame->data.size, SIDE * SIDE * 4);
}

static void expect_number(struct rig *rig, uint32_t number)
{
    const struct hgp_frame *frame = next_frame(rig);
    struct hg_reader r = hg_reader_make(frame->data.data, frame->data.size);
    assert_int_equal(frame->data.size, 4);
    assert_int_equal(hg_read_u32(&r), number);
}

static void test_frames_of_a_view_stay_in_order_with_one_state(void **state)
{
    enum { FRAMES = 9 }; // more than a stream holds
    struct rig *rig = *state;
    const struct hgp_frame_request any = {.view = SLOW};
    const struct hgp_view_camera first = camera(SLOW, 1);
    uint32_t requests[FRAMES];
    set_encoder(true, false);
    set_view(rig, SLOW, SIDE, HGP_encoding_JPEG);
    expect_ok(rig, HGP_T_view_camera, &first);
    for (uint32_t i = 0; i < FRAMES; i++)
        requests[i] = ask(rig, HGP_T_frame_request, &any);
    await_count(&encoder.begun, 1);
    set_encoder(false, false);
    for (uint32_t i = 0; i < FRAMES; i++) {
        expect_number(rig, i);
        assert_int_equal(rig->header.request, requests[i]);
    }
    assert_int_equal(count_now(&encoder.opened), 1);

    set_view(rig, SLOW, SIDE / 2, HGP_encoding_JPEG); // frames of another size: another state
    ask(rig, HGP_T_frame_request, &any);
    expect_number(rig, 0);
    assert_int_equal(count_now(&encoder.opened), 2);
    assert_int_equal(count_now(&encoder.closed), 1);
}

static void test_a_failed_frame_is_answered_and_the_next_begins_anew(void **state)
{
    struct rig *rig = *state;
    const struct hgp_frame_request any = {.view = SLOW};
    const struct hgp_view_camera first = camera(SLOW, 1);
    set_view(rig, SLOW, SIDE, HGP_encoding_JPEG);
    expect_ok(rig, HGP_T_view_camera, &first);
    for (uint32_t i = 0; i < 2; i++) {
        ask(rig, HGP_T_frame_request, &any);
        expect_number(rig, i);
    }
    set_encoder(false, true);
    const uint32_t request = ask(rig, HGP_T_frame_request, &any);
    do
        next_message(rig);
    while (rig->header.request != request);
    assert_int_equal(rig->header.type, HGP_T_error);
    assert_int_equal(rig->message.error.code, HG_E_UNSUPPORTED);
    set_encoder(false, false);
    ask(rig, HGP_T_frame_request, &any);
    expect_number(rig, 0);
    assert_int_equal(count_now(&encoder.opened), 2);
}

static void test_a_view_closes_while_its_frame_is_encoded(void **state)
{
    struct rig *rig = *state;
    const struct hgp_view_camera first = camera(SLOW, 1);
    set_encoder(true, false);
    set_view(rig, SLOW, SIDE, HGP_encoding_JPEG);
    expect_ok(rig, HGP_T_view_camera, &first);
    const uint32_t request =
        ask(rig, HGP_T_frame_request, &(struct hgp_frame_request){.view = SLOW});
    await_count(&encoder.begun, 1);
    expect_ok(rig, HGP_T_view_close, &(struct hgp_view_close){.view = SLOW});
    assert_int_equal(count_now(&encoder.closed), 0);
    set_encoder(false, false);
    expect_number(rig, 0);
    assert_int_equal(rig->header.request, request);
    await_count(&encoder.closed, 1);
}

// ---- codecs -------------------------------------------------------------------------------------

// The first message of this type.
static void await_type(struct rig *rig, enum hgp_type type)
{
    do
        next_message(rig);
    while (rig->header.type != type);
}

static void set_codecs(struct rig *rig, const uint8_t *codecs, uint32_t count)
{
    expect_ok(rig, HGP_T_view_set,
        &(struct hgp_view_set){
            .view = QUICK, .has_codecs = true, .codecs = {(uint8_t *)codecs, count}});
}

// The next frame in motion, for a new camera.
static const struct hgp_frame *moved(struct rig *rig, uint64_t seq)
{
    const struct hgp_view_camera next = camera(QUICK, seq);
    const struct hgp_frame *frame;
    ask(rig, HGP_T_view_camera, &next);
    do
        frame = next_frame(rig);
    while (frame->input_seq != seq);
    return frame;
}

// The first of the client's codecs that this build has; what it cannot decode gives way to the next
// one, and a new list begins anew.
static void test_codecs_are_negotiated(void **state)
{
    struct rig *rig = *state;
    const uint8_t codecs[] = {200, HGP_encoding_EXR_HALF, HGP_encoding_TILES_JPEG,
        HGP_encoding_JPEG_444, HGP_encoding_RAW_RGBA8};
    set_view(rig, QUICK, SIDE, HGP_encoding_RAW_RGBA8);
    set_codecs(rig, codecs, sizeof codecs);
    await_type(rig, HGP_T_view_codec); // neither unknown ones nor those that are for files
    assert_int_equal(rig->message.view_codec.encoding, HGP_encoding_TILES_JPEG);
    ask(rig, HGP_T_subscribe, &(struct hgp_subscribe){.view = QUICK, .credit_frames = 1000});
    assert_int_equal(moved(rig, 1)->encoding, HGP_encoding_TILES_JPEG);
    expect_ok(rig, HGP_T_key_frame,
        &(struct hgp_key_frame){
            .view = QUICK, .has_failed = true, .failed = HGP_encoding_TILES_JPEG});
    await_type(rig, HGP_T_view_codec);
    assert_int_equal(rig->message.view_codec.encoding, HGP_encoding_JPEG_444);
    assert_int_equal(moved(rig, 2)->encoding, HGP_encoding_JPEG_444);
    set_codecs(rig, codecs, 3);
    await_type(rig, HGP_T_view_codec);
    assert_int_equal(rig->message.view_codec.encoding, HGP_encoding_TILES_JPEG);
    set_codecs(rig, codecs, 2); // none will do: `encoding`
    await_type(rig, HGP_T_view_codec);
    assert_int_equal(rig->message.view_codec.encoding, HGP_encoding_RAW_RGBA8);
}

// With alpha an encoding that keeps it comes first.
static void test_codecs_of_a_view_without_background(void **state)
{
    struct rig *rig = *state;
    const uint8_t codecs[] = {HGP_encoding_JPEG_444, HGP_encoding_TILES};
    set_view(rig, QUICK, SIDE, HGP_encoding_RAW_RGBA8);
    expect_ok(rig, HGP_T_view_set,
        &(struct hgp_view_set){
            .view = QUICK, .has_background = true, .background = HGP_background_NONE});
    set_codecs(rig, codecs, 2);
    await_type(rig, HGP_T_view_codec);
    assert_int_equal(rig->message.view_codec.encoding, HGP_encoding_TILES);
}

// Each frame names the one before of its decoder, whatever is left out; a subscription and a
// request begin with a key frame.
static void test_frames_say_what_they_depend_on(void **state)
{
    struct rig *rig = *state;
    const uint8_t codecs[] = {HGP_encoding_H264, HGP_encoding_TILES};
    uint64_t before = 0;
    set_view(rig, QUICK, SIDE, HGP_encoding_RAW_RGBA8);
    set_codecs(rig, codecs, sizeof codecs);
    ask(rig, HGP_T_subscribe, &(struct hgp_subscribe){.view = QUICK, .credit_frames = 1000});
    for (uint64_t seq = 1; seq <= 12; seq++) {
        const struct hgp_view_camera next = camera(QUICK, seq);
        const struct hgp_frame *frame;
        if (seq == 7) { // frames may be under way meanwhile
            expect_ok(rig, HGP_T_key_frame, &(struct hgp_key_frame){.view = QUICK});
            before = 0;
        }
        bool key = false;
        ask(rig, HGP_T_view_camera, &next);
        do { // settled frames of another encoding lie between
            frame = next_frame(rig);
            if (frame->encoding == HGP_encoding_RAW_RGBA8)
                continue;
            key |= !frame->has_depends;
            if (frame->has_depends && before)
                assert_int_equal(frame->number - frame->depends, before);
            assert_int_equal(
                frame->has_codec, !frame->has_depends && frame->encoding != HGP_encoding_TILES);
            before = frame->number;
        } while (frame->input_seq != seq || frame->encoding == HGP_encoding_RAW_RGBA8);
        assert_int_equal(key, seq == 1 || seq == 7);
    }
}

// Asked for twice in tiles, the picture at rest is a key frame twice: it cannot take itself.
static void test_a_picture_again_is_a_key_frame(void **state)
{
    struct rig *rig = *state;
    const struct hgp_view_camera first = camera(QUICK, 1);
    uint64_t number = 0;
    set_view(rig, QUICK, SIDE, HGP_encoding_JPEG);
    expect_ok(rig, HGP_T_view_camera, &first);
    for (int i = 0; i < 2; i++) {
        ask(rig, HGP_T_frame_request,
            &(struct hgp_frame_request){.view = QUICK,
                .settled = true,
                .has_encoding = true,
                .encoding = HGP_encoding_TILES});
        const struct hgp_frame *frame = next_frame(rig);
        assert_int_equal(frame->encoding, HGP_encoding_TILES);
        assert_false(frame->has_depends);
        assert_true(i == 0 || frame->number == number);
        number = frame->number;
    }
}

// ---- parts of it --------------------------------------------------------------------------------

enum { LARGE = 1024 }; // px; no frame for the thread of small ones

static int start_queue(void **state)
{
    struct rig *rig = hg_calloc(1, sizeof *rig);
    assert_non_null(rig);
    encoder.opened = encoder.closed = encoder.begun = 0;
    set_encoder(false, false);
    assert_int_equal(hg_worker_init(&rig->w), HG_OK);
    assert_int_equal(hg_encode_queue_create(&rig->w, 1, find_encoder, &rig->w.encoders), HG_OK);
    *state = rig;
    return 0;
}

static int stop_queue(void **state)
{
    struct rig *rig = *state;
    set_encoder(false, false);
    hg_encode_queue_destroy(rig->w.encoders);
    forget(rig);
    hg_worker_finish(&rig->w);
    hg_free(rig);
    return 0;
}

static struct encode_stream *push(struct rig *rig, uint32_t view, uint64_t due_ns)
{
    struct encode_stream *stream = hg_encode_stream_open(rig->w.encoders);
    struct encode_request *request = hg_calloc(1, sizeof *request);
    assert_true(stream && request);
    request->to = (struct reply_to){.w = &rig->w, .channel = CHANNEL};
    request->frame.view = view;
    request->frame.width = request->frame.height = LARGE;
    request->frame.encoding = HGP_encoding_JPEG;
    request->due_ns = due_ns;
    request->pixels = hg_refbuf_create(4);
    hg_encode_stream_push(stream, request);
    return stream;
}

// Not in the order in which they came. Without a due time a frame has some time for its size.
static void test_frames_are_encoded_by_when_they_are_due(void **state)
{
    enum { FRAMES = 5 };
    struct rig *rig = *state;
    struct encode_stream *streams[FRAMES];
    const uint64_t now_ns = hg_clock_now_ns(), hour_ns = UINT64_C(3600000000000);
    set_encoder(true, false);
    streams[0] = push(rig, 1, now_ns + 1);
    await_count(&encoder.begun, 1);
    streams[1] = push(rig, 2, now_ns + 2 * hour_ns);
    streams[2] = push(rig, 3, now_ns + hour_ns);
    streams[3] = push(rig, 4, 0);
    streams[4] = push(rig, 5, now_ns + 2);
    set_encoder(false, false);
    await_count(&encoder.begun, FRAMES);
    static const uint32_t order[FRAMES] = {1, 5, 4, 3, 2};
    assert_memory_equal(encoder.views, order, sizeof order);
    for (int i = 0; i < FRAMES; i++)
        hg_encode_stream_close(streams[i]);
    await_count(&encoder.closed, FRAMES);
}

// A view whose frames its encoder or its network does not hold.
static void test_codecs_are_left_and_come_back(void **state)
{
    struct rig *rig = *state;
    struct render_state s = {.w = &rig->w};
    struct view_slot view = {.encoder = hg_encode_stream_open(rig->w.encoders)};
    struct view_subscription *sub = &view.subscription;
    const uint8_t codecs[] = {HGP_encoding_JPEG, HGP_encoding_JPEG_444, HGP_encoding_H264};
    const bool has_video = hg_encoder_find(HGP_encoding_H264) != NULL;
    sub->encoding = HGP_encoding_RAW_RGBA8;
    sub->target_fps = sub->max_fps = 30;
    hg_codec_set_list(&view, (struct hgp_bytes){(uint8_t *)codecs, sizeof codecs});
    hg_codec_choose(&s, &view);
    assert_int_equal(sub->motion, HGP_encoding_JPEG);
    for (int times = 0; times < 3; times++) {
        view.control.encoded = 20;
        view.control.encode_ns = 1e9;
        hg_codec_choose(&s, &view);
        assert_int_equal(sub->motion, HGP_encoding_JPEG_444);
        hg_codec_choose(&s, &view); // it stays so
        assert_int_equal(sub->motion, HGP_encoding_JPEG_444);
        assert_true(sub->codecs.slow_until_ns > hg_clock_now_ns());
        if (times == 1) // another size
            hg_codec_resized(&view);
        else // after its time
            sub->codecs.slow_until_ns = hg_clock_now_ns();
        hg_codec_choose(&s, &view);
        assert_int_equal(sub->motion, HGP_encoding_JPEG);
    }
    // A narrow network: video, until it is twice as wide.
    view.control.informed = true;
    view.control.encoded = 20;
    view.control.usual_bytes = 100000;
    view.control.rate = 200000;
    hg_codec_choose(&s, &view);
    assert_int_equal(sub->motion, has_video ? HGP_encoding_H264 : HGP_encoding_JPEG);
    view.control.rate = 390000;
    hg_codec_choose(&s, &view);
    assert_int_equal(sub->motion, has_video ? HGP_encoding_H264 : HGP_encoding_JPEG);
    view.control.rate = 4100000;
    hg_codec_choose(&s, &view);
    assert_int_equal(sub->motion, HGP_encoding_JPEG);
    hg_encode_stream_close(view.encoder);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, start, stop)
    const struct CMUnitTest tests[] = {
        TEST(test_a_slow_encoder_holds_up_its_own_view_alone),
        TEST(test_a_settled_frame_behind_a_slow_encoder),
        TEST(test_frames_of_a_view_stay_in_order_with_one_state),
        TEST(test_a_failed_frame_is_answered_and_the_next_begins_anew),
        TEST(test_a_view_closes_while_its_frame_is_encoded),
        TEST(test_codecs_are_negotiated),
        TEST(test_codecs_of_a_view_without_background),
        TEST(test_frames_say_what_they_depend_on),
        TEST(test_a_picture_again_is_a_key_frame),
        cmocka_unit_test_setup_teardown(
            test_frames_are_encoded_by_when_they_are_due, start_queue, stop_queue),
        cmocka_unit_test_setup_teardown(
            test_codecs_are_left_and_come_back, start_queue, stop_queue),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
