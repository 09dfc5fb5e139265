#include "renderer/light/light_cut.h"

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/light/emitters/emitter_lights.h"
#include "renderer/math/vec.h"

#define PI             ((float)HG_PI)
#define CONE_SLACK_RAD 1e-3f
#define FAR_CELL_MOST  8 // entries of cells without surfaces

// What the lamps below a node are together.
struct hg_light_sum {
    float center[3], spread_sq; // mean place by power, and the mean square of the distance from it
    float power[3], weight;     // radiant power times its solid angle; its luminance
    float axis[3], cone_rad;    // holds the directions that light leaves in
    float inner;                // part of the cone with the full intensity, of its angle
    float inv_range_sq;         // mean by power; 0: infinite
    float intensity;            // luminance of the greatest intensity
    float rough;                // least error, of the light: of tubes in place of which is a point
    bool uneven;                // cones or ranges differ
    bool flat;                  // all are rectangles and discs
};

static float distance(const float a[3], const float b[3])
{
    float d[3];
    hg_sub3(a, b, d);
    return hg_length3(d);
}

// --- lamps and nodes -----------------------------------------------------------------------------

// Solid angle of a cone with the falloff of KHR_lights_punctual, of its full intensity.
static float cone_solid_angle(float cos_inner, float cos_outer)
{
    return 2 * PI * ((1 - cos_inner) + (cos_inner - cos_outer) / 3);
}

static struct hg_light_sum sum_of_lamp(const struct hg_gpu_light *light)
{
    struct hg_light_sum s = {.cone_rad = PI, .inner = 1, .inv_range_sq = light->inv_range_sq};
    float solid_angle = 4 * PI;
    hg_copy3((const float *)&light->position_ws, s.center);
    hg_copy3((const float *)&light->direction_ws, s.axis);
    if (light->kind == HG_LIGHT_KIND_SPOT) {
        const float outer = hg_clampf(-light->spot_offset / light->spot_scale, -1, 1);
        const float inner = hg_clampf(outer + 1 / light->spot_scale, outer, 1);
        solid_angle = cone_solid_angle(inner, outer);
        s.cone_rad = acosf(outer);
        s.inner = acosf(inner) / fmaxf(s.cone_rad, 1e-6f);
    } else if (light->kind == HG_LIGHT_KIND_RECTANGLE || light->kind == HG_LIGHT_KIND_DISC) {
        solid_angle = PI;
        s.cone_rad = 0.5f * PI;
        s.flat = true;
    } else if (light->kind == HG_LIGHT_KIND_TUBE) {
        solid_angle = PI * PI;
        s.rough = 0.3f;
    }
    for (int i = 0; i < 3; i++)
        s.power[i] = ((const float *)&light->color)[i] * solid_angle;
    s.intensity = hg_emitter_luminance(light->color.x, light->color.y, light->color.z);
    s.weight = fminf(s.intensity * solid_angle, 1e30f);
    return s;
}

static void add_cone(struct hg_light_sum *s, const struct hg_light_sum *a)
{
    const float cosine = hg_clampf(hg_dot3(s->axis, a->axis), -1, 1);
    s->cone_rad = fminf(fmaxf(s->cone_rad, acosf(cosine) + a->cone_rad), PI);
    s->uneven = s->uneven || (s->cone_rad < PI && cosine < 0.99f) || a->uneven;
}

static struct hg_light_sum sum_of(const struct hg_light_sum *a, const struct hg_light_sum *b)
{
    struct hg_light_sum s = {.weight = a->weight + b->weight};
    const float t = b->weight / s.weight, apart_sq = distance(a->center, b->center);
    for (int i = 0; i < 3; i++) {
        s.center[i] = a->center[i] + (b->center[i] - a->center[i]) * t;
        s.power[i] = a->power[i] + b->power[i];
        s.axis[i] = a->axis[i] * (1 - t) + b->axis[i] * t;
    }
    s.spread_sq = a->spread_sq * (1 - t) + b->spread_sq * t + apart_sq * apart_sq * t * (1 - t);
    hg_normalize3(s.axis);
    s.inner = a->inner * (1 - t) + b->inner * t;
    s.inv_range_sq = a->inv_range_sq * (1 - t) + b->inv_range_sq * t;
    s.uneven = fabsf(a->inv_range_sq - b->inv_range_sq) > 0.2f * s.inv_range_sq ||
               fabsf(a->cone_rad - b->cone_rad) > 0.1f || fabsf(a->inner - b->inner) > 0.2f;
    s.rough = fmaxf(a->rough, b->rough);
    s.flat = a->flat && b->flat;
    add_cone(&s, a);
    add_cone(&s, b);
    s.intensity = a->intensity + b->intensity;
    return s;
}

// A light in place of a node's lamps, with their power.
static struct hg_gpu_light light_of(const struct hg_light_sum *s)
{
    struct hg_gpu_light light = {.position_ws = {s->center[0], s->center[1], s->center[2]},
        .inv_range_sq = s->inv_range_sq,
        .direction_ws = {s->axis[0], s->axis[1], s->axis[2]},
        .kind = HG_LIGHT_KIND_POINT,
        .shadow = HG_SHADOW_NONE,
        .id = HG_LIGHT_TOGETHER,
        .half_width = sqrtf(2 * s->spread_sq),
        .profile = HG_LIGHT_NO_TABLE,
        .image = HG_LIGHT_NO_TABLE};
    float solid_angle = 4 * PI;
    if (s->flat && !s->uneven) {
        const float radius = fmaxf(light.half_width, 1e-3f);
        solid_angle = PI;
        light.kind = HG_LIGHT_KIND_DISC;
        light.half_width = 0;
        light.radius = light.bound = radius;
        light.radiance = 1 / (PI * radius * radius);
        hg_basis3(s->axis, (float *)&light.axis_ws, (float[3]){0});
    } else if (s->cone_rad < 0.95f * PI) {
        const float outer = cosf(s->cone_rad), inner = cosf(s->cone_rad * s->inner);
        light.kind = HG_LIGHT_KIND_SPOT;
        light.spot_scale = 1 / fmaxf(0.001f, inner - outer);
        light.spot_offset = -outer * light.spot_scale;
        solid_angle = cone_solid_angle(fmaxf(inner, outer + 0.001f), outer);
    }
    light.color = (struct hg_vec3){
        s->power[0] / solid_angle, s->power[1] / solid_angle, s->power[2] / solid_angle};
    return light;
}

// --- the tree ------------------------------------------------------------------------------------

static void release(struct hg_light_cuts *cuts)
{
    hg_free(cuts->nodes);
    hg_free(cuts->sums);
    hg_free(cuts->places);
    hg_free(cuts->shadowed);
    hg_free(cuts->trails);
    hg_free(cuts->lamp_roots);
    cuts->nodes = NULL;
    cuts->sums = NULL;
    cuts->places = cuts->trails = cuts->lamp_roots = NULL;
    cuts->shadowed = NULL;
    cuts->signature = 0;
    cuts->node_count = cuts->root_count = 0;
}

static bool is_leaf(const struct hg_gpu_light_node *node, uint32_t *item)
{
    *item = node->child & ~HG_EMITTER_IS_LEAF;
    return (node->child & HG_EMITTER_IS_LEAF) != 0;
}

// Children lie behind their parents.
static void sum_up(struct hg_light_cuts *cuts, const struct hg_gpu_light *lamps)
{
    for (uint32_t i = cuts->node_count; i-- > 0;) {
        uint32_t at;
        cuts->sums[i] = is_leaf(&cuts->nodes[i], &at)
                            ? sum_of_lamp(&lamps[at])
                            : sum_of(&cuts->sums[at], &cuts->sums[at + 1]);
    }
}

static uint32_t tree_of(const struct hg_gpu_light *light)
{
    static const uint32_t trees[] = {[HG_LIGHT_KIND_SPOT] = 1,
        [HG_LIGHT_KIND_RECTANGLE] = 2,
        [HG_LIGHT_KIND_DISC] = 2,
        [HG_LIGHT_KIND_TUBE] = 3};
    return trees[light->kind];
}

// Takes the nodes of a tree over some of the lamps.
static enum hg_status append_tree(
    struct hg_light_cuts *cuts, const struct hg_light_tree *tree, uint32_t lamp_count)
{
    const uint32_t base = cuts->node_count;
    size_t capacity = base;
    if (tree->node_count == 0)
        return HG_OK;
    if (hg_grow(&cuts->nodes, &capacity, (size_t)base + tree->node_count, sizeof *cuts->nodes))
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < tree->node_count; i++) {
        struct hg_gpu_light_node node = tree->nodes[i];
        node.child += (node.child & HG_EMITTER_IS_LEAF) != 0 ? 0 : base;
        cuts->nodes[base + i] = node;
    }
    for (uint32_t i = 0; i < lamp_count; i++) {
        if (tree->trails[i] == HG_EMITTER_NONE)
            continue;
        cuts->trails[i] = tree->trails[i];
        cuts->lamp_roots[i] = base;
    }
    cuts->roots[cuts->root_count++] = base;
    cuts->node_count += tree->node_count;
    return HG_OK;
}

// Lamps of other trees stay dark in the list of each, which leaves them out.
static enum hg_status build_tree(struct hg_light_cuts *cuts, uint32_t which,
    const struct hg_gpu_light *lamps, uint32_t count, struct hg_jobs *jobs)
{
    struct hg_light_item *items = hg_calloc((size_t)count + 1, sizeof *items);
    struct hg_light_tree tree = {0};
    enum hg_status status = items ? HG_OK : HG_E_NOMEM;
    for (uint32_t i = 0; i < count && !status; i++)
        if (tree_of(&lamps[i]) == which)
            items[i] = hg_emitter_lamp_leaf(&lamps[i]);
    if (!status)
        status = hg_light_tree_build(items, count, jobs, &tree);
    hg_free(items);
    if (!status)
        status = append_tree(cuts, &tree, count);
    hg_light_tree_finish(&tree);
    return status;
}

static enum hg_status build_trees(struct hg_light_cuts *cuts, const struct hg_gpu_light *lamps,
    uint32_t count, struct hg_jobs *jobs)
{
    bool some[HG_LIGHT_CUT_TREES] = {false};
    release(cuts);
    cuts->trails = hg_calloc((size_t)count + 1, sizeof *cuts->trails);
    cuts->lamp_roots = hg_calloc((size_t)count + 1, sizeof *cuts->lamp_roots);
    enum hg_status status = cuts->trails && cuts->lamp_roots ? HG_OK : HG_E_NOMEM;
    for (uint32_t i = 0; i < count && !status; i++) {
        cuts->trails[i] = HG_EMITTER_NONE;
        some[tree_of(&lamps[i])] = true;
    }
    for (uint32_t which = 0; which < HG_LIGHT_CUT_TREES && !status; which++)
        if (some[which])
            status = build_tree(cuts, which, lamps, count, jobs);
    const size_t nodes = (size_t)cuts->node_count + 1;
    if (!status) {
        cuts->sums = hg_calloc(nodes, sizeof *cuts->sums);
        cuts->places = hg_calloc(nodes, sizeof *cuts->places);
        cuts->shadowed = hg_calloc(nodes, sizeof *cuts->shadowed);
        if (!cuts->sums || !cuts->places || !cuts->shadowed)
            status = HG_E_NOMEM;
    }
    if (status)
        release(cuts);
    else
        sum_up(cuts, lamps);
    return status;
}

static uint64_t lamps_signature(const struct hg_gpu_light *lamps, uint32_t count)
{
    uint64_t h = hg_hash_mix(1, count);
    for (uint32_t i = 0; i < count; i++) {
        struct hg_gpu_light lamp = lamps[i];
        lamp.shadow = lamp.shadow_count = 0; // change with the view
        h = hg_hash_mix_bytes(h, &lamp, sizeof lamp);
    }
    return h | 1;
}

static bool is_alone(const struct hg_gpu_light *lamp)
{
    return lamp->shadow != HG_SHADOW_NONE || lamp->profile != HG_LIGHT_NO_TABLE ||
           lamp->image != HG_LIGHT_NO_TABLE;
}

// Ways from the root to lamps with shadow maps, profiles or images, which no other light stands
// for.
static void mark_shadowed(
    struct hg_light_cuts *cuts, const struct hg_gpu_light *lamps, uint32_t count)
{
    memset(cuts->shadowed, 0, cuts->node_count * sizeof *cuts->shadowed);
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t trail = cuts->trails[i];
        if (!is_alone(&lamps[i]) || trail == HG_EMITTER_NONE)
            continue;
        uint32_t at = cuts->lamp_roots[i], child;
        cuts->shadowed[at] = true;
        for (uint32_t step = 0; !is_leaf(&cuts->nodes[at], &child); step++) {
            at = child + (trail >> step & 1);
            cuts->shadowed[at] = true;
        }
    }
}

// --- cells ---------------------------------------------------------------------------------------

struct cell {
    float center[3], radius; // a sphere about it
    uint32_t most;           // entries of its list
};

struct cut_entry {
    uint32_t node;
    float light, error; // estimated illuminance; 0: it is not opened
};

struct task {
    struct hg_light_cuts *cuts;
    const struct hg_lighting_view *view;
    struct hg_cluster_slices slices;
};

static float box_distance(const struct hg_gpu_light_node *node, const float p[3])
{
    const float *low = (const float *)&node->min, *high = (const float *)&node->max;
    float d[3];
    for (int i = 0; i < 3; i++)
        d[i] = fmaxf(0, fmaxf(low[i] - p[i], p[i] - high[i]));
    return hg_length3(d);
}

// No light of the node's lamps goes towards the cell.
static bool is_behind(const struct hg_light_cuts *cuts, uint32_t at, const struct cell *cell)
{
    const struct hg_light_sum *s = &cuts->sums[at];
    const struct hg_gpu_light_node *node = &cuts->nodes[at];
    if (s->cone_rad >= PI)
        return false;
    float half[3], middle[3], to[3];
    hg_sub3((const float *)&node->max, (const float *)&node->min, half);
    hg_mad3((const float *)&node->min, half, 0.5f, middle);
    hg_sub3(cell->center, middle, to);
    const float d = hg_length3(to), reach = 0.5f * hg_length3(half) + cell->radius;
    if (d <= reach)
        return false;
    const float angle = acosf(hg_clampf(hg_dot3(to, s->axis) / d, -1, 1));
    return angle > s->cone_rad + asinf(reach / d) + CONE_SLACK_RAD;
}

// False: the node gives the cell nothing.
static bool weigh(
    const struct hg_light_cuts *cuts, uint32_t at, const struct cell *cell, struct cut_entry *out)
{
    const struct hg_light_sum *s = &cuts->sums[at];
    const struct hg_gpu_light_node *node = &cuts->nodes[at];
    const float nearest = fmaxf(0, box_distance(node, cell->center) - cell->radius);
    if (nearest * nearest * node->inv_range_sq > 1 || is_behind(cuts, at, cell))
        return false;
    const float floor_sq = fmaxf(0.0625f * cell->radius * cell->radius, 1e-12f);
    const float near_sq = fmaxf(nearest * nearest, floor_sq);
    const float middle = distance(s->center, cell->center);
    *out = (struct cut_entry){
        .node = at, .light = s->intensity / fmaxf(middle * middle + s->spread_sq, floor_sq)};
    uint32_t item;
    if (is_leaf(node, &item))
        return true;
    // Moments of the first order are right, but under cones; those of the second are the error.
    // Shadows and different cones and ranges may make it as large as the light.
    float part = fminf(1, 2 * s->spread_sq / near_sq);
    if (s->cone_rad < PI)
        part = sqrtf(part);
    part = cuts->shadowed[at] || s->uneven ? 1 : fmaxf(part, s->rough);
    out->error = fmaxf(s->intensity / near_sq * part, 1e-30f);
    return true;
}

// Opens one node of a list: its children take its place.
static uint32_t open_node(const struct hg_light_cuts *cuts, const struct cell *cell,
    struct cut_entry *entries, uint32_t count, uint32_t which, double *light)
{
    const uint32_t child = cuts->nodes[entries[which].node].child;
    *light -= (double)entries[which].light;
    entries[which] = entries[--count];
    for (uint32_t i = 0; i < 2; i++) {
        if (weigh(cuts, child + i, cell, &entries[count]))
            *light += (double)entries[count++].light;
    }
    return count;
}

static uint32_t cut_cell(const struct hg_light_cuts *cuts, const struct cell *cell, uint32_t *out)
{
    struct cut_entry entries[HG_LIGHT_CUT_MOST + 1];
    uint32_t count = 0;
    double light = 0;
    for (uint32_t i = 0; i < cuts->root_count; i++) {
        if (weigh(cuts, cuts->roots[i], cell, &entries[count]))
            light += (double)entries[count++].light;
    }
    while (count > 0 && count < cell->most) {
        uint32_t worst = 0;
        for (uint32_t i = 1; i < count; i++)
            worst = entries[i].error > entries[worst].error ? i : worst;
        if ((double)entries[worst].error <= (double)HG_LIGHT_CUT_ERROR * light)
            break;
        if (!(entries[worst].error > 0))
            break;
        count = open_node(cuts, cell, entries, count, worst, &light);
    }
    for (uint32_t i = 0; i < count; i++)
        out[i] = entries[i].node;
    return count;
}

static bool touches_bounds(const struct hg_lighting_view *view, const struct cell *cell)
{
    float d[3];
    for (int i = 0; i < 3; i++)
        d[i] = fmaxf(
            0, fmaxf(view->bounds_min[i] - cell->center[i], cell->center[i] - view->bounds_max[i]));
    return view->has_ground || hg_length3(d) <= cell->radius;
}

static struct cell cell_at(const struct task *t, int x, int y, int k)
{
    const struct hg_gpu_camera *camera = t->view->camera;
    const float *m = camera->inv_view.m, down = camera->proj.m[5] < 0 ? -1.0f : 1.0f;
    float corners[8][3];
    struct cell cell = {.radius = 0};
    for (int c = 0; c < 8; c++) {
        const int slice = k + (c >> 2 & 1);
        const float depth = slice > 0 ? hg_cluster_slice_depth(&t->slices, slice) : 0;
        const float z = camera->orthographic ? 1 : depth;
        const float px = (2.0f * (float)(x + (c & 1)) / HG_CLUSTER_X - 1) * z,
                    py = (2.0f * (float)(y + (c >> 1 & 1)) / HG_CLUSTER_Y - 1) * z * down;
        const float v[3] = {px / fabsf(camera->proj.m[0]), py / fabsf(camera->proj.m[5]), -depth};
        for (int i = 0; i < 3; i++) {
            corners[c][i] = m[i] * v[0] + m[4 + i] * v[1] + m[8 + i] * v[2] + m[12 + i];
            cell.center[i] += 0.125f * corners[c][i];
        }
    }
    for (int c = 0; c < 8; c++)
        cell.radius = fmaxf(cell.radius, distance(corners[c], cell.center));
    cell.most = !touches_bounds(t->view, &cell) ? FAR_CELL_MOST
                : t->view->moves                ? HG_LIGHT_CUT_MOVING
                                                : HG_LIGHT_CUT_MOST;
    return cell;
}

static void cut_row(void *user, size_t index)
{
    const struct task *t = user;
    const int k = (int)index / HG_CLUSTER_Y, y = (int)index % HG_CLUSTER_Y;
    for (int x = 0; x < HG_CLUSTER_X; x++) {
        uint32_t *cut = t->cuts->cut + (index * HG_CLUSTER_X + (size_t)x) * (HG_LIGHT_CUT_MOST + 1);
        const struct cell cell = cell_at(t, x, y, k);
        cut[0] = cut_cell(t->cuts, &cell, cut + 1);
    }
}

// --- lists ---------------------------------------------------------------------------------------

// Lights that lists hold get places in the order of their nodes.
static enum hg_status place_lights(
    struct hg_light_cuts *cuts, const struct hg_light_set *set, uint32_t *entry_count)
{
    uint32_t *places = cuts->places, used = 0;
    memset(places, 0, cuts->node_count * sizeof *places);
    *entry_count = 0;
    for (uint32_t c = 0; c < HG_CLUSTER_COUNT; c++) {
        const uint32_t *cut = cuts->cut + (size_t)c * (HG_LIGHT_CUT_MOST + 1);
        for (uint32_t i = 0; i < cut[0]; i++)
            places[cut[1 + i]] = 1;
        *entry_count += cut[0];
    }
    for (uint32_t i = 0; i < cuts->node_count; i++)
        used += places[i];
    const size_t need = (size_t)set->directional_count + used + 1;
    if (hg_grow(&cuts->lights, &cuts->light_capacity, need, sizeof *cuts->lights))
        return HG_E_NOMEM;
    const struct hg_gpu_light *lamps = set->items + set->directional_count;
    cuts->count = set->directional_count;
    if (cuts->count > 0)
        memcpy(cuts->lights, set->items, cuts->count * sizeof *cuts->lights);
    for (uint32_t i = 0; i < cuts->node_count; i++) {
        uint32_t at;
        if (!places[i])
            continue;
        const bool leaf = is_leaf(&cuts->nodes[i], &at);
        cuts->lights[cuts->count] = leaf ? lamps[at] : light_of(&cuts->sums[i]);
        places[i] = ++cuts->count;
    }
    return HG_OK;
}

static enum hg_status write_lists(
    struct hg_light_cuts *cuts, struct hg_clusters *clusters, uint32_t entry_count)
{
    if (hg_grow(&clusters->entries, &clusters->capacity, (size_t)entry_count + 1,
            sizeof *clusters->entries))
        return HG_E_NOMEM;
    uint32_t next = 0;
    for (uint32_t c = 0; c < HG_CLUSTER_COUNT; c++) {
        const uint32_t *cut = cuts->cut + (size_t)c * (HG_LIGHT_CUT_MOST + 1);
        clusters->first[c] = next;
        for (uint32_t i = 0; i < cut[0]; i++)
            clusters->entries[next++] = cuts->places[cut[1 + i]] - 1;
    }
    clusters->first[HG_CLUSTER_COUNT] = clusters->entry_count = next;
    clusters->used = true;
    return HG_OK;
}

// Slices reach to the end of the scene.
static struct hg_cluster_slices slices_of(const struct hg_lighting_view *view)
{
    float far = view->camera->near * 2;
    for (int c = 0; c < 8; c++) {
        float p[3];
        for (int a = 0; a < 3; a++)
            p[a] = c >> a & 1 ? view->bounds_max[a] : view->bounds_min[a];
        hg_sub3(p, (const float *)&view->camera->eye_ws, p);
        far = fmaxf(far, hg_dot3(p, (const float *)&view->camera->forward_ws));
    }
    return hg_cluster_slices_make(view->camera, far);
}

enum hg_status hg_light_cuts_build(struct hg_light_cuts *cuts, struct hg_clusters *clusters,
    const struct hg_light_set *set, const struct hg_lighting_view *view, struct hg_jobs *jobs)
{
    const struct hg_gpu_light *lamps = set->items + set->directional_count;
    const uint32_t count = set->count - set->directional_count;
    const uint64_t signature = lamps_signature(lamps, count);
    const size_t words = (size_t)HG_CLUSTER_COUNT * (HG_LIGHT_CUT_MOST + 1);
    enum hg_status status = HG_OK;
    if (signature != cuts->signature)
        status = build_trees(cuts, lamps, count, jobs);
    if (!status && !cuts->cut)
        status = (cuts->cut = hg_calloc(words, sizeof *cuts->cut)) ? HG_OK : HG_E_NOMEM;
    if (status)
        return status;
    cuts->signature = signature;
    mark_shadowed(cuts, lamps, count);
    struct task task = {.cuts = cuts, .view = view, .slices = slices_of(view)};
    memset(cuts->cut, 0, words * sizeof *cuts->cut);
    if (cuts->node_count > 0 && view->has_bounds)
        hg_jobs_for(jobs, HG_CLUSTER_Z * HG_CLUSTER_Y, cut_row, &task);
    clusters->z_scale = task.slices.z_scale;
    clusters->z_bias = task.slices.z_bias;
    uint32_t entries;
    status = place_lights(cuts, set, &entries);
    return status ? status : write_lists(cuts, clusters, entries);
}

void hg_light_cuts_finish(struct hg_light_cuts *cuts)
{
    release(cuts);
    hg_free(cuts->cut);
    hg_free(cuts->lights);
    *cuts = (struct hg_light_cuts){0};
}
