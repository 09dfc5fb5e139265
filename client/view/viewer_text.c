// viewer_text.c - what the viewer writes over the picture: help, statistics, state, messages.
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "client/view/viewer.h"

static const char *style_name(enum hg_navigate_style style)
{
    static const char *const names[] = {"orbit", "fly", "walk"};
    return names[style];
}

static const char *encoding_name(enum hgp_encoding encoding)
{
    switch (encoding) {
    case HGP_encoding_RAW_RGBA8:
        return "raw";
    case HGP_encoding_ZSTD_RGBA8:
        return "zstd";
    case HGP_encoding_JPEG:
        return "jpeg";
    case HGP_encoding_JPEG_444:
        return "jpeg 4:4:4";
    case HGP_encoding_TILES:
    case HGP_encoding_TILES_JPEG:
        return "tiles";
    case HGP_encoding_H264:
        return "h264";
    case HGP_encoding_AV1:
        return "av1";
    default:
        return "other";
    }
}

// ---- help --------------------------------------------------------------------------------------

enum { HELP_ROWS_MAX = 80, HELP_DOC_COLUMNS = 62 };

static uint32_t list_rows(const struct hg_viewer *v, struct hg_view_row rows[HELP_ROWS_MAX])
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < hg_view_pointer_row_count; i++)
        rows[count++] = hg_view_pointer_rows[i];
    for (int i = 0; i < HG_VIEW_ACTION_COUNT; i++)
        rows[count++] = (struct hg_view_row){hg_view_keys[i].key, hg_view_keys[i].doc};
    for (uint32_t i = 0; i < hg_view_panel_row_count; i++)
        rows[count++] = hg_view_panel_rows[i];
    for (uint32_t i = 0; v->controls.pad && i < hg_view_pad_row_count; i++)
        rows[count++] = hg_view_pad_rows[i];
    return count;
}

// In two columns.
static void draw_help(struct hg_viewer *v)
{
    static struct hg_overlay_text text; // too large for the stack
    struct hg_view_row rows[HELP_ROWS_MAX];
    const uint32_t count = list_rows(v, rows), half = (count + 1) / 2;
    text.count = 0;
    for (uint32_t i = 0; i < half; i++) {
        const bool two = half + i < count;
        hg_overlay_add(&text, HG_OVERLAY_PLAIN, "%-21s %-*s  %-21s %s", rows[i].what,
            HELP_DOC_COLUMNS, rows[i].doc, two ? rows[half + i].what : "",
            two ? rows[half + i].doc : "");
    }
    hg_overlay_draw(&v->overlay, &text, HG_OVERLAY_TOP_LEFT, v->width, v->height);
}

// ---- statistics --------------------------------------------------------------------------------

static void add_stages(struct hg_overlay_text *text, const struct hg_view_facts *f)
{
    for (uint32_t i = 0; i < f->stage_count; i++)
        hg_overlay_add(text, HG_OVERLAY_DIM, "  %-14s %7.2f ms", f->stages[i].name,
            (double)f->stages[i].ns * 1e-6);
}

static void add_flow(struct hg_overlay_text *text, const struct hg_view_flow *f)
{
    if (!f->is_known)
        return;
    hg_overlay_add(text, HG_OVERLAY_PLAIN,
        "server: %.0f frames/s, %.1f ms, quality %u, %.1f Mbit/s", f->target_fps, f->target_ms,
        f->quality, (double)f->bitrate * 1e-6);
    hg_overlay_add(text, HG_OVERLAY_PLAIN, "network %.1f Mbit/s  trip %.1f ms  delay %.1f ms",
        f->rate_mbit_s, f->rtt_ms, f->delay_ms);
    hg_overlay_add(text, HG_OVERLAY_PLAIN, "under way %llu frames, %llu bytes  held %llu",
        (unsigned long long)f->under_way, (unsigned long long)f->bytes_under_way,
        (unsigned long long)f->held);
}

static void draw_statistics(struct hg_viewer *v)
{
    static struct hg_overlay_text text;
    const struct hg_view_facts *f = &v->picture.facts;
    const struct hg_viewer_measured *m = &v->measured;
    text.count = 0;
    hg_overlay_add(&text, HG_OVERLAY_PLAIN, "%s", v->status.server);
    hg_overlay_add(&text, HG_OVERLAY_PLAIN, "%ux%u %s, %s", v->picture.pixels.width,
        v->picture.pixels.height, f->mode == HGP_render_mode_PATH ? "path" : "real time",
        f->settled ? "settled" : "refining");
    hg_overlay_add(
        &text, HG_OVERLAY_PLAIN, "%5.1f frames/s  %8.1f kB/s", m->fps, m->bytes_per_s * 1e-3);
    hg_overlay_add(&text, HG_OVERLAY_PLAIN, "input to picture %6.1f ms%s", m->latency_ms,
        hg_viewer_is_reprojected(v) ? ", reprojected" : "");
    hg_overlay_add(
        &text, HG_OVERLAY_PLAIN, "round trip       %6.2f ms", (double)v->status.rtt_ns * 1e-6);
    hg_overlay_add(
        &text, HG_OVERLAY_PLAIN, "decode           %6.2f ms", (double)f->decode_ns * 1e-6);
    hg_overlay_add(&text, HG_OVERLAY_PLAIN, "%s %u bytes%s", encoding_name(f->encoding), f->bytes,
        f->lossless ? ", lossless" : "");
    hg_overlay_add(&text, HG_OVERLAY_PLAIN, "samples %u  revision %llu", f->samples,
        (unsigned long long)f->revision);
    if (f->noise >= 0)
        hg_overlay_add(&text, HG_OVERLAY_PLAIN, "noise %.4f", (double)f->noise);
    if (f->missing_pages || f->missing_clusters)
        hg_overlay_add(&text, HG_OVERLAY_BAD, "missing: %u pages, %u clusters", f->missing_pages,
            f->missing_clusters);
    hg_overlay_add(&text, HG_OVERLAY_PLAIN, "frames dropped %llu  reconnects %u",
        (unsigned long long)v->status.dropped, v->status.reconnects);
    add_flow(&text, &v->status.flow);
    add_stages(&text, f);
    hg_overlay_draw(&v->overlay, &text, HG_OVERLAY_TOP_LEFT, v->width, v->height);
}

// ---- state -------------------------------------------------------------------------------------

static void draw_state(struct hg_viewer *v)
{
    struct hg_overlay_text text = {0};
    const struct hg_view_status *s = &v->status;
    const int columns = v->overlay.advance ? (v->width - 60) / v->overlay.advance : 80;
    if (s->state == HG_VIEW_OPEN)
        return;
    if (s->state == HG_VIEW_FAILED) {
        hg_overlay_wrap(&text, HG_OVERLAY_BAD, s->text, columns);
        hg_overlay_add(&text, HG_OVERLAY_DIM, "F5 tries again, Esc ends");
    } else if (s->share >= 0) {
        hg_overlay_add(&text, HG_OVERLAY_PLAIN, "%s %.0f %%", s->text, s->share * 100);
    } else {
        hg_overlay_add(&text, HG_OVERLAY_PLAIN, "%s ...", s->text);
    }
    hg_overlay_draw(&v->overlay, &text, HG_OVERLAY_MIDDLE, v->width, v->height);
}

static void draw_message(struct hg_viewer *v)
{
    struct hg_overlay_text text = {0};
    const int columns = v->overlay.advance ? (v->width - 60) / v->overlay.advance : 80;
    if (hg_clock_now_ns() >= v->times.message_until_ns || !v->status.message[0])
        return;
    hg_overlay_wrap(&text, HG_OVERLAY_PLAIN, v->status.message, columns);
    hg_overlay_draw(&v->overlay, &text, HG_OVERLAY_BOTTOM, v->width, v->height);
}

void hg_viewer_draw_text(struct hg_viewer *v)
{
    if (v->help)
        draw_help(v);
    else if (v->statistics)
        draw_statistics(v);
    draw_state(v);
    draw_message(v);
}

// What is selected, cut and measured: " - Seat - cut x - 1.250 m".
static void add_inspected(const struct hg_viewer *v, char *text, size_t size)
{
    char length[32], axes[16];
    const char *name = hg_viewer_selected_name(v);
    hg_clipping_text(&v->panels.clipping, axes, sizeof axes);
    hg_measure_text(hg_measure_distance(&v->panels.measure), length, sizeof length);
    const char *measured = v->panels.measure.count == 2 ? length : "measuring";
    snprintf(text, size, "%s%.80s%s%s%s%s", name ? " - " : "", name ? name : "",
        axes[0] ? " - cut " : "", axes, v->panels.measures ? " - " : "",
        v->panels.measures ? measured : "");
}

// "chair.glb - path 128 samples, done - orbit - Heliograph"
void hg_viewer_title(const struct hg_viewer *v, char *title, size_t size)
{
    char progress[64] = "", inspected[160] = "";
    const struct hg_view_facts *f = &v->picture.facts;
    const bool open = v->status.state == HG_VIEW_OPEN;
    const char *state = v->status.state == HG_VIEW_FAILED ? "failed"
                        : !open                           ? v->status.text
                        : v->choice.path                  ? "path"
                                                          : "real time";
    if (open && v->choice.path && v->canvas.texture)
        snprintf(
            progress, sizeof progress, " %u samples%s", f->samples, f->settled ? ", done" : "");
    else if (open && v->canvas.texture)
        snprintf(progress, sizeof progress, "%s", f->settled ? ", settled" : "");
    if (open)
        add_inspected(v, inspected, sizeof inspected);
    snprintf(title, size, "%s - %s%s - %s%s%s - Heliograph",
        v->status.title[0] ? v->status.title : "helio view", state, progress,
        style_name(v->navigate.style), v->clock.plays ? ", playing" : "", inspected);
}
