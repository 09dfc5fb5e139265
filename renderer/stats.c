// stats.c - what a renderer and a view have used, as JSON (keys: docs/client.md, --stats).
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/bytes.h"
#include "renderer/internal.h"

static void HG_PRINTF(2, 3) put(struct hg_writer *w, const char *fmt, ...)
{
    char text[1024];
    va_list args;
    va_start(args, fmt);
    const int size = vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    if (size < 0 || size >= (int)sizeof text)
        w->failed = true;
    else
        hg_write_bytes(w, text, (size_t)size);
}

static void put_string(struct hg_writer *w, const char *text)
{
    hg_write_u8(w, '"');
    for (; *text != '\0'; text++) {
        if (*text == '"' || *text == '\\')
            hg_write_u8(w, '\\');
        hg_write_u8(w, (unsigned char)*text < 0x20 ? ' ' : (uint8_t)*text);
    }
    hg_write_u8(w, '"');
}

static uint64_t peak_rss_bytes(void)
{
    char line[256];
    unsigned long long kib = 0;
    FILE *file = fopen("/proc/self/status", "re");
    if (file == NULL)
        return 0;
    while (fgets(line, sizeof line, file) != NULL && sscanf(line, "VmHWM: %llu", &kib) != 1)
        continue;
    fclose(file);
    return (uint64_t)kib * 1024;
}

static void put_device(struct hg_writer *w, const struct hg_renderer *renderer)
{
    const struct hg_gpu_caps *caps = hg_gpu_get_caps(renderer->gpu);
    struct hg_gpu_memory_stats memory;
    hg_gpu_memory_stats(renderer->gpu, &memory);
    put(w, "\"device\":{\"name\":");
    put_string(w, caps->device_name);
    put(w, ",\"driver\":");
    put_string(w, caps->driver);
    put(w, ",\"used_bytes\":%llu,\"reserved_bytes\":%llu,\"peak_bytes\":%llu,\"pipelines\":%u}",
        (unsigned long long)memory.used_bytes, (unsigned long long)memory.reserved_bytes,
        (unsigned long long)memory.peak_bytes, hg_gpu_pipeline_count(renderer->gpu));
    put(w, ",\"process\":{\"peak_rss_bytes\":%llu}", (unsigned long long)peak_rss_bytes());
}

static void put_frame(struct hg_writer *w, const struct hg_view_state *s)
{
    put(w,
        ",\"frame\":{\"render_ms\":%.3f,\"samples\":%u,\"number\":%llu,\"width\":%u,"
        "\"height\":%u,\"settled\":%s}",
        (double)s->step_ns * 1e-6, s->samples, (unsigned long long)s->number, s->settings.width,
        s->settings.height, hg_view_state_settled(s) ? "true" : "false");
}

static void put_scene(struct hg_writer *w, const struct hg_view_state *s)
{
    struct hg_textures_stats t;
    struct hg_geometry_stats g;
    hg_textures_stats(s->rooms->textures, &t);
    hg_geometry_stats(s->rooms->geometry, &g);
    put(w,
        ",\"texture\":{\"budget_bytes\":%llu,\"peak_bytes\":%llu,\"resident_bytes\":%llu,"
        "\"missing\":0,\"pages\":%u,\"sets\":%u,\"failed\":%u}",
        (unsigned long long)t.budget_bytes, (unsigned long long)t.peak_bytes,
        (unsigned long long)t.pool_bytes, t.pages, t.sets, t.failed);
    put(w,
        ",\"geometry\":{\"budget_bytes\":%llu,\"peak_bytes\":%llu,\"resident_bytes\":%llu,"
        "\"triangles_total\":%llu,\"triangles_drawn\":%llu,\"missing\":0,\"draws\":%u,"
        "\"draws_drawn\":%llu,\"instances\":%u,\"parts\":%u}",
        (unsigned long long)g.budget_bytes, (unsigned long long)g.peak_bytes,
        (unsigned long long)g.used_bytes, (unsigned long long)g.triangles_total,
        (unsigned long long)s->triangles_drawn, g.draws, (unsigned long long)s->draws_drawn,
        g.instances, g.parts);
}

static void put_light(struct hg_writer *w, const struct hg_view_state *s)
{
    struct hg_lighting_stats l;
    hg_lighting_stats(s->lighting, &l);
    put(w,
        ",\"light\":{\"lights\":%u,\"shadowed\":%u,\"unshadowed\":%u,\"shadow_maps\":%u,"
        "\"shadow_maps_drawn\":%u,\"clusters\":%u}",
        l.lights, l.shadowed_lights, l.unshadowed_lights, l.shadow_maps, s->stale_shadows,
        l.clusters);
}

static void put_passes(struct hg_writer *w, const struct hg_view_state *s)
{
    put(w, ",\"passes\":[");
    for (uint32_t i = 0; i < s->stage_count; i++) {
        put(w, "%s{\"name\":\"%s\",\"ms\":%.3f}", i > 0 ? "," : "", s->stages[i].name,
            (double)s->stages[i].ns * 1e-6);
    }
    put(w, "]");
}

enum hg_status hg_renderer_stats_json(
    struct hg_renderer *renderer, struct hg_view *view, char **text)
{
    *text = NULL;
    struct hg_writer w = {0};
    put(&w, "{");
    put_device(&w, renderer);
    if (view != NULL) {
        put_frame(&w, &view->state);
        put_scene(&w, &view->state);
        put_light(&w, &view->state);
        put_passes(&w, &view->state);
    }
    hg_write_bytes(&w, "}", 2); // with the terminator
    if (w.failed) {
        hg_writer_finish(&w);
        return HG_E_NOMEM;
    }
    *text = (char *)w.data;
    return HG_OK;
}
