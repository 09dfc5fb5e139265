#include "renderer/scene/scene.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/xform.h"

// Index of the last key at or before t, and the fraction to the next key.
static uint32_t find_key(const struct hg_anim_channel *channel, float t, float *fraction)
{
    const float *times = channel->times;
    uint32_t last = channel->key_count - 1;
    *fraction = 0;
    if (t <= times[0])
        return 0;
    if (t >= times[last])
        return last;
    uint32_t low = 0, high = last;
    while (high - low > 1) {
        uint32_t middle = low + (high - low) / 2;
        if (times[middle] <= t)
            low = middle;
        else
            high = middle;
    }
    *fraction = (t - times[low]) / (times[low + 1] - times[low]);
    return low;
}

// Cubic Hermite spline of glTF 2.0, appendix C: keys hold in-tangent, value, out-tangent.
static void sample_cubic(const struct hg_anim_channel *channel, uint32_t key, float s, float *out)
{
    uint32_t width = channel->width;
    const float *k0 = channel->values + (size_t)key * 3 * width;
    if (s <= 0) {
        memcpy(out, k0 + width, width * sizeof *out);
        return;
    }
    const float *k1 = k0 + (size_t)3 * width;
    float dt = channel->times[key + 1] - channel->times[key];
    float s2 = s * s, s3 = s2 * s;
    for (uint32_t i = 0; i < width; i++)
        out[i] = (2 * s3 - 3 * s2 + 1) * k0[width + i] +
                 dt * (s3 - 2 * s2 + s) * k0[2 * width + i] + (-2 * s3 + 3 * s2) * k1[width + i] +
                 dt * (s3 - s2) * k1[i];
}

static void sample_linear(const struct hg_anim_channel *channel, uint32_t key, float s, float *out)
{
    uint32_t width = channel->width;
    const float *a = channel->values + (size_t)key * width;
    if (s <= 0 || channel->interpolation == HG_ANIM_STEP) {
        memcpy(out, a, width * sizeof *out);
        return;
    }
    const float *b = a + width;
    if (channel->path == HG_ANIM_ROTATION) {
        hg_quat_slerp(a, b, s, out);
        return;
    }
    for (uint32_t i = 0; i < width; i++)
        out[i] = a[i] + (b[i] - a[i]) * s;
}

static float *channel_target(const struct hg_anim_channel *channel)
{
    switch (channel->path) {
    case HG_ANIM_TRANSLATION:
        return channel->node->translation;
    case HG_ANIM_ROTATION:
        return channel->node->rotation;
    case HG_ANIM_SCALE:
        return channel->node->scale;
    case HG_ANIM_WEIGHTS:
        return channel->node->weights;
    }
    return NULL;
}

static void pose_channel(struct hg_scene *scene, const struct hg_anim_channel *channel, float t)
{
    float *out = channel_target(channel);
    if (!out || channel->key_count == 0)
        return;
    float s;
    uint32_t key = find_key(channel, t, &s);
    if (channel->interpolation == HG_ANIM_CUBIC)
        sample_cubic(channel, key, s, out);
    else
        sample_linear(channel, key, s, out);
    if (channel->path == HG_ANIM_ROTATION)
        hg_quat_normalize(out);
    if (scene) {
        channel->node->moves = channel->node->moves && channel->path == HG_ANIM_WEIGHTS;
        hg_scene_touch(scene, &channel->node->head);
    }
}

// Exporters write what a shape does into every clip: that is no conflict.
static bool is_same(const struct hg_anim_channel *a, const struct hg_anim_channel *b)
{
    const size_t values =
        (size_t)a->key_count * a->width * (a->interpolation == HG_ANIM_CUBIC ? 3 : 1);
    return a->key_count == b->key_count && a->width == b->width &&
           a->interpolation == b->interpolation &&
           memcmp(a->times, b->times, a->key_count * sizeof *a->times) == 0 &&
           memcmp(a->values, b->values, values * sizeof *a->values) == 0;
}

// The animation that posed what this channel of another one moves otherwise; -1: none did.
static int64_t find_rival(const struct hg_anim_channel *channel)
{
    const struct hg_anim_channel *by =
        channel->node ? channel->node->posed_by[channel->path] : NULL;
    return by && by->animation != channel->animation && !is_same(by, channel)
               ? (int64_t)by->animation
               : -1;
}

static bool has_rival(const struct hg_animation *a)
{
    for (uint32_t c = 0; c < a->channel_count; c++)
        if (find_rival(&a->channels[c]) >= 0)
            return true;
    return false;
}

static void put_rest(const struct hg_anim_channel *channel)
{
    const bool moves = channel->node->moves && channel->path != HG_ANIM_WEIGHTS;
    float *to = channel_target(channel);
    if (moves || !channel->rest || !to) // weights that a client gave a node which had none
        return;
    memcpy(to, channel->rest, channel->width * sizeof *channel->rest);
}

// Ends an animation that was posed: what it moves goes back to rest.
static void end_animation(struct hg_asset *asset, struct hg_animation *a)
{
    for (uint32_t c = 0; c < a->channel_count; c++) {
        const struct hg_anim_channel *channel = &a->channels[c];
        if (!channel->node || channel->node->posed_by[channel->path] != channel)
            continue;
        channel->node->posed_by[channel->path] = NULL;
        put_rest(channel);
        if (asset->scene)
            hg_scene_touch(asset->scene, &channel->node->head);
    }
    a->posed = false;
}

// Takes what an animation moves from all others.
static void claim(struct hg_asset *asset, const struct hg_animation *a)
{
    for (uint32_t c = 0; c < a->channel_count; c++) {
        const struct hg_anim_channel *channel = &a->channels[c];
        const int64_t rival = find_rival(channel);
        if (rival >= 0)
            end_animation(asset, &asset->animations[rival]);
        if (channel->node)
            channel->node->posed_by[channel->path] = channel;
    }
}

// Blender's FBX exporter writes every action for every object that it fits, as OBJECT|ACTION, and
// an action has the name of its object in front unless its author gave it one: "hub|hubAction", not
// "hub|doorAction".
static bool is_of_its_object(const struct hg_animation *a)
{
    const char *action = a->name ? strchr(a->name, '|') : NULL;
    const size_t size = action ? (size_t)(action - a->name) : 0;
    return size > 0 && strncmp(action + 1, a->name, size) == 0;
}

static void claim_free(struct hg_asset *asset, bool of_their_objects)
{
    for (uint32_t i = 0; i < asset->animation_count; i++) {
        struct hg_animation *a = &asset->animations[i];
        if (is_of_its_object(a) != of_their_objects)
            continue;
        a->conflicts = has_rival(a);
        if (!a->conflicts)
            claim(asset, a);
    }
}

// Of animations that move the same things, such as the walk and the run of a character, the first
// one is posed together with all others.
static void find_conflicts(struct hg_asset *asset)
{
    for (uint32_t i = 0; i < asset->animation_count; i++)
        for (uint32_t c = 0; c < asset->animations[i].channel_count; c++)
            asset->animations[i].channels[c].animation = i;
    claim_free(asset, true);
    claim_free(asset, false);
    for (uint32_t i = 0; i < asset->animation_count; i++)
        end_animation(asset, &asset->animations[i]);
}

enum hg_status hg_asset_pose(struct hg_asset *asset, int32_t animation, double time_s)
{
    if (animation < -1 || (animation >= 0 && (uint32_t)animation >= asset->animation_count))
        return HG_E_NOTFOUND;
    uint32_t first = animation < 0 ? 0 : (uint32_t)animation;
    uint32_t end = animation < 0 ? asset->animation_count : first + 1;
    for (uint32_t i = first; i < end; i++) {
        struct hg_animation *a = &asset->animations[i];
        if (animation < 0 && a->conflicts)
            continue;
        claim(asset, a);
        for (uint32_t c = 0; c < a->channel_count; c++)
            pose_channel(asset->scene, &a->channels[c], (float)time_s);
        a->posed = true;
        a->time_s = time_s;
    }
    return HG_OK;
}

static enum hg_status keep_rest(struct hg_anim_channel *channel)
{
    const float *from = channel_target(channel);
    if (!from || channel->rest)
        return HG_OK;
    channel->rest = hg_calloc(channel->width, sizeof *channel->rest);
    if (!channel->rest)
        return HG_E_NOMEM;
    memcpy(channel->rest, from, channel->width * sizeof *channel->rest);
    return HG_OK;
}

enum hg_status hg_asset_keep_rest(struct hg_asset *asset)
{
    for (uint32_t i = 0; i < asset->animation_count; i++)
        for (uint32_t c = 0; c < asset->animations[i].channel_count; c++)
            if (keep_rest(&asset->animations[i].channels[c]))
                return HG_E_NOMEM;
    find_conflicts(asset);
    return HG_OK;
}

// --- other times ---------------------------------------------------------------------------------

typedef void (*channel_fn)(
    const struct hg_animation *animation, const struct hg_anim_channel *channel, void *user);

// Channels of all animations that were posed, in order.
static void for_posed(const struct hg_scene *scene, channel_fn call, void *user)
{
    for (uint32_t i = 0; i < scene->asset_count; i++) {
        const struct hg_asset *asset = scene->assets[i];
        for (uint32_t k = 0; k < asset->animation_count; k++) {
            const struct hg_animation *a = &asset->animations[k];
            for (uint32_t c = 0; a->posed && c < a->channel_count; c++)
                if (a->channels[c].key_count > 0 && channel_target(&a->channels[c]) != NULL)
                    call(a, &a->channels[c], user);
        }
    }
}

static void count_values(
    const struct hg_animation *animation, const struct hg_anim_channel *channel, void *user)
{
    (void)animation;
    *(size_t *)user += channel->width;
}

// Values that a node that moves has: translation, rotation, scale.
enum { MOVED_VALUES = 10 };

static struct hg_node *node_at(const struct hg_scene *scene, uint32_t index)
{
    return (struct hg_node *)scene->objects[HG_OBJECT_NODE].items[index];
}

static size_t count_moved(const struct hg_scene *scene)
{
    size_t count = 0;
    for (uint32_t i = 0; i < scene->objects[HG_OBJECT_NODE].count; i++)
        count += node_at(scene, i)->moves;
    return count;
}

static size_t count_all(const struct hg_scene *scene)
{
    size_t values = 0;
    for_posed(scene, count_values, &values);
    return values + count_moved(scene) * MOVED_VALUES;
}

bool hg_scene_moves(const struct hg_scene *scene)
{
    return count_all(scene) > 0;
}

static void keep_values(
    const struct hg_animation *animation, const struct hg_anim_channel *channel, void *user)
{
    float **at = user;
    (void)animation;
    memcpy(*at, channel_target(channel), channel->width * sizeof **at);
    *at += channel->width;
}

static void put_values(
    const struct hg_animation *animation, const struct hg_anim_channel *channel, void *user)
{
    const float **at = user;
    (void)animation;
    memcpy(channel_target(channel), *at, channel->width * sizeof **at);
    *at += channel->width;
}

static void shift_values(
    const struct hg_animation *animation, const struct hg_anim_channel *channel, void *user)
{
    const double *offset_s = user;
    pose_channel(NULL, channel, (float)(animation->time_s + *offset_s));
}

static void put_posed_to_rest(
    const struct hg_animation *animation, const struct hg_anim_channel *channel, void *user)
{
    (void)animation;
    (void)user;
    put_rest(channel);
}

static void put_moved(struct hg_node *node, const float values[MOVED_VALUES])
{
    memcpy(node->translation, values, sizeof node->translation);
    memcpy(node->rotation, values + 3, sizeof node->rotation);
    memcpy(node->scale, values + 7, sizeof node->scale);
}

static void keep_moved(const struct hg_scene *scene, float *at)
{
    for (uint32_t i = 0; i < scene->objects[HG_OBJECT_NODE].count; i++) {
        const struct hg_node *node = node_at(scene, i);
        if (!node->moves)
            continue;
        memcpy(at, node->translation, sizeof node->translation);
        memcpy(at + 3, node->rotation, sizeof node->rotation);
        memcpy(at + 7, node->scale, sizeof node->scale);
        at += MOVED_VALUES;
    }
}

// From where it was kept, whatever it has come to since.
static void move(struct hg_node *node, const float from[MOVED_VALUES], float frames)
{
    put_moved(node, from);
    for (int i = 0; i < 3; i++) {
        node->translation[i] += frames * (node->next.translation[i] - from[i]);
        node->scale[i] += frames * (node->next.scale[i] - from[7 + i]);
    }
    hg_quat_slerp(from + 3, node->next.rotation, frames, node->rotation);
}

static enum hg_status keep(const struct hg_scene *scene, struct hg_pose_kept *kept)
{
    if (kept->taken)
        return HG_OK;
    if (hg_grow(&kept->values, &kept->capacity, count_all(scene) + 1, sizeof *kept->values))
        return HG_E_NOMEM;
    float *at = kept->values;
    for_posed(scene, keep_values, &at);
    kept->moved = (size_t)(at - kept->values);
    keep_moved(scene, at);
    kept->taken = true;
    return HG_OK;
}

enum hg_status hg_scene_pose_rest(struct hg_scene *scene, struct hg_pose_kept *kept)
{
    const enum hg_status status = keep(scene, kept);
    if (!status)
        for_posed(scene, put_posed_to_rest, NULL);
    return status;
}

enum hg_status hg_scene_pose_shift(
    struct hg_scene *scene, double offset_s, double frames, struct hg_pose_kept *kept)
{
    if (keep(scene, kept))
        return HG_E_NOMEM;
    for_posed(scene, shift_values, &offset_s);
    const float *from = kept->values + kept->moved;
    for (uint32_t i = 0; i < scene->objects[HG_OBJECT_NODE].count; i++) {
        if (!node_at(scene, i)->moves)
            continue;
        move(node_at(scene, i), from, (float)frames);
        from += MOVED_VALUES;
    }
    return HG_OK;
}

void hg_scene_pose_restore(struct hg_scene *scene, struct hg_pose_kept *kept)
{
    const float *at = kept->values;
    if (kept->taken)
        for_posed(scene, put_values, &at);
    for (uint32_t i = 0; kept->taken && i < scene->objects[HG_OBJECT_NODE].count; i++) {
        if (!node_at(scene, i)->moves)
            continue;
        put_moved(node_at(scene, i), at);
        at += MOVED_VALUES;
    }
    hg_free(kept->values);
    *kept = (struct hg_pose_kept){0};
}
