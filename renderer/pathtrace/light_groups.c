// light_groups.c - which lights belong together, and which draws catch shadows.
//
// A punctual light belongs to the group of its name, or of its node's when it has none; what shines
// of a mesh to that of its node's name; a number at the end does not count ("Lamp.003", "Lamp 3").
// Group 0 is the environment, and all that finds no room belongs to the last group, "other". Groups
// are called as parts of EXR files may be: 20 bytes, no dots, no control characters.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/pathtrace/path_state.h"
#include "renderer/light/lights.h"

void hg_light_groups_destroy(struct hg_path *p)
{
    hg_gpu_buffer_destroy(p->context->gpu, &p->draw_marks);
    hg_gpu_buffer_destroy(p->context->gpu, &p->light_groups);
    p->group_count = 0;
}

uint32_t hg_path_group_count(const struct hg_view_state *view)
{
    return view->path != NULL ? view->path->group_count : 0;
}

const char *hg_path_group_name(const struct hg_view_state *view, uint32_t group)
{
    return group < hg_path_group_count(view) ? view->path->groups[group] : "";
}

// --- names ---------------------------------------------------------------------------------------

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

// The name without the number behind it and what sets that apart.
static size_t stem(const char *name)
{
    size_t length = strlen(name), end = length;
    while (end > 0 && is_digit(name[end - 1]))
        end--;
    if (end < length && end > 0 && strchr("._- ", name[end - 1]) != NULL)
        end--;
    return end > 0 ? end : length;
}

// Groups in the making: what they are called in the scene, which keeps it.
struct naming {
    struct hg_path *path;
    const char *from[HG_PATH_MOST_GROUPS];
    size_t length[HG_PATH_MOST_GROUPS];
};

// The first `most` bytes or fewer, whole characters of UTF-8.
static size_t cut(const char *text, size_t length, size_t most)
{
    size_t end = length < most ? length : most;
    while (end > 0 && end < length && ((unsigned char)text[end] & 0xc0u) == 0x80u)
        end--;
    return end;
}

static bool is_taken(const struct hg_path *p, const char *name)
{
    for (uint32_t i = 0; i < p->group_count; i++) {
        if (strcmp(p->groups[i], name) == 0)
            return true;
    }
    return false;
}

static void call(struct hg_path *p, const char *from, size_t length)
{
    char *name = p->groups[p->group_count];
    char written[HG_PATH_GROUP_NAME], end[8] = "";
    for (unsigned n = 2;; n++) {
        const size_t kept = cut(from, length, sizeof written - 1 - strlen(end));
        snprintf(written, sizeof written, "%.*s%s", (int)kept, from, end);
        for (char *c = written; *c != '\0'; c++) // dots would be layers of layers
            *c = *c == '.' || (unsigned char)*c < 0x20 || *c == 0x7f ? '_' : *c;
        if (!is_taken(p, written))
            break;
        snprintf(end, sizeof end, "~%u", n % 100);
    }
    memcpy(name, written, sizeof written);
}

// Number of the group of that name, made on first use.
static uint32_t group_of(struct naming *n, const char *name, const char *otherwise)
{
    struct hg_path *p = n->path;
    const char *from = name[0] != '\0' ? name : otherwise;
    size_t length = stem(from);
    for (uint32_t i = 0; i < p->group_count; i++) {
        if (n->length[i] == length && memcmp(n->from[i], from, length) == 0)
            return i;
    }
    if (p->group_count == HG_PATH_MOST_GROUPS)
        return HG_PATH_MOST_GROUPS - 1;
    if (p->group_count == HG_PATH_MOST_GROUPS - 1) {
        from = "other";
        length = strlen(from);
    }
    call(p, from, length);
    n->from[p->group_count] = from;
    n->length[p->group_count] = length;
    return p->group_count++;
}

// --- tables --------------------------------------------------------------------------------------

static enum hg_status reserve(
    struct hg_path *p, struct hg_gpu_buffer *buffer, uint64_t words, struct hg_error *err)
{
    return hg_gpu_buffer_reserve(
        p->context->gpu, HG_GPU_BUFFER_UPLOAD, (words + 1) * 4, "groups of lights", buffer, err);
}

static enum hg_status name_lights(
    struct hg_view_state *view, struct naming *n, struct hg_error *err)
{
    struct hg_path *p = n->path;
    struct hg_light_set set = {0};
    double origin[3];
    hg_geometry_origin(view->scene_gpu->geometry, origin);
    enum hg_status status = hg_light_set_collect(&set, view->scene_gpu->scene, origin);
    if (status != HG_OK)
        hg_error_set(err, status, "groups of lights", NULL, "no memory");
    else
        status = reserve(p, &p->light_groups, set.count, err);
    uint32_t *groups = status == HG_OK ? p->light_groups.mapped : NULL;
    for (uint32_t i = 0; i < set.count && groups != NULL; i++) {
        const struct hg_node *node = set.nodes[i];
        const char *name = node->light->head.name;
        groups[i] = group_of(n, name[0] != '\0' ? name : node->head.name, "light");
    }
    hg_light_set_finish(&set);
    return status;
}

static bool shines(const struct hg_material *m)
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

static enum hg_status reserve_marks(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct hg_geometry_stats stats;
    hg_geometry_stats(view->scene_gpu->geometry, &stats);
    const enum hg_status status = reserve(p, &p->draw_marks, stats.draws, err);
    if (status == HG_OK)
        memset(p->draw_marks.mapped, 0, (size_t)stats.draws * 4);
    return status;
}

static enum hg_status mark_draws(struct hg_view_state *view, struct naming *n, struct hg_error *err)
{
    struct hg_path *p = n->path;
    struct hg_geometry_stats stats;
    struct hg_draw_info info;
    hg_geometry_stats(view->scene_gpu->geometry, &stats);
    const enum hg_status status = reserve_marks(view, err);
    uint32_t *marks = status == HG_OK ? p->draw_marks.mapped : NULL;
    for (uint32_t i = 0; i < stats.draws && marks != NULL; i++) {
        if (!hg_geometry_draw_info(view->scene_gpu->geometry, i, &info))
            continue;
        if (p->group_count > 0 && shines(info.material))
            marks[i] = group_of(n, info.node->head.name, "emission");
        if (catches(info.node)) {
            marks[i] |= HG_PATH_MARK_CATCHER;
            p->options |= HG_PATH_CATCHER;
        }
    }
    return status;
}

void hg_light_groups_mark_placed(struct hg_view_state *view)
{
    struct hg_path *p = view->path;
    struct hg_geometry_stats stats;
    hg_geometry_stats(view->scene_gpu->geometry, &stats);
    p->options &= ~HG_PATH_PLACED;
    if (p->draw_marks.mapped != NULL &&
        hg_trace_mark_placed(p->trace, p->draw_marks.mapped, stats.draws, HG_PATH_MARK_PLACED))
        p->options |= HG_PATH_PLACED;
}

enum hg_status hg_light_groups_make(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    const uint32_t planes = view->settings.path.planes;
    const uint32_t split = 7u << HG_PATH_PLANE_DIRECT | 7u << HG_PATH_PLANE_INDIRECT;
    struct naming n = {.path = p};
    enum hg_status status = HG_OK;
    p->group_count = 0;
    p->options &=
        ~(HG_PATH_SPLIT | HG_PATH_GROUPS | HG_PATH_CATCHER | HG_PATH_SURFACES | HG_PATH_FOLLOWS);
    if (view->settings.mode != HG_VIEW_MODE_PATH) { // where nothing catches shadows
        p->options |= HG_PATH_SURFACES;
        return reserve_marks(view, err);
    }
    if ((planes & split) != 0 || view->settings.path.denoise != 0)
        p->options |= HG_PATH_SPLIT;
    if (view->settings.path.denoise != 0)
        p->options |= HG_PATH_FOLLOWS;
    if ((planes >> HG_PATH_PLANE_GROUPS & 1u) != 0) {
        p->options |= HG_PATH_GROUPS;
        (void)group_of(&n, "environment", "");
        status = name_lights(view, &n, err);
    }
    return status == HG_OK ? mark_draws(view, &n, err) : status;
}
