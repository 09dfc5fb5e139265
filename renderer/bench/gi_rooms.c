#include "renderer/bench/gi_rooms.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/bench/mesh.h"

#define WIDTH    64
#define HEIGHT   48
#define COLUMNS  8
#define ROWS     6
#define REGIONS  (COLUMNS * ROWS)
#define BEFORE   180 // pictures in motion until light has come to rest
#define AFTER    90  // that are measured after a change
#define SUN_RISE 0.6f

// --- the rooms -----------------------------------------------------------------------------------

// A bright one from x = -4 to 0, a dark one behind a wall, both 4 m wide and 3 m high.
struct rooms {
    struct hg_bench_scene made;
    struct hg_material *material;
    struct hg_light *lamp; // in the bright room
    struct hg_node *door;  // NULL: none
};

struct plan {
    float wall_m;
    bool opening; // in the wall between
    bool door;    // in the opening, which it closes
    bool window;  // of the bright room, to the sky; the lamp is dark then
};

static enum hg_status add_box(
    struct rooms *r, const float box[2][3], struct hg_node **out, struct hg_error *err)
{
    struct hg_mesh *mesh;
    enum hg_status status = hg_bench_mesh_box(&r->made, box, r->material, &mesh);
    if (status == HG_OK)
        status = hg_bench_scene_add(&r->made, HG_OBJECT_NODE, out);
    if (status != HG_OK)
        return hg_error_set(err, status, "bench", NULL, "no memory for the rooms");
    (*out)->mesh = mesh;
    return HG_OK;
}

// A wall across x from `x` to `to`, with a hole of the given height range and half its width.
static enum hg_status add_wall(
    struct rooms *r, const float x[2], const float hole[3], struct hg_error *err)
{
    const float parts[4][2][3] = {{{x[0], 0, -2}, {x[1], 3, -hole[2]}},
        {{x[0], 0, hole[2]}, {x[1], 3, 2}}, {{x[0], hole[1], -hole[2]}, {x[1], 3, hole[2]}},
        {{x[0], 0, -hole[2]}, {x[1], hole[0], hole[2]}}};
    enum hg_status status = HG_OK;
    for (int i = 0; i < 4 && status == HG_OK; i++) {
        struct hg_node *node;
        if (parts[i][1][1] > parts[i][0][1] && parts[i][1][2] > parts[i][0][2])
            status = add_box(r, parts[i], &node, err);
    }
    return status;
}

static enum hg_status add_shell(struct rooms *r, const struct plan *plan, struct hg_error *err)
{
    const float end = plan->wall_m + 4;
    const float boxes[5][2][3] = {{{-4.2f, -0.2f, -2.2f}, {end + 0.2f, 0, 2.2f}},
        {{-4.2f, 3, -2.2f}, {end + 0.2f, 3.2f, 2.2f}}, {{-4.2f, 0, -2.2f}, {end + 0.2f, 3, -2}},
        {{-4.2f, 0, 2}, {end + 0.2f, 3, 2.2f}}, {{end, 0, -2}, {end + 0.2f, 3, 2}}};
    struct hg_node *node;
    enum hg_status status = HG_OK;
    for (int i = 0; i < 5 && status == HG_OK; i++)
        status = add_box(r, boxes[i], &node, err);
    const float window[3] = {1, plan->window ? 2.5f : 1, plan->window ? 1 : 0};
    const float opening[3] = {0, plan->opening ? 2.2f : 0, plan->opening ? 0.6f : 0};
    if (status == HG_OK)
        status = add_wall(r, (const float[2]){-4.2f, -4}, window, err);
    if (status == HG_OK)
        status = add_wall(r, (const float[2]){0, plan->wall_m}, opening, err);
    const float door[2][3] = {{0.01f, 0, -0.6f}, {plan->wall_m - 0.01f, 2.2f, 0.6f}};
    return status == HG_OK && plan->door ? add_box(r, door, &r->door, err) : status;
}

static void turn_sun(struct rooms *r, float azimuth_rad)
{
    struct hg_environment *e = &r->made.scene->environment;
    e->kind = HG_ENV_SKY;
    e->intensity = 1;
    e->turbidity = 2;
    e->sun_direction[0] = -cosf(SUN_RISE) * cosf(azimuth_rad);
    e->sun_direction[1] = sinf(SUN_RISE);
    e->sun_direction[2] = cosf(SUN_RISE) * sinf(azimuth_rad);
    e->revision = r->made.scene->revision + 1;
}

static void set_lamp(struct rooms *r, float candela)
{
    r->lamp->intensity = candela;
    hg_scene_touch(r->made.scene, &r->lamp->head);
}

static enum hg_status add_lamp(struct rooms *r, struct hg_error *err)
{
    struct hg_node *node;
    enum hg_status status = hg_bench_scene_add(&r->made, HG_OBJECT_LIGHT, &r->lamp);
    if (status == HG_OK)
        status = hg_bench_scene_add(&r->made, HG_OBJECT_NODE, &node);
    if (status != HG_OK)
        return hg_error_set(err, status, "bench", NULL, "no memory for the rooms");
    node->translation[0] = -2;
    node->translation[1] = 2.5f;
    node->light = r->lamp;
    r->lamp->kind = HG_LIGHT_POINT;
    return HG_OK;
}

static enum hg_status make(struct rooms *r, const struct plan *plan, struct hg_error *err)
{
    *r = (struct rooms){0};
    enum hg_status status = hg_bench_scene_begin(&r->made, 1);
    if (status == HG_OK)
        status = hg_bench_scene_add(&r->made, HG_OBJECT_MATERIAL, &r->material);
    if (status != HG_OK)
        return hg_error_set(err, status, "bench", NULL, "no memory for the rooms");
    for (int c = 0; c < 3; c++)
        r->material->base_color[c] = 0.6f;
    r->material->metallic = 0;
    status = add_shell(r, plan, err);
    if (status == HG_OK)
        status = add_lamp(r, err);
    if (status != HG_OK)
        return status;
    r->lamp->intensity = plan->window ? 0 : 20;
    if (plan->window)
        turn_sun(r, 0);
    hg_scene_publish(r->made.scene);
    return HG_OK;
}

// --- pictures ------------------------------------------------------------------------------------

struct regions {
    double light[REGIONS];
};

static double mean_of(const struct regions *r)
{
    double sum = 0;
    for (int i = 0; i < REGIONS; i++)
        sum += r->light[i];
    return sum / REGIONS;
}

static double most_of(const struct regions *r)
{
    double most = 0;
    for (int i = 0; i < REGIONS; i++)
        most = fmax(most, r->light[i]);
    return most;
}

static enum hg_status look(
    struct hg_view *view, const struct hg_bench_pose *pose, uint32_t picture, struct hg_error *err)
{
    struct hg_view_camera camera = {.vfov_rad = 1};
    memcpy(camera.eye, pose->eye, sizeof camera.eye);
    memcpy(camera.target, pose->target, sizeof camera.target);
    camera.eye[1] += picture % 2 != 0 ? 1e-3f : 0; // it moves, for what is drawn to be in motion
    return hg_view_set_camera(view, &camera, err);
}

static enum hg_status read_regions(struct hg_view *view, struct regions *out, struct hg_error *err)
{
    struct hg_refbuf *picture;
    const enum hg_status status = hg_view_read_pixels(view, HG_PIXEL_RGBA32F, &picture, err);
    if (status != HG_OK)
        return status;
    const float *p = (const float *)(const void *)picture->data;
    *out = (struct regions){0};
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++, p += 4)
            out->light[y * ROWS / HEIGHT * COLUMNS + x * COLUMNS / WIDTH] +=
                (0.2126 * (double)p[0] + 0.7152 * (double)p[1] + 0.0722 * (double)p[2]) * REGIONS /
                (WIDTH * HEIGHT);
    hg_refbuf_unref(picture);
    return HG_OK;
}

static enum hg_status draw(struct hg_view *view, const struct hg_bench_pose *pose, uint32_t picture,
    struct regions *out, struct hg_error *err)
{
    struct hg_frame_info info;
    enum hg_status status = look(view, pose, picture, err);
    if (status == HG_OK)
        status = hg_view_step(view, 1, &info, err);
    return status == HG_OK ? read_regions(view, out, err) : status;
}

static enum hg_status open_view(struct hg_renderer *renderer, struct rooms *r, enum hg_view_gi gi,
    struct hg_view **out, struct hg_error *err)
{
    const struct hg_view_params params = {.width = WIDTH,
        .height = HEIGHT,
        .samples = 16,
        .tonemap = HG_TONEMAP_LINEAR,
        .background = HG_BACKGROUND_NONE,
        .gi = gi};
    const enum hg_status status = hg_view_create(renderer, r->made.scene, out, err);
    if (status != HG_OK)
        return status;
    hg_view_set_formats(*out, 1u << HG_PIXEL_RGBA32F);
    return hg_view_set_params(*out, &params, err);
}

static enum hg_status settle(struct hg_renderer *renderer, struct rooms *r,
    const struct hg_bench_pose *pose, enum hg_view_gi gi, struct regions *out, struct hg_error *err)
{
    struct hg_view *view = NULL;
    struct hg_frame_info info = {0};
    enum hg_status status = open_view(renderer, r, gi, &view, err);
    if (status == HG_OK) {
        hg_view_set_final(view, true);
        status = look(view, pose, 0, err);
    }
    while (status == HG_OK && !info.settled)
        status = hg_view_step(view, 16, &info, err);
    if (status == HG_OK)
        status = read_regions(view, out, err);
    hg_view_destroy(view);
    return status;
}

static enum hg_status report(const struct hg_bench_settings *b, uint32_t done, struct hg_error *err)
{
    const uint32_t total = HG_BENCH_LEAKS + HG_BENCH_RESPONSES;
    return b->progress == NULL || b->progress(b->progress_user, done, total)
               ? HG_OK
               : hg_error_set(err, HG_E_CANCELLED, "bench", NULL, "cancelled");
}

// --- light through a wall ------------------------------------------------------------------------

static enum hg_status leak_in_motion(struct hg_view *view, const struct hg_bench_pose *pose,
    struct hg_bench_leak *out, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < BEFORE && status == HG_OK; i++) {
        struct regions now;
        status = draw(view, pose, i, &now, err);
        out->newest = status == HG_OK ? most_of(&now) : 0;
        out->motion = fmax(out->motion, out->newest);
    }
    return status;
}

static enum hg_status leak(
    struct hg_renderer *renderer, float wall_m, struct hg_bench_leak *out, struct hg_error *err)
{
    const struct hg_bench_pose bright = {{-3.6f, 1.5f, 0.2f}, {0, 1.5f, 0}};
    const struct hg_bench_pose dark = {{wall_m + 3.6f, 1.5f, 0.2f}, {wall_m, 1.5f, 0}};
    const struct plan plan = {.wall_m = wall_m};
    struct rooms r;
    struct hg_view *view = NULL; // as long as it is there the fields are
    struct regions light, probes, rays;
    *out = (struct hg_bench_leak){.wall_m = wall_m};
    enum hg_status status = make(&r, &plan, err);
    if (status == HG_OK)
        status = open_view(renderer, &r, HG_GI_PROBES, &view, err);
    if (status == HG_OK) // first: there is no settled field yet
        status = leak_in_motion(view, &dark, out, err);
    if (status == HG_OK)
        status = settle(renderer, &r, &bright, HG_GI_PROBES, &light, err);
    if (status == HG_OK)
        status = settle(renderer, &r, &dark, HG_GI_PROBES, &probes, err);
    if (status == HG_OK)
        status = settle(renderer, &r, &dark, HG_GI_RAYS, &rays, err);
    if (status == HG_OK) {
        const double all = mean_of(&light);
        out->probes = most_of(&probes) / all;
        out->rays = most_of(&rays) / all;
        out->motion /= all;
        out->newest /= all;
    }
    hg_view_destroy(view);
    hg_bench_scene_finish(&r.made);
    return status;
}

// --- responses -----------------------------------------------------------------------------------

enum change { LAMP_ON, LAMP_OFF, SUN_TURNED, DOOR_OPENED };

static void apply(struct rooms *r, enum change change)
{
    if (change == LAMP_ON || change == LAMP_OFF)
        set_lamp(r, change == LAMP_ON ? 20 : 0);
    else if (change == SUN_TURNED)
        turn_sun(r, 0.5235988f);
    else {
        r->door->translation[2] = 1.25f; // into the wall
        hg_scene_touch(r->made.scene, &r->door->head);
    }
    hg_scene_publish(r->made.scene);
}

static double share(const struct regions *now, const struct regions *from, const struct regions *to)
{
    return (mean_of(now) - mean_of(from)) / (mean_of(to) - mean_of(from));
}

static void judge(const struct regions pictures[AFTER], const struct regions *from,
    const struct regions *to, struct hg_bench_response *out)
{
    double left = 0, whole = 0;
    out->to_90 = out->to_99 = 1;
    for (uint32_t i = 0; i < AFTER; i++) {
        const double off = fabs(share(&pictures[i], from, to) - 1);
        out->to_90 = off > 0.1 ? i + 2 : out->to_90;
        out->to_99 = off > 0.01 ? i + 2 : out->to_99;
    }
    out->to_90 = out->to_90 > AFTER ? 0 : out->to_90;
    out->to_99 = out->to_99 > AFTER ? 0 : out->to_99;
    out->after_15 = share(&pictures[14], from, to);
    out->after_60 = share(&pictures[59], from, to);
    for (int i = 0; i < REGIONS; i++) {
        left += fabs(pictures[59].light[i] - to->light[i]);
        whole += fabs(from->light[i] - to->light[i]);
    }
    out->regions_60 = left / whole;
}

static enum hg_status follow(struct hg_renderer *renderer, struct rooms *r, enum change change,
    struct hg_bench_response *out, struct hg_error *err)
{
    const struct hg_bench_pose pose = {{3.9f, 1.5f, 1.2f}, {0.3f, 1.2f, -1.6f}};
    struct regions *after = hg_calloc(AFTER, sizeof *after), before, settled, end;
    struct hg_view *view = NULL;
    enum hg_status status = after != NULL
                                ? open_view(renderer, r, HG_GI_PROBES, &view, err)
                                : hg_error_set(err, HG_E_NOMEM, "bench", NULL, "no memory");
    for (uint32_t i = 0; i < BEFORE && status == HG_OK; i++)
        status = draw(view, &pose, i, &before, err);
    if (status == HG_OK)
        apply(r, change);
    for (uint32_t i = 0; i < AFTER && status == HG_OK; i++)
        status = draw(view, &pose, i, &after[i], err);
    // From now on pictures in motion have the settled field. Settled ones are no measure of where
    // light comes to: edges of what the sun lights fall between the centres of so few pixels.
    if (status == HG_OK)
        status = settle(renderer, r, &pose, HG_GI_PROBES, &settled, err);
    if (status == HG_OK)
        status = draw(view, &pose, AFTER, &end, err);
    if (status == HG_OK)
        judge(after, &before, &end, out);
    if (status == HG_OK)
        out->settled = mean_of(&end) > 0 ? mean_of(&settled) / mean_of(&end) : 1;
    hg_view_destroy(view);
    hg_free(after);
    return status;
}

static enum hg_status respond(struct hg_renderer *renderer, enum change change,
    struct hg_bench_response *out, struct hg_error *err)
{
    static const char *const names[HG_BENCH_RESPONSES] = {
        [LAMP_ON] = "lamp_on", "lamp_off", "sun_turned", "door_opened"};
    const struct plan plan = {.wall_m = 0.1f,
        .opening = true,
        .door = change == DOOR_OPENED,
        .window = change == SUN_TURNED};
    struct rooms r;
    out->name = names[change];
    enum hg_status status = make(&r, &plan, err);
    if (status == HG_OK && change == LAMP_ON)
        set_lamp(&r, 0);
    if (status == HG_OK) {
        hg_scene_publish(r.made.scene);
        status = follow(renderer, &r, change, out, err);
    }
    hg_bench_scene_finish(&r.made);
    return status;
}

enum hg_status hg_bench_gi_rooms_run(struct hg_renderer *renderer,
    const struct hg_bench_settings *bench, struct hg_bench_gi_rooms *out, struct hg_error *err)
{
    static const float walls_m[HG_BENCH_LEAKS] = {0.10f, 0.01f};
    enum hg_status status = HG_OK;
    *out = (struct hg_bench_gi_rooms){0};
    for (uint32_t i = 0; i < HG_BENCH_LEAKS && status == HG_OK; i++) {
        status = leak(renderer, walls_m[i], &out->leaks[i], err);
        if (status == HG_OK)
            status = report(bench, i + 1, err);
    }
    for (uint32_t i = 0; i < HG_BENCH_RESPONSES && status == HG_OK; i++) {
        status = respond(renderer, (enum change)i, &out->responses[i], err);
        if (status == HG_OK)
            status = report(bench, HG_BENCH_LEAKS + i + 1, err);
    }
    return status;
}
