#include "renderer/scene/formats/gltf/gltf.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"

static bool parse_path(const char *text, enum hg_anim_path *path)
{
    static const char *const names[] = {"translation", "rotation", "scale", "weights"};
    for (int i = 0; text && i < 4; i++)
        if (strcmp(text, names[i]) == 0) {
            *path = (enum hg_anim_path)i;
            return true;
        }
    return false;
}

static enum hg_anim_interpolation parse_interpolation(
    struct hg_gltf *g, const struct hg_gltf_at *sampler)
{
    const char *text = hg_gltf_string(sampler, "interpolation");
    if (text && strcmp(text, "STEP") == 0)
        return HG_ANIM_STEP;
    if (text && strcmp(text, "CUBICSPLINE") == 0)
        return HG_ANIM_CUBIC;
    if (text && strcmp(text, "LINEAR") != 0)
        hg_gltf_warn(g, sampler, "VALUE_NOT_IN_LIST: interpolation '%s'", text);
    return HG_ANIM_LINEAR;
}

static enum hg_status read_times(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_anim_channel *channel)
{
    struct hg_gltf_at place = hg_gltf_key(at, "input");
    struct hg_gltf_accessor a;
    enum hg_status status = hg_gltf_accessor_open(g, (uint64_t)hg_gltf_index(at, "input"), &a);
    if (status)
        return status;
    if (a.rows != 1 || a.columns != 1 || a.component_type != 5126)
        return hg_gltf_fail(g, &place, HG_E_FORMAT,
            "ANIMATION_SAMPLER_INPUT_ACCESSOR_INVALID_FORMAT: float scalars are needed");
    channel->times = hg_gltf_alloc(g, &place, a.count, sizeof *channel->times);
    if (!channel->times)
        return g->err->status;
    hg_gltf_read_floats(&a, 1, 0, channel->times);
    channel->key_count = a.count;
    return HG_OK;
}

static void move_key(struct hg_anim_channel *channel, uint32_t from, uint32_t to)
{
    const size_t size = (size_t)channel->width * (channel->interpolation == HG_ANIM_CUBIC ? 3 : 1);
    channel->times[to] = channel->times[from];
    memmove(channel->values + to * size, channel->values + from * size, size * sizeof(float));
}

// Leaves keys whose times grow. Of two at one time the first comes just before it: a jump; of more
// the first and the last count.
static void sort_out_keys(
    struct hg_gltf *g, const struct hg_gltf_at *sampler, struct hg_anim_channel *channel)
{
    const struct hg_gltf_at place = hg_gltf_key(sampler, "input");
    const uint32_t count = channel->key_count;
    float *times = channel->times;
    uint32_t kept = 0, wrong = UINT32_MAX;
    for (uint32_t i = 0; i < count; i++) {
        const float t = times[i], last = kept ? times[kept - 1] : -INFINITY;
        const bool grows = isfinite(t) && t > last, repeats = isfinite(t) && t == last;
        const float before = repeats ? nextafterf(t, -INFINITY) : 0;
        wrong = wrong == UINT32_MAX && (!grows || (i == 0 && t < 0)) ? i : wrong;
        if (grows || (repeats && (kept < 2 || times[kept - 2] < before))) {
            if (repeats)
                times[kept - 1] = before;
            move_key(channel, i, kept++);
        } else if (repeats) {
            move_key(channel, i, kept - 1);
        }
    }
    if (wrong != UINT32_MAX)
        hg_gltf_warn(g, &place,
            "ACCESSOR_ANIMATION_INPUT_NON_INCREASING: at time %u; %u of %u keys are used", wrong,
            kept, count);
    channel->key_count = kept;
}

static enum hg_status read_values(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_anim_channel *channel)
{
    struct hg_gltf_at place = hg_gltf_key(at, "output");
    struct hg_gltf_accessor a;
    enum hg_status status = hg_gltf_accessor_open(g, (uint64_t)hg_gltf_index(at, "output"), &a);
    if (status)
        return status;
    uint32_t components = channel->path == HG_ANIM_WEIGHTS ? 1 : channel->width;
    if (a.rows != components || a.columns != 1 || a.component_type == 5125)
        return hg_gltf_fail(g, &place, HG_E_FORMAT,
            "ANIMATION_SAMPLER_OUTPUT_ACCESSOR_INVALID_FORMAT: %u components, %u expected", a.rows,
            components);
    uint64_t need = (uint64_t)channel->key_count *
                    (channel->interpolation == HG_ANIM_CUBIC ? 3 : 1) *
                    (channel->path == HG_ANIM_WEIGHTS ? channel->width : 1);
    if (a.count != need)
        return hg_gltf_fail(g, &place, HG_E_FORMAT,
            "ANIMATION_SAMPLER_OUTPUT_ACCESSOR_INVALID_COUNT: %u elements, %llu expected", a.count,
            (unsigned long long)need);
    size_t total = (size_t)a.count * components;
    channel->values = hg_gltf_alloc(g, &place, total, sizeof *channel->values);
    if (!channel->values)
        return g->err->status;
    hg_gltf_read_floats(&a, components, 0, channel->values);
    for (size_t i = 0; i < total; i++)
        if (!isfinite(channel->values[i]))
            return hg_gltf_fail(
                g, &place, HG_E_FORMAT, "ACCESSOR_INVALID_FLOAT: value %zu is not finite", i);
    return HG_OK;
}

// A channel that cannot move its node is left out: *out stays without a node.
static enum hg_status read_channel(struct hg_gltf *g, const struct hg_gltf_at *at,
    const struct hg_gltf_at *samplers, struct hg_anim_channel *out)
{
    struct hg_gltf_at target = hg_gltf_key(at, "target");
    int64_t node = hg_gltf_index(&target, "node"), index = hg_gltf_index(at, "sampler");
    if (!parse_path(hg_gltf_string(&target, "path"), &out->path)) {
        hg_gltf_warn(g, &target, "VALUE_NOT_IN_LIST: unknown path; the channel is left out");
        return HG_OK;
    }
    if (node < 0 || node >= g->asset->node_count)
        return HG_OK; // a target only extensions know
    struct hg_node *n = g->asset->nodes[node];
    if (out->path == HG_ANIM_WEIGHTS && !n->weights) {
        hg_gltf_warn(
            g, &target, "ANIMATION_CHANNEL_TARGET_NODE_WEIGHTS_NO_MORPHS: the channel is left out");
        return HG_OK;
    }
    struct hg_gltf_at sampler = hg_gltf_item(samplers, index < 0 ? SIZE_MAX : (size_t)index);
    if (!sampler.json)
        return hg_gltf_fail(g, at, HG_E_FORMAT, "UNRESOLVED_REFERENCE: no such sampler");
    out->width = out->path == HG_ANIM_WEIGHTS    ? n->mesh->target_count
                 : out->path == HG_ANIM_ROTATION ? 4
                                                 : 3;
    out->interpolation = parse_interpolation(g, &sampler);
    enum hg_status status = read_times(g, &sampler, out);
    if (!status)
        status = read_values(g, &sampler, out);
    if (!status)
        sort_out_keys(g, &sampler, out);
    if (!status && n->has_matrix)
        hg_gltf_warn(g, &target, "ANIMATION_CHANNEL_TARGET_NODE_MATRIX: the channel is left out");
    else if (!status && out->key_count)
        out->node = n;
    return status;
}

static void drop_channel(struct hg_anim_channel *channel)
{
    hg_free(channel->times);
    hg_free(channel->values);
    memset(channel, 0, sizeof *channel);
}

static enum hg_status read_animation(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_animation *animation)
{
    struct hg_gltf_at channels = hg_gltf_key(at, "channels");
    struct hg_gltf_at samplers = hg_gltf_key(at, "samplers");
    const char *name = hg_gltf_string(at, "name");
    size_t count = hg_gltf_count(&channels);
    animation->name = hg_strdup(name ? name : "");
    animation->channels =
        animation->name ? hg_gltf_alloc(g, at, count, sizeof *animation->channels) : NULL;
    if (!animation->channels)
        return animation->name ? g->err->status
                               : hg_gltf_fail(g, at, HG_E_NOMEM, "no memory for an animation");
    for (size_t c = 0; c < count; c++) {
        struct hg_gltf_at item = hg_gltf_item(&channels, c);
        struct hg_anim_channel *channel = &animation->channels[animation->channel_count];
        enum hg_status status = read_channel(g, &item, &samplers, channel);
        if (status || !channel->node) {
            drop_channel(channel);
            if (status)
                return status;
            continue;
        }
        double end = channel->times[channel->key_count - 1];
        animation->duration_s = end > animation->duration_s ? end : animation->duration_s;
        animation->channel_count++;
    }
    return HG_OK;
}

enum hg_status hg_gltf_load_animations(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "animations");
    size_t count = hg_gltf_count(&list);
    g->asset->animations = hg_gltf_alloc(g, &list, count, sizeof *g->asset->animations);
    if (!g->asset->animations)
        return g->err->status;
    g->asset->animation_count = (uint32_t)count;
    for (size_t i = 0; i < count; i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i);
        enum hg_status status = read_animation(g, &at, &g->asset->animations[i]);
        if (status)
            return status;
    }
    return HG_OK;
}
