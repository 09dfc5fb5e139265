// frame_stats.c - helio render: what is noted of each frame, and the statistics file.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/sha256.h"
#include "base/utf8.h"
#include "client/cli/frames.h"

static void set_hash(json_t *object, const char *key, const uint8_t hash[32])
{
    char hex[HG_SHA256_HEX];
    hg_sha256_hex(hash, hex);
    json_object_set_new(object, key, json_string(hex));
}

enum hg_status hg_cli_frame_note(struct hg_cli_render *r, const struct hgp_frame *frame,
    const char *name, uint64_t total_ns, struct hg_error *err)
{
    json_t *stages = json_array();
    for (uint32_t i = 0; i < frame->stages.count; i++) {
        const struct hgp_stage_time *s = &frame->stages.items[i];
        json_array_append_new(
            stages, json_pack("{s:o?, s:f}", "name",
                        json_stringn(s->name.data ? s->name.data : "", s->name.size), "ms",
                        (double)s->ns / 1e6));
    }
    char file[4200]; // names are bytes, JSON is UTF-8
    snprintf(file, sizeof file, "%s", name);
    hg_utf8_clean(file);
    json_t *o = json_pack("{s:s, s:I, s:I, s:I, s:I, s:I, s:b, s:b, s:I, s:f, s:o}", "file", file,
        "width", (json_int_t)frame->width, "height", (json_int_t)frame->height, "samples",
        (json_int_t)frame->samples, "missing_pages", (json_int_t)frame->missing_pages,
        "missing_clusters", (json_int_t)frame->missing_clusters, "settled", frame->settled,
        "lossless", frame->lossless, "bytes",
        (json_int_t)(frame->has_size ? frame->size : frame->data.size), "total_ms",
        (double)total_ns / 1e6, "stages", stages);
    if (!o || json_array_append_new(r->frames, o))
        return hg_error_set(err, HG_E_NOMEM, "statistics", NULL, "no memory");
    r->last = o;
    if (frame->has_mode)
        json_object_set_new(
            o, "mode", json_string(frame->mode == HGP_render_mode_PATH ? "path" : "realtime"));
    if (frame->has_noise)
        json_object_set_new(o, "noise", json_real((double)frame->noise));
    if (frame->has_job)
        set_hash(o, "job", frame->job);
    if (frame->has_hash)
        set_hash(o, "hash", frame->hash);
    return HG_OK;
}

static void set_ms(json_t *object, const char *key, uint64_t ns)
{
    json_object_set_new(object, key, json_real((double)ns / 1e6));
}

// The worker's statistics, with the newest frame's provenance and the client's own times.
enum hg_status hg_cli_render_stats(struct hg_cli_render *r, struct hg_error *err)
{
    json_t *stats;
    r->doing = HG_CLI_DOING_RENDER;
    enum hg_status status = hg_cli_stats(&r->cli, &stats, err);
    if (status)
        return status;
    json_t *frame = json_object_get(stats, "frame");
    if (!json_is_object(frame)) {
        frame = json_object();
        json_object_set_new(stats, "frame", frame);
    }
    if (r->last)
        json_object_update_missing(frame, r->last);
    json_t *client = json_object();
    set_ms(client, "connect_ms", r->cli.connect_ns);
    set_ms(client, "load_ms", r->load_ns);
    set_ms(client, "first_frame_ms", r->first_frame_ns);
    set_ms(client, "total_ms", hg_clock_now_ns() - r->cli.begin_ns);
    json_object_set_new(client, "uploaded_bytes", json_integer((json_int_t)r->upload_bytes));
    json_object_set_new(client, "skipped_frames", json_integer(r->skipped));
    json_object_set_new(client, "embedded", json_boolean(r->cli.embedded));
    json_object_set_new(client, "version", json_string(HELIO_VERSION));
    json_object_set_new(stats, "client", client);
    json_object_set(stats, "frames", r->frames);
    char *text = json_dumps(stats, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    json_decref(stats);
    if (!text)
        return hg_error_set(err, HG_E_NOMEM, "statistics", NULL, "no memory");
    size_t length = strlen(text);
    text[length] = '\n'; // over the terminator, which is not written
    r->doing = HG_CLI_DOING_OUTPUT;
    status = hg_cli_write_output(r->o->stats_file, text, length + 1, err);
    free(text);
    return status;
}
