// frame_stats.c - helio render: what is noted of each frame, and the statistics file.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/sha256.h"
#include "base/utf8.h"
#include "client/cli/render/frames.h"

static void set_hash(json_t *object, const char *key, const uint8_t hash[32])
{
    char hex[HG_SHA256_HEX];
    hg_sha256_hex(hash, hex);
    json_object_set_new(object, key, json_string(hex));
}

json_t *hg_cli_frame_json(const struct hgp_frame *frame, const char *name, uint64_t total_ns)
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
    if (!o)
        return NULL;
    const bool path = frame->has_mode && frame->mode == HGP_render_mode_PATH;
    json_object_set_new(o, "mode", json_string(path ? "path" : "realtime"));
    if (frame->has_noise)
        json_object_set_new(o, "noise", json_real((double)frame->noise));
    if (frame->has_exposure_ev)
        json_object_set_new(o, "exposure_ev", json_real((double)frame->exposure_ev));
    if (frame->has_black)
        json_object_set_new(o, "black", json_real((double)frame->black));
    if (frame->has_clipped)
        json_object_set_new(o, "clipped", json_real((double)frame->clipped));
    if (frame->has_job)
        set_hash(o, "job", frame->job);
    if (frame->has_hash)
        set_hash(o, "hash", frame->hash);
    return o;
}

enum hg_status hg_cli_frame_note(struct hg_cli_render *r, const struct hgp_frame *frame,
    const char *name, uint64_t total_ns, struct hg_error *err)
{
    json_t *o = hg_cli_frame_json(frame, name, total_ns);
    if (!o || json_array_append_new(r->frames, o))
        return hg_error_set(err, HG_E_NOMEM, "statistics", NULL, "no memory");
    r->last = o;
    const struct hg_cli_region *region = &r->o->region;
    if (r->o->has_region)
        json_object_set_new(o, "region",
            json_pack("[I, I, I, I]", (json_int_t)region->x, (json_int_t)region->y,
                (json_int_t)region->width, (json_int_t)region->height));
    return HG_OK;
}

static void set_ms(json_t *object, const char *key, uint64_t ns)
{
    json_object_set_new(object, key, json_real((double)ns / 1e6));
}

enum hg_status hg_cli_stats_complete(json_t *stats, const struct hg_cli *cli, json_t *newest,
    const struct hg_cli_client_stats *own, struct hg_error *err)
{
    json_t *frame = json_object_get(stats, "frame"), *client = json_object();
    if (!json_is_object(frame)) {
        frame = json_object();
        json_object_set_new(stats, "frame", frame);
    }
    if (newest)
        json_object_update_missing(frame, newest);
    json_t *camera = json_object_get(stats, "camera");
    if (own->fitted && camera)
        json_object_set_new(camera, "source", json_string("fit"));
    set_ms(client, "connect_ms", cli->connect_ns);
    set_ms(client, "load_ms", own->load_ns);
    set_ms(client, "first_frame_ms", own->first_frame_ns);
    set_ms(client, "total_ms", hg_clock_now_ns() - cli->begin_ns);
    json_object_set_new(client, "uploaded_bytes", json_integer((json_int_t)own->uploaded_bytes));
    json_object_set_new(client, "skipped_frames", json_integer(own->skipped_frames));
    json_object_set_new(client, "embedded", json_boolean(cli->embedded));
    json_object_set_new(client, "version", json_string(HELIO_VERSION));
    return json_object_set_new(stats, "client", client)
               ? hg_error_set(err, HG_E_NOMEM, "statistics", NULL, "no memory")
               : HG_OK;
}

enum hg_status hg_cli_render_stats(struct hg_cli_render *r, struct hg_error *err)
{
    json_t *stats;
    r->doing = HG_CLI_DOING_RENDER;
    enum hg_status status = hg_cli_stats(&r->cli, &stats, err);
    if (status)
        return status;
    json_t *exposure = json_object_get(stats, "exposure");
    if (r->light.metered && exposure)
        json_object_set_new(exposure, "mode", json_string("auto"));
    const struct hg_cli_client_stats own = {.load_ns = r->load_ns,
        .first_frame_ns = r->first_frame_ns,
        .uploaded_bytes = r->upload_bytes,
        .skipped_frames = r->skipped,
        .fitted = r->turntable.fitted};
    status = hg_cli_stats_complete(stats, &r->cli, r->last, &own, err);
    json_t *client = json_object_get(stats, "client");
    if (client && r->loaded.up_reason[0]) {
        json_object_set_new(client, "up", json_string(hg_cli_up_name(r->loaded.up)));
        json_object_set_new(client, "up_reason", json_string(r->loaded.up_reason));
    }
    json_object_set(stats, "frames", r->frames);
    char *text = status ? NULL : json_dumps(stats, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
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
