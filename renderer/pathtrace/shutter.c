#include "renderer/pathtrace/shutter.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/passes/skin.h"

#define LOOKS       16   // poses that are looked at to see how straight motion is
#define TURN_RAD    0.14 // of one part: an arc of it is 0.25 % of its radius off the straight line
#define BEND        0.02 // of the way, that a place may be off the straight line
#define STILL_M     1e-6
#define STILL_SCALE 1e-5

// --- camera --------------------------------------------------------------------------------------

void hg_shutter_look_along(const struct hg_node *node, float eye[3], float target[3], float up[3])
{
    for (int i = 0; i < 3; i++) {
        eye[i] = node->world[12 + i];
        target[i] = node->world[12 + i] - node->world[8 + i];
        up[i] = node->world[4 + i];
    }
}

static const struct hg_node *camera_node(const struct hg_shutter *shutter)
{
    const uint64_t id = shutter->camera->node;
    return id == 0 ? NULL
                   : (const struct hg_node *)hg_scene_find(
                         shutter->scene_gpu->scene, HG_OBJECT_NODE, id);
}

// Sets the scene to the pose of that time.
static struct hg_view_camera_state camera_at(const struct hg_shutter *shutter, double frames)
{
    struct hg_view_camera_state c = *shutter->camera;
    const struct hg_node *node = camera_node(shutter);
    float eye[3], target[3], up[3];
    if (node != NULL) {
        hg_shutter_look_along(node, eye, target, up);
        for (int i = 0; i < 3; i++) {
            c.eye[i] = (double)eye[i];
            c.target[i] = (double)target[i];
            c.up[i] = (double)up[i];
        }
    }
    for (int i = 0; i < 3 && c.moves; i++) {
        c.eye[i] += frames * (c.next_eye[i] - c.eye[i]);
        c.target[i] += frames * (c.next_target[i] - c.target[i]);
        c.up[i] += frames * (c.next_up[i] - c.up[i]);
    }
    return c;
}

static void fill_camera(const struct hg_shutter *shutter, double frames, struct hg_gpu_camera *out)
{
    const struct hg_view_camera_state at = camera_at(shutter, frames);
    const struct hg_camera_setup setup =
        hg_scene_gpu_camera(shutter->scene_gpu, &at, shutter->width, shutter->height);
    hg_camera_fill(&setup, out);
}

// --- poses ---------------------------------------------------------------------------------------

static double seconds(const struct hg_shutter *shutter, double frames)
{
    return frames * (double)shutter->frame_s;
}

static void put_back(struct hg_scene *scene, struct hg_pose_kept *kept)
{
    hg_scene_pose_restore(scene, kept);
    hg_scene_update(scene);
}

enum hg_status hg_shutter_pose(const struct hg_shutter *shutter, double frames,
    struct hg_gpu_camera *camera, struct hg_error *err)
{
    struct hg_scene *scene = shutter->scene_gpu->scene;
    struct hg_pose_kept kept = {0};
    enum hg_status status = hg_scene_pose_shift(scene, seconds(shutter, frames), frames, &kept);
    if (status != HG_OK)
        return hg_error_set(err, status, "motion", NULL, "out of host memory");
    hg_scene_update(scene);
    status = hg_scene_gpu_pose(shutter->scene_gpu, shutter->who, err);
    fill_camera(shutter, frames, camera);
    put_back(scene, &kept);
    return status == HG_OK ? hg_skin_run(shutter->gpu, shutter->scene_gpu->geometry, err) : status;
}

enum hg_status hg_shutter_lights(const struct hg_shutter *shutter, double frames,
    struct hg_light_set *lights, struct hg_error *err)
{
    struct hg_scene *scene = shutter->scene_gpu->scene;
    struct hg_pose_kept kept = {0};
    double origin[3];
    hg_geometry_origin(shutter->scene_gpu->geometry, origin);
    enum hg_status status = hg_scene_pose_shift(scene, seconds(shutter, frames), frames, &kept);
    if (status == HG_OK) {
        hg_scene_update(scene);
        status = hg_light_set_collect(lights, scene, origin);
        put_back(scene, &kept);
    }
    return status == HG_OK ? HG_OK
                           : hg_error_set(err, status, "motion", NULL, "out of host memory");
}

// --- how straight motion is ----------------------------------------------------------------------

// Motion of a node over all time steps.
struct track {
    double turn; // radians, summed
    double way;  // metres, of the straight line
    double bend; // greatest deviation from that line
    float first[16], last[16], before[16];
};

// Angle between the axes of two matrices, the largest of the three.
static double turn_between(const float a[16], const float b[16])
{
    double most = 0;
    for (int c = 0; c < 3; c++) {
        double dot = 0, aa = 0, bb = 0;
        for (int i = 0; i < 3; i++) {
            dot += (double)a[c * 4 + i] * (double)b[c * 4 + i];
            aa += (double)a[c * 4 + i] * (double)a[c * 4 + i];
            bb += (double)b[c * 4 + i] * (double)b[c * 4 + i];
        }
        const double cosine = aa > 0 && bb > 0 ? dot / sqrt(aa * bb) : 1.0;
        most = fmax(most, acos(fmin(fmax(cosine, -1.0), 1.0)));
    }
    return most;
}

// Places at equal steps of time should be at equal steps of the line.
static double off_line(const struct track *t, const float now[16], double share)
{
    double sum = 0;
    for (int i = 12; i < 15; i++) {
        const double want =
            (double)t->first[i] + share * ((double)t->last[i] - (double)t->first[i]);
        sum += ((double)now[i] - want) * ((double)now[i] - want);
    }
    return sqrt(sum);
}

static void matrix_of(
    const struct hg_shutter *shutter, uint32_t index, double frames, float out[16])
{
    const struct hg_object_list *nodes = &shutter->scene_gpu->scene->objects[HG_OBJECT_NODE];
    if (index < nodes->count) {
        memcpy(out, ((const struct hg_node *)nodes->items[index])->world, 16 * sizeof *out);
        return;
    }
    struct hg_gpu_camera camera; // one more
    fill_camera(shutter, frames, &camera);
    memcpy(out, camera.inv_view.m, 16 * sizeof *out);
}

// look: 0 the first, then the last one, then those between in order.
static void follow(struct track *t, const float now[16], uint32_t look, double share)
{
    if (look == 0) {
        memcpy(t->first, now, sizeof t->first);
        memcpy(t->before, now, sizeof t->before);
        return;
    }
    if (look == 1) {
        memcpy(t->last, now, sizeof t->last);
        t->way = off_line(t, t->last, 0.0);
        return;
    }
    t->turn += turn_between(t->before, now);
    t->bend = fmax(t->bend, off_line(t, now, share));
    memcpy(t->before, now, sizeof t->before);
}

static double parts_for(const struct track *t)
{
    const double turn = t->turn + turn_between(t->before, t->last);
    double parts = turn > STILL_SCALE ? turn / TURN_RAD : 1.0;
    const double most = fmax(BEND * t->way, STILL_M);
    if (t->bend > most) // a curve's distance from its chord falls with the square of the steps
        parts = fmax(parts, sqrt(t->bend / most));
    return isfinite(parts) ? parts : LOOKS;
}

static enum hg_status look_at_all(const struct hg_shutter *shutter,
    const struct hg_shutter_span *span, struct track *tracks, uint32_t count)
{
    struct hg_scene *scene = shutter->scene_gpu->scene;
    struct hg_pose_kept kept = {0};
    enum hg_status status = HG_OK;
    for (uint32_t look = 0; look <= LOOKS && status == HG_OK; look++) {
        const double share = look == 0 ? 0.0 : look == 1 ? 1.0 : (look - 1.0) / LOOKS;
        const double frames = span->open + share * (span->close - span->open);
        float now[16];
        status = hg_scene_pose_shift(scene, seconds(shutter, frames), frames, &kept);
        if (status != HG_OK)
            break;
        hg_scene_update(scene);
        for (uint32_t i = 0; i < count; i++) {
            matrix_of(shutter, i, frames, now);
            follow(&tracks[i], now, look, share);
        }
    }
    put_back(scene, &kept);
    return status;
}

enum hg_status hg_shutter_parts(const struct hg_shutter *shutter,
    const struct hg_shutter_span *span, uint32_t *parts, struct hg_error *err)
{
    const uint32_t count = shutter->scene_gpu->scene->objects[HG_OBJECT_NODE].count + 1;
    struct track *tracks = hg_calloc(count, sizeof *tracks);
    double need = 1.0;
    *parts = 1;
    enum hg_status status = tracks != NULL ? look_at_all(shutter, span, tracks, count) : HG_E_NOMEM;
    for (uint32_t i = 0; i < count && status == HG_OK; i++)
        need = fmax(need, parts_for(&tracks[i]));
    hg_free(tracks);
    while (*parts < span->most && (double)*parts < need)
        *parts *= 2;
    return status == HG_OK ? HG_OK
                           : hg_error_set(err, status, "motion", NULL, "out of host memory");
}
