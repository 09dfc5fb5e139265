// stats.c - what a renderer and a view have used, as JSON (keys: docs/client.md, --stats).
#include <malloc.h>
#include <stdio.h>
#include <string.h>

#include "base/json.h"
#include "base/spill.h"
#include "renderer/frame/exposure/meter.h"
#include "renderer/frame/light/gi_view.h"
#include "renderer/frame/look/look.h"
#include "renderer/frame/quality/governor.h"
#include "renderer/frame/view_bytes.h"
#include "renderer/internal.h"
#include "renderer/pathtrace/path.h"

// Of /proc/self/status; 0 where it is not there.
static uint64_t status_bytes(const char *wanted)
{
    char line[256], name[32];
    unsigned long long kib = 0, here;
    FILE *file = fopen("/proc/self/status", "re");
    if (file == NULL)
        return 0;
    while (kib == 0 && fgets(line, sizeof line, file) != NULL)
        if (sscanf(line, "%31[^:]: %llu", name, &here) == 2 && strcmp(name, wanted) == 0)
            kib = here;
    fclose(file);
    return (uint64_t)kib * 1024;
}

// What the process has allocated and not freed, in every arena of the C library. Resident memory is
// more: freed pages that the allocator keeps are in it.
static uint64_t heap_bytes(void)
{
    const struct mallinfo2 heap = mallinfo2();
    return (uint64_t)heap.uordblks + heap.hblkhd;
}

uint64_t hg_renderer_peak_rss_bytes(void)
{
    return status_bytes("VmHWM");
}

static void put_device(struct hg_writer *w, const struct hg_renderer *renderer)
{
    const struct hg_gpu_caps *caps = hg_gpu_get_caps(renderer->gpu);
    struct hg_gpu_memory_stats memory;
    hg_gpu_memory_stats(renderer->gpu, &memory);
    hg_json_put(w, "\"device\":{\"name\":");
    hg_json_string(w, caps->device_name);
    hg_json_put(w, ",\"driver\":");
    hg_json_string(w, caps->driver);
    hg_json_put(w,
        ",\"used_bytes\":%llu,\"reserved_bytes\":%llu,\"peak_bytes\":%llu,\"pipelines\":%u}",
        (unsigned long long)memory.used_bytes, (unsigned long long)memory.reserved_bytes,
        (unsigned long long)memory.peak_bytes, hg_gpu_pipeline_count(renderer->gpu));
    struct hg_spill_stats spill;
    hg_spill_stats(&spill);
    hg_json_put(w,
        ",\"process\":{\"rss_bytes\":%llu,\"peak_rss_bytes\":%llu,\"heap_bytes\":%llu,"
        "\"spilled_bytes\":%llu,\"spilled_peak_bytes\":%llu,\"spill_refused_bytes\":%llu}",
        (unsigned long long)status_bytes("VmRSS"), (unsigned long long)hg_renderer_peak_rss_bytes(),
        (unsigned long long)heap_bytes(), (unsigned long long)spill.bytes,
        (unsigned long long)spill.peak_bytes, (unsigned long long)spill.refused_bytes);
}

static void put_store(struct hg_writer *w, const struct hg_renderer *renderer)
{
    struct hg_store_stats s = {0};
    if (renderer->store != NULL)
        hg_store_stats(renderer->store, &s);
    hg_json_put(w,
        ",\"cache\":{\"limit_bytes\":%llu,\"bytes\":%llu,\"found\":%llu,\"absent\":%llu,"
        "\"written\":%llu,\"damaged\":%llu,\"evicted\":%llu,\"read_bytes\":%llu,"
        "\"written_bytes\":%llu}",
        (unsigned long long)s.limit_bytes, (unsigned long long)s.bytes, (unsigned long long)s.found,
        (unsigned long long)s.absent, (unsigned long long)s.written, (unsigned long long)s.damaged,
        (unsigned long long)s.evicted, (unsigned long long)s.bytes_read,
        (unsigned long long)s.bytes_written);
}

static double ms(uint64_t ns)
{
    return (double)ns * 1e-6;
}

// All scenes of the renderer share the pages.
static void put_textures(
    struct hg_writer *w, const struct hg_renderer *renderer, const struct hg_view_state *view)
{
    struct hg_page_cache *cache = renderer->context.pages;
    struct hg_page_cache_stats c = {.budget_bytes = renderer->context.texture_budget_bytes};
    struct hg_page_sources_stats s = {0};
    struct hg_textures_stats t = {0};
    if (cache != NULL) {
        hg_page_cache_stats(cache, &c);
        hg_page_sources_stats(hg_page_cache_sources(cache), &s);
    }
    if (view != NULL)
        hg_textures_stats(view->scene_gpu->textures, &t);
    hg_json_put(w,
        ",\"texture\":{\"budget_bytes\":%llu,\"peak_bytes\":%llu,\"resident_bytes\":%llu,"
        "\"table_bytes\":%llu,\"missing\":%u,\"pages\":%u,\"slots\":%u,\"sets\":%u,"
        "\"failed\":%u,\"mip_bias\":%.3f,\"teleport_to_sharp_ms\":%.3f,",
        (unsigned long long)c.budget_bytes, (unsigned long long)c.peak_bytes,
        (unsigned long long)c.pool_bytes, (unsigned long long)c.table_bytes, c.missing, c.resident,
        c.slots, c.sets, view != NULL ? t.failed : c.failed, (double)c.bias, ms(c.sharp_ns));
    hg_json_put(w,
        "\"requested\":%llu,\"loaded\":%llu,\"evicted\":%llu,\"read_bytes\":%llu,"
        "\"decode_ms\":%.3f,\"upload_ms\":%.3f,\"uploaded_bytes\":%llu,\"host_bytes\":%llu,"
        "\"host_peak_bytes\":%llu}",
        (unsigned long long)c.requested, (unsigned long long)c.pages_loaded,
        (unsigned long long)c.evicted, (unsigned long long)s.bytes_read, ms(c.read_ns),
        ms(c.upload_ns), (unsigned long long)c.bytes_uploaded, (unsigned long long)s.memory_bytes,
        (unsigned long long)s.memory_peak_bytes);
    hg_json_put(w,
        ",\"bake\":{\"loading\":%u,\"running\":%u,\"texels_done\":%llu,\"texels_total\":%llu,"
        "\"packs_baked\":%llu,\"packs_found\":%llu,\"pack_bytes\":%llu,\"ms\":%.3f}",
        s.loading, s.baking, (unsigned long long)s.bake_texels_done,
        (unsigned long long)s.bake_texels_total, (unsigned long long)s.packs_baked,
        (unsigned long long)s.packs_found, (unsigned long long)s.pack_bytes, ms(s.bake_ns));
}

static void put_frame(struct hg_writer *w, const struct hg_view_state *s)
{
    hg_json_put(w,
        ",\"frame\":{\"render_ms\":%.3f,\"samples\":%u,\"number\":%llu,\"width\":%u,"
        "\"height\":%u,\"settled\":%s}",
        (double)s->stats.step_ns * 1e-6, s->accumulation.samples,
        (unsigned long long)s->stats.number, s->settings.width, s->settings.height,
        hg_view_state_settled(s) ? "true" : "false");
}

static void put_exposure(struct hg_writer *w, const struct hg_view_state *s)
{
    const bool automatic = s->exposure.automatic;
    hg_json_put(w, ",\"exposure\":{\"ev\":%.9g,\"mode\":\"%s\",\"metered\":%s}",
        (double)hg_meter_ev(s), automatic ? "auto" : "fixed",
        automatic && !hg_meter_is_due(s) && !hg_meter_is_adapting(s) ? "true" : "false");
}

static void put_environment(struct hg_writer *w, const struct hg_view_state *s)
{
    static const char *const kinds[] = {"none", "color", "file", "sky"};
    const struct hg_environment *e = &s->scene_gpu->scene->environment;
    hg_json_put(w,
        ",\"environment\":{\"kind\":\"%s\",\"automatic\":%s,\"fill\":%s,\"intensity\":%.9g}",
        kinds[e->kind], e->automatic ? "true" : "false", e->fills ? "true" : "false",
        (double)e->intensity);
}

static void put_geometry(struct hg_writer *w, const struct hg_view_state *s)
{
    struct hg_geometry_stats g;
    hg_geometry_stats(s->scene_gpu->geometry, &g);
    hg_json_put(w,
        ",\"geometry\":{\"budget_bytes\":%llu,\"peak_bytes\":%llu,\"resident_bytes\":%llu,"
        "\"triangles_total\":%llu,\"triangles_drawn\":%llu,\"missing\":%u,\"draws\":%u,"
        "\"draws_drawn\":%llu,\"instances\":%u,\"parts\":%u,\"error_px\":%.3f,\"baking\":%u,",
        (unsigned long long)g.budget_bytes, (unsigned long long)g.peak_bytes,
        (unsigned long long)g.used_bytes, (unsigned long long)g.triangles_total,
        (unsigned long long)s->stats.triangles_drawn, s->stats.missing_clusters, g.draws,
        (unsigned long long)s->stats.draws_drawn, g.instances, g.parts,
        (double)hg_tiled_accumulation_error_px(&s->accumulation, s->settings.error_px), g.baking);
    const struct hg_cluster_pool_stats *c = &g.chunks;
    hg_json_put(w,
        "\"chunks\":%llu,\"chunk_bytes\":%llu,\"chunk_peak_bytes\":%llu,\"queued\":%llu,"
        "\"evicted\":%llu,\"read_bytes\":%llu,\"decode_ms\":%.3f,\"upload_ms\":%.3f}",
        (unsigned long long)c->resident, (unsigned long long)c->used_bytes,
        (unsigned long long)c->peak_bytes, (unsigned long long)c->requested,
        (unsigned long long)c->evicted, (unsigned long long)c->read_bytes, ms(c->decode_ns),
        ms(c->upload_ns));
}

static void put_light(struct hg_writer *w, const struct hg_view_state *s)
{
    struct hg_lighting_stats l;
    hg_lighting_stats(s->lighting, &l);
    hg_json_put(w,
        ",\"light\":{\"lights\":%u,\"shadowed\":%u,\"unshadowed\":%u,\"shadow_maps\":%u,"
        "\"shadow_maps_drawn\":%u,\"shadow_maps_unseen\":%u,\"clusters\":%u,"
        "\"atlas_bytes\":%llu,",
        l.lights, l.shadowed_lights, l.unshadowed_lights, l.shadow_maps, s->stats.stale_shadows,
        l.shadow_maps_unseen, l.clusters, (unsigned long long)l.atlas_bytes);
    const struct hg_shadow_page_stats *p = &l.pages;
    hg_json_put(w,
        "\"shadow_pages\":{\"room\":%u,\"held\":%u,\"asked\":%u,\"hits\":%u,\"drawn\":%u,"
        "\"evicted\":%u}}",
        p->room, p->held, p->asked, p->hits, p->drawn, p->evicted);
}

static void put_gathered(struct hg_writer *w, const char *name, const struct hg_path_stats *of,
    const struct hg_gpu_image *image)
{
    const struct hg_path_time *p = of->pieces;
    hg_json_put(w,
        "\"%s\":{\"paths\":%llu,\"rays\":%llu,\"shadow_rays\":%llu,\"misses\":%llu,"
        "\"shaded\":%llu,\"bytes\":%llu},",
        name, (unsigned long long)of->paths, (unsigned long long)p[HG_PATH_PIECE_TRACE].items,
        (unsigned long long)p[HG_PATH_PIECE_SHADOW].items,
        (unsigned long long)p[HG_PATH_PIECE_MISS].items,
        (unsigned long long)p[HG_PATH_PIECE_SHADE].items,
        (unsigned long long)image->memory.size_bytes);
}

static void put_gi(struct hg_writer *w, const struct hg_view_state *s)
{
    struct hg_gi_stats g;
    if (s->settings.gi == 0 || s->scene_gpu->gi == NULL)
        return;
    hg_gi_stats(s->scene_gpu->gi, &g);
    hg_json_put(w, ",\"gi\":{\"probes\":%u,\"asleep\":%u,\"inside\":%u,\"moved\":%u,\"grids\":[",
        g.probes, g.asleep, g.inside, g.moved);
    for (uint32_t i = 0; i < g.grid_count; i++)
        hg_json_put(w, "%s{\"spacing_m\":%.6g,\"probes\":%u,\"asleep\":%u}", i > 0 ? "," : "",
            (double)g.grids[i].spacing, g.grids[i].probes, g.grids[i].asleep);
    hg_json_put(w,
        "],\"updates\":%llu,\"rays\":%llu,"
        "\"shadow_rays\":%llu,\"misses\":%llu,\"shaded\":%llu,\"ms\":%.3f,\"bytes\":%llu,",
        (unsigned long long)g.updates, (unsigned long long)g.rays,
        (unsigned long long)g.shadow_rays, (unsigned long long)g.misses,
        (unsigned long long)g.shaded, ms(g.ns), (unsigned long long)g.bytes);
    put_gathered(w, "gathered", &s->gi.gather.stats[0], &s->gi.gather.light);
    put_gathered(w, "glass", &s->gi.gather.stats[1], &s->gi.gather.glass);
    hg_json_put(w, "\"structure_bytes\":%llu,\"shadow_atlas_bytes\":%llu}",
        (unsigned long long)g.structure_bytes,
        (unsigned long long)hg_lighting_image_shadow(s->lighting)->memory.size_bytes);
}

static void put_reflections(struct hg_writer *w, const struct hg_view_state *s)
{
    struct hg_reflect_stats r;
    struct hg_radiance_cache_stats c;
    if (s->motion.reflections.reflect == NULL)
        return;
    hg_reflect_stats(s->motion.reflections.reflect, &r);
    hg_radiance_cache_stats(s->scene_gpu->radiance, &c);
    hg_json_put(w,
        ",\"reflections\":{\"texels\":%u,\"rough\":%u,\"sky\":%u,\"cached\":%u,\"shaded\":%u,"
        "\"late\":%u,\"captured\":%u,\"lit\":%u,\"shadow_rays\":%u,\"ms\":%.3f,\"cpu_ms\":%.3f,"
        "\"bytes\":%llu,\"cache\":{\"probes\":%u,\"side\":%u,\"captured\":%llu,\"lit\":%llu,"
        "\"bytes\":%llu}}",
        r.texels, r.counts[HG_REFLECT_ROUGH], r.counts[HG_REFLECT_SKY], r.counts[HG_REFLECT_CACHED],
        r.counts[HG_REFLECT_SHADED], r.counts[HG_REFLECT_LATE], r.captured, r.lit, r.shadow_rays,
        ms(r.ns), ms(r.cpu_ns), (unsigned long long)r.bytes, c.probes, c.side,
        (unsigned long long)c.captured, (unsigned long long)c.lit, (unsigned long long)c.bytes);
}

static void put_irradiance(struct hg_writer *w, const struct hg_view_state *s)
{
    struct hg_irradiance_stats i;
    if (s->scene_gpu->irradiance == NULL)
        return;
    hg_irradiance_stats(s->scene_gpu->irradiance, &i);
    hg_json_put(w,
        ",\"irradiance\":{\"rays\":%u,\"shadow_rays\":%u,\"misses\":%u,\"cells\":%u,"
        "\"ms\":%.3f,\"cpu_ms\":%.3f,\"bytes\":%llu}",
        i.rays, i.shadow_rays, i.misses, i.cells, ms(i.ns), ms(i.cpu_ns),
        (unsigned long long)i.bytes);
}

static void put_mirrors(struct hg_writer *w, const struct hg_view_state *s)
{
    const struct hg_mirror_stats *m = &s->motion.mirrors.stats;
    if (s->motion.mirrors.texels > 0)
        hg_json_put(w, ",\"mirrors\":{\"planes\":%u,\"rays\":%u,\"ms\":%.3f,\"bytes\":%llu}",
            m->planes, m->rays, ms(m->ns), (unsigned long long)m->bytes);
}

static void put_glass(struct hg_writer *w, const struct hg_view_state *s)
{
    struct hg_glass_stats g;
    if (s->motion.glass.glass == NULL)
        return;
    hg_glass_stats(s->motion.glass.glass, &g);
    hg_json_put(w,
        ",\"glass\":{\"texels\":%u,\"rays\":%u,\"shadow_rays\":%u,\"on_screen\":%u,\"sky\":%u,"
        "\"lit\":%u,\"ms\":%.3f,\"cpu_ms\":%.3f,\"bytes\":%llu}",
        g.texels, g.rays, g.shadow_rays, g.on_screen, g.sky, g.lit, ms(g.ns), ms(g.cpu_ns),
        (unsigned long long)g.bytes);
}

static void put_trace(struct hg_writer *w, const struct hg_view_state *s)
{
    struct hg_path_stats t = {0};
    const bool paths = s->settings.mode == HG_VIEW_MODE_PATH || s->settings.path.planes != 0;
    if (s->path == NULL || !paths)
        return;
    hg_path_get_stats(s->path, &t);
    const struct hg_path_time *p = t.pieces;
    const uint64_t shadow_rays = p[HG_PATH_PIECE_SHADOW].items + p[HG_PATH_PIECE_ALPHA_MASK].items;
    const uint64_t rays = p[HG_PATH_PIECE_TRACE].items + shadow_rays;
    const uint64_t ns = p[HG_PATH_PIECE_TRACE].ns + p[HG_PATH_PIECE_SHADOW].ns;
    const uint64_t shade =
        p[HG_PATH_PIECE_BEGIN].ns + p[HG_PATH_PIECE_MISS].ns + p[HG_PATH_PIECE_SHADE].ns;
    const uint64_t film =
        p[HG_PATH_PIECE_LIGHT].ns + p[HG_PATH_PIECE_ALPHA_MASK].ns + p[HG_PATH_PIECE_FILM].ns;
    hg_json_put(w,
        ",\"trace\":{\"rays\":%llu,\"shadow_rays\":%llu,\"shaded\":%llu,\"misses\":%llu,\"paths\":%"
        "llu,\"waves\":%llu,"
        "\"mrays_per_s\":%.4f,\"trace_ms\":%.3f,\"shade_ms\":%.3f,\"film_ms\":%.3f,"
        "\"page_ms\":%.3f,\"host_ms\":%.3f,\"build_ms\":%.3f}",
        (unsigned long long)rays, (unsigned long long)shadow_rays,
        (unsigned long long)p[HG_PATH_PIECE_SHADE].items,
        (unsigned long long)p[HG_PATH_PIECE_MISS].items, (unsigned long long)t.paths,
        (unsigned long long)t.waves, ns > 0 ? (double)rays * 1e3 / (double)ns : 0.0, ms(ns),
        ms(shade), ms(film), ms(p[HG_PATH_PIECE_PAGES].ns), ms(p[HG_PATH_PIECE_LISTS].ns),
        ms(t.build_ns));
}

// What pictures in motion are drawn with.
static void put_motion(struct hg_writer *w, const struct hg_view_state *s)
{
    const struct hg_quality_choice c = hg_governor_choice(s);
    const VkExtent2D drawn = s->motion.temporal.drawn;
    const struct hg_temporal *history = s->motion.temporal.history;
    hg_json_put(w,
        ",\"motion\":{\"width\":%u,\"height\":%u,\"probe_rays\":%u,\"error_factor\":%.3f,"
        "\"checkerboard\":%s,\"target_ms\":%.2f,\"bytes\":%llu}",
        drawn.width, drawn.height, hg_gi_view_rays(s), (double)c.factor,
        c.checkerboard ? "true" : "false", (double)hg_view_target_ms(s),
        (unsigned long long)(history != NULL ? hg_temporal_bytes(history) : 0));
}

static void put_targets(struct hg_writer *w, const struct hg_view_state *s)
{
    struct hg_view_bytes b;
    hg_view_bytes_get(s, &b);
    hg_json_put(w, ",\"targets\":{\"bytes\":%llu,\"motion_bytes\":%llu}",
        (unsigned long long)(b.still + b.motion), (unsigned long long)b.motion);
}

static void put_passes(struct hg_writer *w, const struct hg_view_state *s)
{
    hg_json_put(w, ",\"passes\":[");
    for (uint32_t i = 0; i < s->stats.stage_count; i++) {
        hg_json_put(w, "%s{\"name\":\"%s\",\"ms\":%.3f}", i > 0 ? "," : "", s->stats.stages[i].name,
            (double)s->stats.stages[i].ns * 1e-6);
    }
    hg_json_put(w, "]");
}

void hg_view_get_report(const struct hg_view *view, struct hg_view_report *out)
{
    const struct hg_view_state *s = &view->state;
    const bool smaller = s->accumulation.phase == HG_VIEW_DIRECT &&
                         s->motion.temporal.drawn.width > 0 &&
                         s->motion.temporal.drawn.width < s->settings.width;
    *out = (struct hg_view_report){.prefetched = s->prefetch.drawn,
        .unlit_share = hg_unlit_tiles_share(
            &s->unlit.tiles, smaller ? &s->motion.temporal.targets.depth : &s->targets.depth),
        .field_is_settled = hg_gi_view_has_settled(s),
        .blend = {s->blend.strips, s->blend.unseen},
        .motion = s->motion.temporal.motion};
    hg_geometry_stats(s->scene_gpu->geometry, &out->geometry);
    hg_textures_stats(s->scene_gpu->textures, &out->textures);
    hg_path_get_stats(s->path, &out->path);
    out->traces = s->path != NULL;
}

struct hg_rays *hg_view_rays(const struct hg_view *view)
{
    return view->state.scene_gpu->rays;
}

void hg_view_forget_history(struct hg_view *view)
{
    hg_frame_history_forget(&view->state.history);
}

bool hg_view_has_history(const struct hg_view *view)
{
    return view->state.history.pose != NULL || view->state.history.has_camera;
}

void hg_view_print_graph(
    const struct hg_view *view, enum hg_graph_format format, struct hg_writer *out)
{
    if (view->state.targets.graph != NULL)
        hg_graph_print(view->state.targets.graph, format, out);
}

void hg_view_baking(struct hg_view *view, struct hg_baking *out)
{
    struct hg_page_cache *pages = view->renderer->context.pages;
    struct hg_page_sources_stats s = {0};
    struct hg_geometry_stats g;
    if (pages != NULL)
        hg_page_sources_stats(hg_page_cache_sources(pages), &s);
    hg_geometry_stats(view->state.scene_gpu->geometry, &g);
    *out = (struct hg_baking){s.bake_texels_done, s.bake_texels_total, g.baking};
}

uint32_t hg_view_failed_textures(struct hg_view *view)
{
    struct hg_textures_stats t;
    hg_textures_stats(view->state.scene_gpu->textures, &t);
    return t.failed;
}

void hg_view_untraced(struct hg_view *view, struct hg_untraced *out)
{
    const struct hg_look *look = view->state.settings.look;
    hg_geometry_untraced(view->state.scene_gpu->geometry,
        hg_look_draws(look) != NULL ? &look->tables : NULL, &out->lines, &out->points);
}

enum hg_status hg_renderer_stats_json(
    struct hg_renderer *renderer, struct hg_view *view, char **text)
{
    *text = NULL;
    struct hg_writer w = {0};
    hg_json_put(&w, "{");
    put_device(&w, renderer);
    put_store(&w, renderer);
    put_textures(&w, renderer, view != NULL ? &view->state : NULL);
    if (view != NULL) {
        put_frame(&w, &view->state);
        put_exposure(&w, &view->state);
        put_environment(&w, &view->state);
        put_geometry(&w, &view->state);
        put_light(&w, &view->state);
        put_gi(&w, &view->state);
        put_reflections(&w, &view->state);
        put_irradiance(&w, &view->state);
        put_mirrors(&w, &view->state);
        put_glass(&w, &view->state);
        put_trace(&w, &view->state);
        put_motion(&w, &view->state);
        put_targets(&w, &view->state);
        put_passes(&w, &view->state);
    }
    hg_json_put(&w, "}");
    return hg_json_take(&w, text);
}
