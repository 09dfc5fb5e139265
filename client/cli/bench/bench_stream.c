#include "client/cli/bench/bench_stream.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/file.h"

enum { VIEW = 1, NODES = 16, MOST_FRAMES = 3000 };

// Encodings that are compared, and what a file of their frames, one behind the other, is called.
static const struct coding {
    enum hgp_encoding encoding;
    const char *file; // NULL: frames make no stream that other programs read
} codings[] = {
    {HGP_encoding_PNG8, NULL},
    {HGP_encoding_ZSTD_RGBA8, NULL},
    {HGP_encoding_JPEG, "jpeg.mjpeg"},
    {HGP_encoding_JPEG_444, "jpeg-444.mjpeg"},
    {HGP_encoding_H264, "h264.h264"},
    {HGP_encoding_H264_444, "h264-444.h264"},
    {HGP_encoding_AV1, "av1.obu"},
    {HGP_encoding_TILES, NULL},
    {HGP_encoding_TILES_JPEG, NULL},
};

struct stream {
    struct helio *h;
    struct hgp_scene_opened scene;
    const char *path; // of the scene
    const char *keep; // folder, or NULL
    uint32_t width, height, frames, samples, quality;
    enum hgp_gi gi;
    uint64_t seq;
    json_t *report;
};

// What the frames of an encoding came to.
struct sums {
    uint64_t bytes, most_bytes, first_bytes, encode_ns;
    uint32_t keys;
};

// ---- frames -------------------------------------------------------------------------------------

static enum hg_status open_scene(struct stream *s, struct hg_error *err)
{
    struct hgp_asset_loaded loaded;
    const struct hgp_view_set view = {.view = VIEW,
        .has_width = true,
        .width = s->width,
        .has_height = true,
        .height = s->height,
        .has_samples = true,
        .samples = s->samples,
        .has_quality = true,
        .quality = (uint8_t)s->quality,
        .has_exposure_mode = true,
        .exposure_mode = HGP_exposure_mode_FIXED,
        .has_gi = true,
        .gi = (uint8_t)s->gi};
    enum hg_status status = helio_scene_open(s->h, "", &s->scene, err);
    if (!status)
        status = helio_load(s->h, s->scene.first_id, s->path, &loaded, err);
    if (!status)
        status = helio_call_for(s->h, HGP_T_view_set, &view, HGP_T_ok, NULL, err);
    return status;
}

// What comes without being asked for, such as signs of life.
static void drop_messages(struct stream *s)
{
    struct helio_message *message;
    while (helio_next(s->h, &message, NULL) == HG_OK)
        helio_message_free(message);
}

static enum hg_status move(struct stream *s, uint32_t pose, struct hg_error *err)
{
    const struct hgp_view_fit fit = {.view = VIEW,
        .has_azimuth_rad = true,
        .azimuth_rad = (float)(2 * M_PI * pose / s->frames),
        .has_turntable = true,
        .turntable = true};
    struct hgp_view_camera camera = {.view = VIEW, .input_seq = ++s->seq};
    drop_messages(s);
    const enum hg_status status = helio_camera_fit(s->h, &fit, &camera, err);
    return status ? status : helio_call_for(s->h, HGP_T_view_camera, &camera, HGP_T_ok, NULL, err);
}

static uint64_t stage_ns(const struct hgp_frame *frame, const char *name)
{
    for (uint32_t i = 0; i < frame->stages.count; i++)
        if (frame->stages.items[i].name.size == strlen(name) &&
            memcmp(frame->stages.items[i].name.data, name, strlen(name)) == 0)
            return frame->stages.items[i].ns;
    return 0;
}

static enum hg_status take(
    struct stream *s, enum hgp_encoding encoding, struct helio_message **out, struct hg_error *err)
{
    const struct hgp_frame_request request = {
        .view = VIEW, .settled = true, .has_encoding = true, .encoding = encoding};
    return helio_frame(s->h, &request, out, err);
}

static void add(struct sums *sums, const struct hgp_frame *frame)
{
    if (!sums->bytes)
        sums->first_bytes = frame->data.size;
    sums->bytes += frame->data.size;
    sums->most_bytes = sums->most_bytes > frame->data.size ? sums->most_bytes : frame->data.size;
    sums->encode_ns += stage_ns(frame, "encode");
    sums->keys += !frame->has_depends;
}

// Pictures for comparison, one file each; streams, one file.
static enum hg_status keep(struct stream *s, const struct coding *coding, uint32_t pose,
    const struct hgp_frame *frame, struct hg_writer *file)
{
    char name[4096];
    hg_write_bytes(
        file, coding->file ? frame->data.data : NULL, coding->file ? frame->data.size : 0);
    if (coding->encoding != HGP_encoding_PNG8)
        return file->failed ? HG_E_NOMEM : HG_OK;
    snprintf(name, sizeof name, "%s/pose-%04u.png", s->keep, pose);
    return hg_file_write_atomic(name, frame->data.data, frame->data.size, NULL);
}

// ---- an encoding --------------------------------------------------------------------------------

static enum hg_status walk(struct stream *s, const struct coding *coding, struct sums *sums,
    struct hg_writer *file, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t pose = 0; pose < s->frames && !status; pose++) {
        struct helio_message *frame = NULL;
        status = move(s, pose, err);
        if (!status)
            status = take(s, coding->encoding, &frame, err);
        if (!status) {
            add(sums, &frame->body->frame);
            if (s->keep && keep(s, coding, pose, &frame->body->frame, file))
                status = hg_error_set(err, HG_E_IO, s->keep, NULL, "a frame cannot be kept");
        }
        helio_message_free(frame);
        if (!status && hg_cli_is_stopped())
            status = hg_error_set(err, HG_E_CANCELLED, "bench stream", NULL, "interrupted");
    }
    return status;
}

static enum hg_status measure(struct stream *s, const struct coding *coding, struct hg_error *err)
{
    struct sums sums = {0};
    struct hg_writer file = {0};
    char word[HGP_WORD_BYTES], name[4096];
    hgp_enum_word("encoding", (uint32_t)coding->encoding, word);
    enum hg_status status = walk(s, coding, &sums, &file, err);
    if (status == HG_E_UNSUPPORTED) { // not in this build
        *err = (struct hg_error){0};
        json_object_set_new(json_object_get(s->report, "codecs"), word, json_null());
        hg_writer_finish(&file);
        return HG_OK;
    }
    snprintf(name, sizeof name, "%s/%s", s->keep ? s->keep : "", coding->file ? coding->file : "");
    if (!status && s->keep && coding->file)
        status = hg_file_write_atomic(name, file.data, file.size, err);
    hg_writer_finish(&file);
    if (!status)
        json_object_set_new(json_object_get(s->report, "codecs"), word,
            json_pack("{s:I, s:f, s:I, s:I, s:i, s:f}", "bytes", (json_int_t)sums.bytes,
                "bytes_per_frame", (double)sums.bytes / s->frames, "first_bytes",
                (json_int_t)sums.first_bytes, "most_bytes", (json_int_t)sums.most_bytes,
                "key_frames", (int)sums.keys, "encode_ms",
                (double)sums.encode_ns * 1e-6 / s->frames));
    return status;
}

// ---- edits --------------------------------------------------------------------------------------

static enum hg_status take_bytes(
    struct stream *s, enum hgp_encoding encoding, uint32_t *bytes, struct hg_error *err)
{
    struct helio_message *frame;
    const enum hg_status status = take(s, encoding, &frame, err);
    *bytes = status ? 0 : frame->body->frame.data.size;
    helio_message_free(frame);
    return status;
}

// Pixels that differ, of all. Pictures without pixels in common: all.
static double changed_share(const struct helio_message *a, const struct helio_message *b)
{
    const struct hgp_frame *x = &a->body->frame, *y = &b->body->frame;
    uint32_t changed = 0;
    if (x->data.size != y->data.size || x->data.size < 4)
        return 1;
    for (uint32_t i = 0; i + 4 <= x->data.size; i += 4)
        changed += memcmp(x->data.data + i, y->data.data + i, 4) != 0;
    return (double)changed / (double)(x->data.size / 4);
}

static enum hg_status show(struct stream *s, uint64_t node, bool visible, struct hg_error *err)
{
    const struct hgp_node_set set = {.node = node, .has_visible = true, .visible = visible};
    return helio_call_for(s->h, HGP_T_node_set, &set, HGP_T_ok, NULL, err);
}

// What the present picture costs: [0] in tiles, of which the client has the ones that did not
// change, [1] as a whole.
static enum hg_status take_both(struct stream *s, uint32_t bytes[2], struct hg_error *err)
{
    const enum hg_status status = take_bytes(s, HGP_encoding_TILES_JPEG, &bytes[0], err);
    return status ? status : take_bytes(s, HGP_encoding_JPEG, &bytes[1], err);
}

static json_t *edit_json(
    uint64_t node, double changed, const uint32_t hidden[2], const uint32_t shown[2])
{
    const double hiding = (double)hidden[1] / hidden[0], showing = (double)shown[1] / shown[0];
    return json_pack("{s:I, s:f, s:i, s:i, s:i, s:f}", "node", (json_int_t)node, "changed", changed,
        "hidden_bytes", (int)hidden[0], "shown_bytes", (int)shown[0], "jpeg_bytes", (int)shown[1],
        "ratio", hiding < showing ? hiding : showing);
}

// A node disappears, and comes back. Of one that no pixel shows nothing is noted.
static enum hg_status edit(
    struct stream *s, const struct helio_message *before, uint64_t node, struct hg_error *err)
{
    struct helio_message *after = NULL;
    uint32_t hidden[2] = {0}, shown[2] = {0};
    enum hg_status status = show(s, node, false, err);
    if (!status)
        status = take(s, HGP_encoding_RAW_RGBA8, &after, err);
    const double changed = status ? 0 : changed_share(before, after);
    helio_message_free(after);
    if (!status && changed > 0)
        status = take_both(s, hidden, err);
    if (!status)
        status = show(s, node, true, err);
    if (!status && changed > 0)
        status = take_both(s, shown, err);
    if (!status && changed > 0)
        json_array_append_new(
            json_object_get(s->report, "edits"), edit_json(node, changed, hidden, shown));
    return status;
}

// The camera of the scene, which stands where there is something to see, or one that sees all.
static enum hg_status stand(struct stream *s, struct hg_error *err)
{
    const struct hgp_view_fit fit = {.view = VIEW, .has_cameras = true, .cameras = true};
    struct hgp_view_camera camera = {.view = VIEW, .input_seq = ++s->seq};
    drop_messages(s);
    const enum hg_status status = helio_camera_fit(s->h, &fit, &camera, err);
    return status ? status : helio_call_for(s->h, HGP_T_view_camera, &camera, HGP_T_ok, NULL, err);
}

// Which nodes the picture shows, those with most pixels first.
static enum hg_status find_seen(struct stream *s, struct helio_message **seen, struct hg_error *err)
{
    struct hgp_pixel_rect all = {.width = s->width, .height = s->height};
    const struct hgp_box_select select = {.view = VIEW, .rects = {.items = &all, .count = 1}};
    return helio_call_for(s->h, HGP_T_box_select, &select, HGP_T_box_selected, seen, err);
}

// Of nodes that are seen, from the largest to the smallest.
static enum hg_status measure_edits(struct stream *s, struct hg_error *err)
{
    struct helio_message *seen = NULL, *before = NULL;
    uint32_t bytes, done = 0;
    enum hg_status status = take(s, HGP_encoding_RAW_RGBA8, &before, err);
    if (!status)
        status = take_bytes(s, HGP_encoding_TILES_JPEG, &bytes, err);
    if (!status)
        status = find_seen(s, &seen, err);
    const uint32_t count = status ? 0 : seen->body->box_selected.nodes.count;
    for (uint32_t i = 0; i < count && done < NODES && !status; i++) {
        if ((uint64_t)i * NODES < (uint64_t)done * count)
            continue;
        status = edit(s, before, seen->body->box_selected.nodes.items[i].node, err);
        done++;
    }
    helio_message_free(before);
    helio_message_free(seen);
    return status;
}

// ---- all ----------------------------------------------------------------------------------------

static enum hg_status read_options(struct stream *s, const json_t *options, struct hg_error *err)
{
    json_error_t wrong;
    int width = 1280, height = 720, frames = 300, samples = 4, quality = 80, gi = HGP_gi_NONE;
    s->path = "demo:";
    if (json_unpack_ex((json_t *)options, &wrong, JSON_STRICT,
            "{s?s, s?s, s?i, s?i, s?i, s?i, s?i, s?i}", "scene", &s->path, "keep", &s->keep,
            "width", &width, "height", &height, "frames", &frames, "samples", &samples, "quality",
            &quality, "gi", &gi))
        return hg_error_set(err, HG_E_INVAL, "bench stream", "--options", "%s", wrong.text);
    if (width < 1 || width > 16384 || height < 1 || height > 16384 || frames < 1 ||
        frames > MOST_FRAMES || samples < 1 || samples > 4096 || quality < 1 || quality > 100 ||
        gi < 0 || gi > HGP_gi_AUTO)
        return hg_error_set(err, HG_E_INVAL, "bench stream", "--options",
            "width and height are 1 to 16384, frames 1 to %d, samples 1 to 4096, quality 1 to 100, "
            "gi "
            "is 0 (none) or 1 (auto)",
            MOST_FRAMES);
    s->width = (uint32_t)width;
    s->height = (uint32_t)height;
    s->frames = (uint32_t)frames;
    s->samples = (uint32_t)samples;
    s->quality = (uint32_t)quality;
    s->gi = (enum hgp_gi)gi;
    s->report = json_pack("{s:s, s:i, s:i, s:i, s:i, s:i, s:{}, s:[]}", "scene", s->path, "width",
        width, "height", height, "frames", frames, "samples", samples, "quality", quality, "codecs",
        "edits");
    return s->report ? HG_OK : hg_error_set(err, HG_E_NOMEM, "bench stream", NULL, "no memory");
}

static enum hg_status run(struct stream *s, struct hg_error *err)
{
    enum hg_status status = helio_connect(&(struct helio_options){0}, &s->h, err);
    if (!status)
        status = open_scene(s, err);
    for (size_t i = 0; i < sizeof codings / sizeof *codings && !status; i++)
        status = measure(s, &codings[i], err);
    if (!status)
        status = stand(s, err);
    return status ? status : measure_edits(s, err);
}

enum hg_status hg_cli_bench_stream(
    struct hg_cli *cli, const json_t *options, char **report, struct hg_error *err)
{
    struct stream s = {0};
    *report = NULL;
    hg_cli_progress_stage(&cli->progress, "measuring streams");
    enum hg_status status = read_options(&s, options, err);
    if (!status)
        status = run(&s, err);
    helio_destroy(s.h);
    char *text = status ? NULL : json_dumps(s.report, JSON_REAL_PRECISION(6));
    if (text)
        *report = hg_strdup(text);
    if (!status && !*report)
        status = hg_error_set(err, HG_E_NOMEM, "bench stream", NULL, "no memory");
    free(text);
    json_decref(s.report);
    return status;
}
