// light_groups.c - assigns lights and emissive draws to light groups, and marks shadow catchers.
//
// A punctual light's group is its name, or that of its node when it has none; an emissive mesh's
// group is the name of its node. A trailing number is ignored ("Lamp.003", "Lamp 3"). Group 0 is
// the environment; lights beyond the limit are in the last group, "other". Group names are valid
// names of EXR parts: at most 20 bytes, no dots, no control characters.
#include "renderer/pathtrace/light_groups.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/light/lights.h"

void hg_light_groups_destroy(struct hg_light_groups *g, struct hg_gpu *gpu)
{
    hg_gpu_buffer_destroy(gpu, &g->draw_marks);
    hg_gpu_buffer_destroy(gpu, &g->of_lights);
    g->count = 0;
}

// --- names ---------------------------------------------------------------------------------------

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

// The name without a trailing number and its separator.
static size_t stem(const char *name)
{
    size_t length = strlen(name), end = length;
    while (end > 0 && is_digit(name[end - 1]))
        end--;
    if (end < length && end > 0 && strchr("._- ", name[end - 1]) != NULL)
        end--;
    return end > 0 ? end : length;
}

// Groups while they are collected; names are borrowed from the scene.
struct naming {
    struct hg_light_groups *groups;
    struct hg_gpu *gpu;
    const struct hg_scene_gpu *scene_gpu;
    const char *from[HG_PATH_MOST_GROUPS];
    size_t length[HG_PATH_MOST_GROUPS];
};

// At most the first `most` bytes, cut at a UTF-8 character.
static size_t shorten(const char *text, size_t length, size_t most)
{
    size_t end = length < most ? length : most;
    while (end > 0 && end < length && ((unsigned char)text[end] & 0xc0u) == 0x80u)
        end--;
    return end;
}

static bool is_taken(const struct hg_light_groups *g, const char *name)
{
    for (uint32_t i = 0; i < g->count; i++) {
        if (strcmp(g->names[i], name) == 0)
            return true;
    }
    return false;
}

static void call(struct hg_light_groups *g, const char *from, size_t length)
{
    char *name = g->names[g->count];
    char written[HG_PATH_GROUP_NAME], end[8] = "";
    for (unsigned n = 2;; n++) {
        const size_t kept = shorten(from, length, sizeof written - 1 - strlen(end));
        snprintf(written, sizeof written, "%.*s%s", (int)kept, from, end);
        for (char *c = written; *c != '\0'; c++) // dots would be layers of layers
            *c = *c == '.' || (unsigned char)*c < 0x20 || *c == 0x7f ? '_' : *c;
        if (!is_taken(g, written))
            break;
        snprintf(end, sizeof end, "~%u", n % 100);
    }
    memcpy(name, written, sizeof written);
}

// Number of the group of that name, made on first use.
static uint32_t group_of(struct naming *n, const char *name, const char *otherwise)
{
    struct hg_light_groups *g = n->groups;
    const char *from = name[0] != '\0' ? name : otherwise;
    size_t length = stem(from);
    for (uint32_t i = 0; i < g->count; i++) {
        if (n->length[i] == length && memcmp(n->from[i], from, length) == 0)
            return i;
    }
    if (g->count == HG_PATH_MOST_GROUPS)
        return HG_PATH_MOST_GROUPS - 1;
    if (g->count == HG_PATH_MOST_GROUPS - 1) {
        from = "other";
        length = strlen(from);
    }
    call(g, from, length);
    n->from[g->count] = from;
    n->length[g->count] = length;
    return g->count++;
}

// --- tables --------------------------------------------------------------------------------------

static enum hg_status reserve(struct naming *n, struct hg_gpu_buffer *buffer, const char *name,
    uint64_t words, struct hg_error *err)
{
    return hg_gpu_buffer_reserve(n->gpu, HG_GPU_BUFFER_UPLOAD, (words + 1) * 4, name, buffer, err);
}

static enum hg_status name_lights(struct naming *n, struct hg_error *err)
{
    const struct hg_scene_gpu *scene_gpu = n->scene_gpu;
    struct hg_light_set set = {0};
    double origin[3];
    hg_geometry_origin(scene_gpu->geometry, origin);
    enum hg_status status = hg_light_set_collect(&set, scene_gpu->scene, origin);
    if (status != HG_OK)
        hg_error_set(err, status, "groups of lights", NULL, "no memory");
    else
        status = reserve(n, &n->groups->of_lights, "groups of lights", set.count, err);
    uint32_t *groups = status == HG_OK ? n->groups->of_lights.mapped : NULL;
    if (groups != NULL)
        groups[set.count] = 0; // the sun of a sky goes with the environment
    for (uint32_t i = 0; i < set.count && groups != NULL; i++) {
        const struct hg_node *node = set.nodes[i];
        const char *name = node->light->head.name;
        groups[i] = group_of(n, name[0] != '\0' ? name : node->head.name, "light");
    }
    hg_light_set_finish(&set);
    return status;
}

static bool emits(const struct hg_material *m)
{
    return m != NULL &&
           (m->unlit || m->emissive[0] > 0.0f || m->emissive[1] > 0.0f || m->emissive[2] > 0.0f);
}

static bool catches(const struct hg_node *node)
{
    while (node != NULL && !node->catches_shadows)
        node = node->parent;
    return node != NULL;
}

static uint32_t draws_of(const struct naming *n)
{
    struct hg_geometry_stats stats;
    hg_geometry_stats(n->scene_gpu->geometry, &stats);
    return (uint32_t)stats.draws;
}

static enum hg_status reserve_marks(struct naming *n, struct hg_error *err)
{
    const uint32_t draws = draws_of(n);
    const enum hg_status status = reserve(n, &n->groups->draw_marks, "marks of draws", draws, err);
    if (status == HG_OK)
        memset(n->groups->draw_marks.mapped, 0, (size_t)draws * 4);
    return status;
}

static enum hg_status mark_draws(struct naming *n, uint32_t *options, struct hg_error *err)
{
    struct hg_light_groups *g = n->groups;
    struct hg_draw_info info;
    const uint32_t draws = draws_of(n);
    const enum hg_status status = reserve_marks(n, err);
    uint32_t *marks = status == HG_OK ? g->draw_marks.mapped : NULL;
    for (uint32_t i = 0; i < draws && marks != NULL; i++) {
        if (!hg_geometry_draw_info(n->scene_gpu->geometry, i, &info))
            continue;
        if (g->count > 0 && emits(info.material))
            marks[i] = group_of(n, info.node->head.name, "emission");
        if (catches(info.node)) {
            marks[i] |= HG_PATH_MARK_CATCHER;
            *options |= HG_PATH_CATCHER;
        }
    }
    return status;
}

void hg_light_groups_mark_placed(
    struct hg_light_groups *g, const struct hg_trace *trace, uint32_t draws, uint32_t *options)
{
    *options &= ~HG_PATH_PLACED;
    if (g->draw_marks.mapped != NULL &&
        hg_trace_mark_placed(trace, g->draw_marks.mapped, draws, HG_PATH_MARK_PLACED))
        *options |= HG_PATH_PLACED;
}

enum hg_status hg_light_groups_make(struct hg_light_groups *g, struct hg_gpu *gpu,
    const struct hg_scene_gpu *scene_gpu, const struct hg_path_request *request, uint32_t *options,
    struct hg_error *err)
{
    const struct hg_path_settings *s = &request->settings;
    const uint32_t split = 7u << HG_PATH_PLANE_DIRECT | 7u << HG_PATH_PLANE_INDIRECT;
    struct naming n = {.groups = g, .gpu = gpu, .scene_gpu = scene_gpu};
    enum hg_status status = HG_OK;
    g->count = 0;
    *options &= ~(HG_PATH_SPLIT | HG_PATH_GROUPS | HG_PATH_CATCHER | HG_PATH_SURFACES |
                  HG_PATH_FOLLOWS | HG_PATH_GATHERS | HG_PATH_GLASS | HG_PATH_LAMPS);
    if (request->surfaces) { // there are no shadow catchers
        *options |= HG_PATH_SURFACES;
        return reserve_marks(&n, err);
    }
    if (request->gather.on) {
        *options |= HG_PATH_GATHERS | HG_PATH_SPLIT;
        *options |= request->gather.glass ? HG_PATH_GLASS : 0;
        *options |= request->gather.lamps > 0 ? HG_PATH_LAMPS : 0;
        return reserve_marks(&n, err);
    }
    if (request->ground)
        *options |= HG_PATH_CATCHER;
    if ((s->planes & split) != 0 || s->denoise != 0)
        *options |= HG_PATH_SPLIT;
    if (s->denoise != 0)
        *options |= HG_PATH_FOLLOWS;
    if ((s->planes >> HG_PATH_PLANE_GROUPS & 1u) != 0) {
        *options |= HG_PATH_GROUPS;
        (void)group_of(&n, "environment", "");
        status = name_lights(&n, err);
    }
    return status == HG_OK ? mark_draws(&n, options, err) : status;
}
