#include "renderer/scene/demo/demo.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/demo/demo_build.h"
#include "renderer/scene/xform.h"

// A terrace above a valley, an hour before sunset: an arcade on two sides, a round pool in the
// middle with a heliograph (a mirror in turning rings) on a pedestal, plinths with spheres of
// metal and glaze around it. +Y up, metres; the camera looks from the open corner.

static const float sun_direction[3] = {-0.70f, 0.46f, 0.54f}; // towards the sun

enum material {
    FLOOR,
    MARBLE,
    PLASTER,
    CLOTH,
    BRASS,
    WATER,
    GLAZE,
    WOOD,
    GOLD,
    COPPER,
    MIRROR,
    CELADON,
    TERRACOTTA,
    IRON,
    GLOW,
    HILLS,
    LEAF,
    MATERIALS
};

struct terrace {
    struct hg_demo d;
    struct hg_material *m[MATERIALS];
    struct hg_animation *turning;
};

static void make_materials(struct terrace *t)
{
    static const struct hg_demo_material table[MATERIALS] = {
        [FLOOR] = {"tiles", {1, 1, 1}, 0, 1, HG_DEMO_TILES, 2.4f, 1.0f},
        [MARBLE] = {"marble", {1, 1, 1}, 0, 1, HG_DEMO_MARBLE, 1.7f, 0.6f},
        [PLASTER] = {"plaster", {1, 1, 1}, 0, 1, HG_DEMO_PLASTER, 2.6f, 0.35f},
        [CLOTH] = {"cloth", {1, 1, 1}, 0, 1, HG_DEMO_CLOTH, 0.32f, 1.0f},
        [BRASS] = {"brass", {1, 1, 1}, 1, 1, HG_DEMO_BRASS, 0.4f, 0.5f},
        [WATER] = {"water", {1, 1, 1}, 0, 1, HG_DEMO_WATER, 2.0f, 1.0f},
        [GLAZE] = {"glaze", {1, 1, 1}, 0, 1, HG_DEMO_GLAZE, 1.0f, 0.8f},
        [WOOD] = {"oak", {1, 1, 1}, 0, 1, HG_DEMO_WOOD, 0.8f, 1.0f},
        [GOLD] = {"gold", {1.0f, 0.77f, 0.34f}, 1, 0.16f, -1, 1, 1},
        [COPPER] = {"copper", {0.95f, 0.64f, 0.54f}, 1, 0.34f, -1, 1, 1},
        [MIRROR] = {"mirror", {0.97f, 0.96f, 0.92f}, 1, 0.02f, -1, 1, 1},
        [CELADON] = {"celadon", {0.33f, 0.55f, 0.45f}, 0, 0.10f, -1, 1, 1},
        [TERRACOTTA] = {"terracotta", {0.56f, 0.22f, 0.12f}, 0, 0.82f, -1, 1, 1},
        [IRON] = {"iron", {0.05f, 0.05f, 0.055f}, 1, 0.5f, -1, 1, 1},
        [GLOW] = {"lantern glass", {1.0f, 0.86f, 0.62f}, 0, 0.3f, -1, 1, 1},
        [HILLS] = {"hills", {0.085f, 0.10f, 0.055f}, 0, 0.95f, -1, 1, 1},
        [LEAF] = {"leaves", {0.045f, 0.085f, 0.03f}, 0, 0.75f, -1, 1, 1},
    };
    for (int i = 0; i < MATERIALS; i++)
        t->m[i] = hg_demo_material(&t->d, &table[i]);
    if (t->d.status)
        return;
    static const float warm[3] = {5.5f, 2.9f, 1.05f};
    memcpy(t->m[GLOW]->emissive, warm, sizeof warm);
    t->m[CLOTH]->double_sided = true;
    t->m[GLAZE]->clearcoat.factor = t->m[CELADON]->clearcoat.factor = 1;
    t->m[GLAZE]->clearcoat.roughness = t->m[CELADON]->clearcoat.roughness = 0.04f;
    t->m[WATER]->ior = 1.33f;
    t->m[WATER]->has_ior = true;
    for (int i = 0; i < 3; i++)
        t->m[CLOTH]->sheen.color[i] = 0.25f;
    t->m[CLOTH]->sheen.roughness = 0.5f;
}

static void lathe(
    struct hg_shape *shape, const float (*profile)[2], uint32_t count, uint32_t segments)
{
    hg_shape_add_lathe(
        shape, &(struct hg_lathe){.profile = profile, .count = count, .segments = segments});
}

static const float at_origin[3];

static void place(
    struct terrace *t, const char *name, struct hg_mesh *mesh, const float at[3], float yaw_deg)
{
    (void)hg_demo_node(&t->d, NULL, name, mesh, at, yaw_deg);
}

// ---- ground, pool, valley ----------------------------------------------------------------------

static const float pool_radius = 1.9f, half_terrace = 6.5f;

// Between the pool's rim and the square edge of the terrace.
static void floor_surface(const void *user, float s, float t, float position[3], float uv[2])
{
    (void)user;
    float angle = -s * 2 * (float)M_PI, c = cosf(angle), n = sinf(angle);
    float edge = half_terrace / fmaxf(fabsf(c), fabsf(n));
    float r = pool_radius + (edge - pool_radius) * t;
    position[0] = r * n;
    position[1] = 0;
    position[2] = r * c;
    uv[0] = position[0];
    uv[1] = position[2];
}

// Ridges that rise around the valley, lower where the sun stands.
static void hill_surface(const void *user, float s, float t, float position[3], float uv[2])
{
    (void)user;
    float angle = -s * 2 * (float)M_PI, r = 14 + 900 * t * t;
    float ridge = 0.5f + 0.26f * sinf(5 * angle + 1.0f) + 0.16f * sinf(11 * angle + 2.3f) +
                  0.10f * sinf(23 * angle + 0.7f) + 0.05f * sinf(47 * angle);
    float rise = t < 0.25f ? 0 : (t - 0.25f) / 0.75f;
    float roll = 3.0f * sinf(r * 0.05f + 3 * angle) * t;
    position[0] = r * sinf(angle);
    position[1] = -9 + roll + 95 * rise * rise * ridge;
    position[2] = r * cosf(angle);
    uv[0] = position[0];
    uv[1] = position[2];
}

static void make_ground(struct terrace *t)
{
    struct hg_shape floor = {0}, rim = {0}, water = {0}, hills = {0}, base = {0};
    hg_shape_add_grid(&floor, 96, 6, floor_surface, NULL);
    place(t, "floor", hg_demo_mesh(&t->d, "floor", &floor, t->m[FLOOR]), at_origin, 0);
    static const float rim_profile[][2] = {{2.02f, -0.01f}, {2.02f, 0.09f}, {2.02f, 0.09f},
        {2.00f, 0.115f}, {1.97f, 0.125f}, {1.97f, 0.125f}, {1.66f, 0.125f}, {1.66f, 0.125f},
        {1.635f, 0.115f}, {1.625f, 0.09f}, {1.625f, 0.09f}, {1.625f, -0.30f}};
    lathe(&rim, rim_profile, 12, 96);
    place(t, "rim", hg_demo_mesh(&t->d, "rim", &rim, t->m[MARBLE]), at_origin, 0);
    static const float water_profile[][2] = {{1.63f, 0}, {0.8f, 0}, {0.02f, 0}};
    lathe(&water, water_profile, 3, 64);
    for (uint32_t v = 0; v < water.vertex_count; v++) { // planar UVs: no swirl in the ripples
        water.uv[v * 2] = water.positions[v * 3];
        water.uv[v * 2 + 1] = water.positions[v * 3 + 2];
    }
    place(
        t, "water", hg_demo_mesh(&t->d, "water", &water, t->m[WATER]), (float[3]){0, 0.045f, 0}, 0);
    const float slab_center[3] = {0, -0.31f, 0};
    const float slab[3] = {2 * half_terrace + 0.3f, 0.6f, 2 * half_terrace + 0.3f};
    hg_shape_add_box(&base, slab_center, slab, 0.04f);
    place(t, "terrace", hg_demo_mesh(&t->d, "terrace", &base, t->m[MARBLE]), at_origin, 0);
    hg_shape_add_grid(&hills, 160, 36, hill_surface, NULL);
    place(t, "hills", hg_demo_mesh(&t->d, "hills", &hills, t->m[HILLS]), at_origin, 0);
}

// ---- arcade ------------------------------------------------------------------------------------

static const float bay = 2.6f, spring = 2.35f, arcade_top = 4.0f;

static struct hg_mesh *make_column(struct terrace *t)
{
    struct hg_shape s = {0};
    static const float shaft[][2] = {
        {0.205f, 0.22f}, {0.203f, 0.8f}, {0.195f, 1.4f}, {0.175f, 2.02f}};
    static const float foot[][2] = {{0.275f, 0.08f}, {0.285f, 0.105f}, {0.275f, 0.13f},
        {0.275f, 0.13f}, {0.235f, 0.135f}, {0.225f, 0.155f}, {0.232f, 0.17f}, {0.232f, 0.17f},
        {0.24f, 0.18f}, {0.245f, 0.195f}, {0.235f, 0.21f}, {0.21f, 0.222f}};
    static const float head[][2] = {{0.172f, 2.01f}, {0.195f, 2.025f}, {0.195f, 2.05f},
        {0.178f, 2.06f}, {0.178f, 2.06f}, {0.178f, 2.12f}, {0.178f, 2.12f}, {0.20f, 2.15f},
        {0.25f, 2.20f}, {0.265f, 2.24f}};
    hg_shape_add_lathe(&s,
        &(struct hg_lathe){
            .profile = shaft, .count = 4, .segments = 120, .flutes = 20, .flute_depth = 0.055f});
    lathe(&s, foot, 12, 48);
    lathe(&s, head, 10, 48);
    const float plinth[3] = {0, 0.04f, 0}, plinth_size[3] = {0.62f, 0.09f, 0.62f};
    const float abacus[3] = {0, 2.295f, 0}, abacus_size[3] = {0.6f, 0.11f, 0.6f};
    hg_shape_add_box(&s, plinth, plinth_size, 0.012f);
    hg_shape_add_box(&s, abacus, abacus_size, 0.015f);
    return hg_demo_mesh(&t->d, "column", &s, t->m[MARBLE]);
}

static struct hg_mesh *make_cornice(struct terrace *t, float length)
{
    struct hg_shape s = {0};
    static const float steps[][3] = {
        {4.06f, 0.14f, 0.60f}, {4.19f, 0.12f, 0.72f}, {4.32f, 0.14f, 0.90f}, {4.43f, 0.08f, 1.0f}};
    for (int i = 0; i < 4; i++) {
        const float center[3] = {0, steps[i][0], 0};
        const float size[3] = {length + steps[i][2], steps[i][1], steps[i][2]};
        hg_shape_add_box(&s, center, size, 0.02f);
    }
    return hg_demo_mesh(&t->d, "cornice", &s, t->m[MARBLE]);
}

static void make_arcade(struct terrace *t)
{
    struct hg_shape arch = {0}, wall = {0};
    hg_shape_add_arch(&arch, &(struct hg_arch){.bay = bay,
                                 .radius = bay / 2 - 0.26f,
                                 .spring = spring,
                                 .top = arcade_top,
                                 .depth = 0.46f,
                                 .band = 0.09f});
    struct hg_mesh *column = make_column(t);
    struct hg_mesh *bay_mesh = hg_demo_mesh(&t->d, "arch", &arch, t->m[PLASTER]);
    struct hg_mesh *cornice = make_cornice(t, bay * 4);
    for (int i = 0; i < 4; i++) {
        float along = ((float)i - 1.5f) * bay;
        place(t, "arch", bay_mesh, (float[3]){along, 0, -bay * 2}, 0);
        place(t, "arch", bay_mesh, (float[3]){-bay * 2, 0, along}, 90);
        place(t, "column", column, (float[3]){((float)i - 1) * bay, 0, -bay * 2}, 0);
        place(t, "column", column, (float[3]){-bay * 2, 0, ((float)i - 1) * bay}, 0);
    }
    place(t, "column", column, (float[3]){-bay * 2, 0, -bay * 2}, 0);
    place(t, "cornice", cornice, (float[3]){0, 0, -bay * 2}, 0);
    place(t, "cornice", cornice, (float[3]){-bay * 2, 0, 0}, 90);
    // Behind the back arcade a passage with a wall and a timber ceiling.
    const float wall_center[3] = {0, 2.0f, -6.55f}, wall_size[3] = {13.2f, 4.1f, 0.3f};
    hg_shape_add_box(&wall, wall_center, wall_size, 0.02f);
    place(t, "wall", hg_demo_mesh(&t->d, "wall", &wall, t->m[PLASTER]), at_origin, 0);
    struct hg_shape ceiling = {0};
    const float ceiling_center[3] = {0, 4.06f, -5.95f}, ceiling_size[3] = {13.0f, 0.1f, 1.4f};
    hg_shape_add_box(&ceiling, ceiling_center, ceiling_size, 0.01f);
    place(t, "ceiling", hg_demo_mesh(&t->d, "ceiling", &ceiling, t->m[WOOD]), at_origin, 0);
}

static void make_balustrade(struct terrace *t)
{
    struct hg_shape s = {0}, rail = {0};
    static const float baluster[][2] = {{0.075f, 0.10f}, {0.075f, 0.14f}, {0.075f, 0.14f},
        {0.045f, 0.16f}, {0.06f, 0.24f}, {0.085f, 0.34f}, {0.07f, 0.46f}, {0.04f, 0.60f},
        {0.038f, 0.66f}, {0.06f, 0.70f}, {0.06f, 0.70f}, {0.075f, 0.72f}, {0.075f, 0.76f}};
    lathe(&s, baluster, 13, 24);
    struct hg_mesh *mesh = hg_demo_mesh(&t->d, "baluster", &s, t->m[MARBLE]);
    for (int i = 0; i < 30; i++)
        place(t, "baluster", mesh, (float[3]){6.2f, 0, -5.6f + (float)i * 0.4f}, 0);
    const float low[3] = {0, 0.05f, 0}, low_size[3] = {0.30f, 0.11f, 12.6f};
    const float top[3] = {0, 0.82f, 0}, top_size[3] = {0.32f, 0.13f, 12.6f};
    hg_shape_add_box(&rail, low, low_size, 0.02f);
    hg_shape_add_box(&rail, top, top_size, 0.04f);
    place(
        t, "rail", hg_demo_mesh(&t->d, "rail", &rail, t->m[MARBLE]), (float[3]){6.2f, 0, 0.2f}, 0);
}

// ---- the heliograph ----------------------------------------------------------------------------

static struct hg_mesh *make_ring(
    struct terrace *t, const char *name, float radius, float tube, enum material material)
{
    struct hg_shape s = {0};
    const float center[3] = {0, 0, 0};
    hg_shape_add_torus(&s, center, radius, tube, 96);
    for (int i = 0; i < 2; i++) { // bearings
        const float at[3] = {i ? radius : -radius, 0, 0};
        hg_shape_add_sphere(&s, at, tube * 1.9f, 20);
    }
    return hg_demo_mesh(&t->d, name, &s, t->m[material]);
}

static struct hg_mesh *make_mirror(struct terrace *t, struct hg_mesh **frame)
{
    struct hg_shape disc = {0}, rim = {0};
    static const float face[][2] = {{0.205f, 0.012f}, {0.1f, 0.007f}, {0.001f, 0.005f}};
    static const float back[][2] = {{0.001f, -0.035f}, {0.12f, -0.03f}, {0.21f, -0.012f},
        {0.21f, -0.012f}, {0.235f, -0.01f}, {0.24f, 0.005f}, {0.225f, 0.022f}, {0.204f, 0.012f}};
    lathe(&disc, face, 3, 64);
    lathe(&rim, back, 8, 64);
    *frame = hg_demo_mesh(&t->d, "mirror frame", &rim, t->m[BRASS]);
    return hg_demo_mesh(&t->d, "mirror", &disc, t->m[MIRROR]);
}

static void make_pedestal(struct terrace *t)
{
    struct hg_shape s = {0};
    static const float profile[][2] = {{0.52f, -0.2f}, {0.52f, 0.14f}, {0.52f, 0.14f},
        {0.50f, 0.16f}, {0.50f, 0.16f}, {0.42f, 0.16f}, {0.42f, 0.16f}, {0.40f, 0.20f},
        {0.30f, 0.27f}, {0.245f, 0.40f}, {0.23f, 0.70f}, {0.255f, 0.86f}, {0.33f, 0.93f},
        {0.33f, 0.93f}, {0.37f, 0.94f}, {0.375f, 0.97f}, {0.36f, 1.0f}, {0.36f, 1.0f},
        {0.01f, 1.0f}};
    lathe(&s, profile, 19, 64);
    place(t, "pedestal", hg_demo_mesh(&t->d, "pedestal", &s, t->m[MARBLE]), at_origin, 0);
    struct hg_shape stand = {0};
    static const float foot[][2] = {{0.24f, 1.0f}, {0.24f, 1.02f}, {0.24f, 1.02f}, {0.18f, 1.04f},
        {0.06f, 1.07f}, {0.035f, 1.12f}, {0.032f, 1.20f}, {0.05f, 1.235f}, {0.02f, 1.27f}};
    lathe(&stand, foot, 9, 48);
    place(t, "stand", hg_demo_mesh(&t->d, "stand", &stand, t->m[BRASS]), at_origin, 0);
}

static void make_planet(struct terrace *t, struct hg_node *parent, float orbit, float radius,
    enum material material, float period_s)
{
    static const float up[3] = {0, 1, 0};
    struct hg_shape arm = {0}, ball = {0};
    const float origin[3] = {0, 0, 0}, end[3] = {orbit, 0, 0};
    const float tip[3] = {orbit, 0.09f, 0};
    hg_shape_add_rod(&arm, origin, end, 0.008f);
    hg_shape_add_rod(&arm, end, tip, 0.008f);
    hg_shape_add_sphere(&ball, tip, radius, 32);
    const float place_at[3] = {0, 0, 0};
    struct hg_node *node = hg_demo_node(&t->d, parent, "planet arm",
        hg_demo_mesh(&t->d, "arm", &arm, t->m[BRASS]), place_at, period_s * 47);
    (void)hg_demo_node(
        &t->d, node, "planet", hg_demo_mesh(&t->d, "planet", &ball, t->m[material]), place_at, 0);
    hg_demo_spin(&t->d, t->turning, node, up, period_s, 24);
}

static void tilt(struct hg_node *node, float x_deg, float z_deg)
{
    if (!node)
        return;
    float a = x_deg * (float)M_PI / 360, b = z_deg * (float)M_PI / 360;
    node->rotation[0] = sinf(a) * cosf(b);
    node->rotation[1] = -sinf(a) * sinf(b);
    node->rotation[2] = cosf(a) * sinf(b);
    node->rotation[3] = cosf(a) * cosf(b);
}

static void make_heliograph(struct terrace *t)
{
    static const float x[3] = {1, 0, 0}, y[3] = {0, 1, 0}, z[3] = {0, 0, 1};
    const float origin[3] = {0, 0, 0}, middle[3] = {0, 1.86f, 0};
    make_pedestal(t);
    struct hg_node *base = hg_demo_node(&t->d, NULL, "heliograph", NULL, middle, 0);
    struct hg_node *outer = hg_demo_node(&t->d, base, "meridian ring",
        make_ring(t, "meridian ring", 0.60f, 0.020f, BRASS), origin, 0);
    tilt(outer, 90, 0);
    hg_demo_spin(&t->d, t->turning, outer, z, 24, 24);
    struct hg_node *middle_ring = hg_demo_node(&t->d, outer, "equator ring",
        make_ring(t, "equator ring", 0.53f, 0.016f, BRASS), origin, 0);
    tilt(middle_ring, 66, 0);
    hg_demo_spin(&t->d, t->turning, middle_ring, x, 12, 24);
    struct hg_node *inner = hg_demo_node(&t->d, middle_ring, "ecliptic ring",
        make_ring(t, "ecliptic ring", 0.46f, 0.013f, GOLD), origin, 0);
    tilt(inner, 0, 52);
    hg_demo_spin(&t->d, t->turning, inner, x, 8, 24);
    struct hg_mesh *frame = NULL, *disc = make_mirror(t, &frame);
    struct hg_node *mirror = hg_demo_node(&t->d, base, "mirror", disc, origin, 0);
    (void)hg_demo_node(&t->d, mirror, "mirror frame", frame, origin, 0);
    tilt(mirror, 62, 14);
    hg_demo_spin(&t->d, t->turning, mirror, y, 24, 24);
    const float deck[3] = {0, 1.16f, 0};
    struct hg_node *orrery = hg_demo_node(&t->d, NULL, "orrery", NULL, deck, 0);
    make_planet(t, orrery, 0.33f, 0.035f, COPPER, 4);
    make_planet(t, orrery, 0.50f, 0.05f, CELADON, 6);
    make_planet(t, orrery, 0.70f, 0.065f, GOLD, 12);
}

// ---- what stands around ------------------------------------------------------------------------

static void make_plinths(struct terrace *t)
{
    static const struct {
        enum material material;
        float angle_deg, radius;
    } balls[] = {{GLAZE, 8, 0.31f}, {GOLD, 44, 0.27f}, {CELADON, 82, 0.31f}, {COPPER, 262, 0.27f},
        {TERRACOTTA, 222, 0.31f}, {MIRROR, 300, 0.29f}};
    struct hg_shape s = {0};
    static const float boxes[][4] = {
        {0.05f, 0.1f, 0.64f, 0.015f}, {0.37f, 0.56f, 0.50f, 0.012f}, {0.69f, 0.09f, 0.62f, 0.02f}};
    for (int i = 0; i < 3; i++) {
        const float center[3] = {0, boxes[i][0], 0};
        const float size[3] = {boxes[i][2], boxes[i][1], boxes[i][2]};
        hg_shape_add_box(&s, center, size, boxes[i][3]);
    }
    struct hg_mesh *plinth = hg_demo_mesh(&t->d, "plinth", &s, t->m[MARBLE]);
    for (size_t i = 0; i < sizeof balls / sizeof *balls; i++) {
        float a = balls[i].angle_deg * (float)M_PI / 180;
        float px = 3.35f * sinf(a), pz = 3.35f * cosf(a);
        struct hg_shape ball = {0};
        const float center[3] = {0, 0, 0};
        hg_shape_add_sphere(&ball, center, balls[i].radius, 64);
        place(t, "plinth", plinth, (float[3]){px, 0, pz}, balls[i].angle_deg);
        place(t, "sphere", hg_demo_mesh(&t->d, "sphere", &ball, t->m[balls[i].material]),
            (float[3]){px, 0.735f + balls[i].radius, pz}, balls[i].angle_deg);
    }
}

// A cloth over a bench: flat on top, hanging at both ends, with folds that open downwards.
static void cloth_surface(const void *user, float s, float t, float position[3], float uv[2])
{
    (void)user;
    const float half_top = 0.62f, drop = 0.36f, bend = 0.03f, width = 0.50f;
    float length = 2 * (half_top + drop), along = (s - 0.5f) * length, side = along < 0 ? -1 : 1;
    float d = fabsf(along), down = d > half_top ? d - half_top : 0;
    float wave = sinf(t * 19 + side * 1.3f) * 0.022f * (down / drop) + sinf(t * 7 + s * 5) * 0.004f;
    float corner = down < bend ? down / bend : 1;
    position[0] = side * (fminf(d, half_top) + 0.022f * corner + wave);
    position[1] = 0.512f - (down > bend ? down - bend * 0.5f : down * corner * 0.5f) +
                  (down > 0 ? 0 : 0.003f * sinf(t * 9 + s * 23));
    position[2] = -(t - 0.5f) * width * (1 + 0.1f * down);
    uv[0] = along;
    uv[1] = t * width;
}

static void make_bench(struct terrace *t)
{
    struct hg_shape bench = {0}, cloth = {0}, pot = {0};
    static const float boxes[][6] = {{0, 0.46f, 0, 1.24f, 0.09f, 0.46f},
        {-0.46f, 0.21f, 0, 0.12f, 0.42f, 0.36f}, {0.46f, 0.21f, 0, 0.12f, 0.42f, 0.36f}};
    for (int i = 0; i < 3; i++)
        hg_shape_add_box(&bench, boxes[i], boxes[i] + 3, 0.015f);
    hg_shape_add_grid(&cloth, 96, 48, cloth_surface, NULL);
    static const float jug[][2] = {{0.07f, 0}, {0.075f, 0.012f}, {0.12f, 0.08f}, {0.135f, 0.15f},
        {0.10f, 0.23f}, {0.05f, 0.29f}, {0.045f, 0.33f}, {0.065f, 0.37f}, {0.065f, 0.37f},
        {0.055f, 0.37f}, {0.035f, 0.32f}};
    lathe(&pot, jug, 11, 48);
    place(t, "bench", hg_demo_mesh(&t->d, "bench", &bench, t->m[MARBLE]),
        (float[3]){1.35f, 0, 4.6f}, 24);
    place(t, "cloth", hg_demo_mesh(&t->d, "cloth", &cloth, t->m[CLOTH]), (float[3]){1.35f, 0, 4.6f},
        24);
    place(t, "jug", hg_demo_mesh(&t->d, "jug", &pot, t->m[CELADON]),
        (float[3]){1.62f, 0.512f, 4.5f}, 0);
}

// A clipped cypress: a flame of overlapping lobes.
static void cypress_surface(const void *user, float s, float t, float position[3], float uv[2])
{
    (void)user;
    float angle = s * 2 * (float)M_PI, y = 1 - t;
    float body = 0.34f * powf(y < 0 ? 0 : y, 0.62f) * powf(fmaxf(1 - y * 0.985f, 0), 0.28f) * 1.5f;
    float lobes = 1 + 0.09f * sinf(9 * angle + 31 * y) + 0.05f * sinf(17 * angle - 53 * y) +
                  0.04f * sinf(29 * angle + 97 * y);
    position[0] = body * lobes * sinf(angle);
    position[1] = 0.45f + 2.1f * t;
    position[2] = body * lobes * cosf(angle);
    uv[0] = s;
    uv[1] = t;
}

static void make_pots(struct terrace *t)
{
    struct hg_shape pot = {0}, tree = {0};
    static const float profile[][2] = {{0.20f, 0}, {0.215f, 0.02f}, {0.27f, 0.2f}, {0.31f, 0.38f},
        {0.31f, 0.38f}, {0.345f, 0.385f}, {0.35f, 0.43f}, {0.335f, 0.46f}, {0.30f, 0.455f},
        {0.28f, 0.40f}, {0.01f, 0.40f}};
    lathe(&pot, profile, 11, 48);
    hg_shape_add_grid(&tree, 96, 72, cypress_surface, NULL);
    struct hg_mesh *pot_mesh = hg_demo_mesh(&t->d, "pot", &pot, t->m[TERRACOTTA]);
    struct hg_mesh *tree_mesh = hg_demo_mesh(&t->d, "cypress", &tree, t->m[LEAF]);
    static const float places[][2] = {{-1.3f, -4.55f}, {1.3f, -4.55f}, {5.5f, -4.3f}, {5.5f, 1.0f}};
    for (int i = 0; i < 4; i++) {
        place(t, "pot", pot_mesh, (float[3]){places[i][0], 0, places[i][1]}, (float)i * 70);
        place(t, "cypress", tree_mesh, (float[3]){places[i][0], 0, places[i][1]}, (float)i * 110);
    }
}

// ---- lights and cameras ------------------------------------------------------------------------

static struct hg_light *add_light(
    struct terrace *t, const char *name, const float color[3], float intensity)
{
    struct hg_light *light = t->d.status ? NULL : hg_asset_add_light(t->d.asset, name);
    if (!light) {
        t->d.status = t->d.status ? t->d.status : HG_E_NOMEM;
        return NULL;
    }
    memcpy(light->color, color, sizeof light->color);
    light->intensity = intensity;
    return light;
}

static void make_lanterns(struct terrace *t)
{
    struct hg_shape frame = {0}, glass = {0};
    static const float cap[][2] = {{0.13f, 0.15f}, {0.10f, 0.19f}, {0.04f, 0.24f}, {0.015f, 0.28f}};
    static const float dish[][2] = {{0.02f, -0.19f}, {0.07f, -0.17f}, {0.11f, -0.14f}};
    static const float body[][2] = {
        {0.07f, -0.14f}, {0.095f, -0.08f}, {0.10f, 0}, {0.095f, 0.08f}, {0.07f, 0.15f}};
    lathe(&frame, cap, 4, 32);
    lathe(&frame, dish, 3, 32);
    for (int i = 0; i < 6; i++) {
        float a = (float)i * (float)M_PI / 3;
        const float low[3] = {0.108f * sinf(a), -0.14f, 0.108f * cosf(a)};
        const float high[3] = {0.108f * sinf(a), 0.16f, 0.108f * cosf(a)};
        hg_shape_add_rod(&frame, low, high, 0.006f);
    }
    const float hook[3] = {0, 0.27f, 0}, beam[3] = {0, 0.9f, 0};
    hg_shape_add_rod(&frame, hook, beam, 0.006f);
    lathe(&glass, body, 5, 32);
    struct hg_mesh *frame_mesh = hg_demo_mesh(&t->d, "lantern", &frame, t->m[IRON]);
    struct hg_mesh *glass_mesh = hg_demo_mesh(&t->d, "lantern glass", &glass, t->m[GLOW]);
    static const float warm[3] = {1.0f, 0.60f, 0.27f};
    struct hg_light *flame = add_light(t, "lantern", warm, 3.2f);
    if (flame) {
        flame->kind = HG_LIGHT_POINT;
        flame->range = 9;
        flame->casts_shadow = false; // its own glass surrounds it
    }
    for (int i = 0; i < 4; i++) {
        const float at[3] = {((float)i - 1.5f) * bay, 3.05f, -5.75f}, origin[3] = {0, 0, 0};
        struct hg_node *lantern = hg_demo_node(&t->d, NULL, "lantern", frame_mesh, at, 0);
        struct hg_node *bulb = hg_demo_node(&t->d, lantern, "flame", glass_mesh, origin, 0);
        if (bulb)
            bulb->light = flame;
    }
}

static void make_lights(struct terrace *t)
{
    static const float gold[3] = {1.0f, 0.78f, 0.53f}, origin[3] = {0, 0, 0};
    static const float amber[3] = {1.0f, 0.72f, 0.42f};
    struct hg_node *sun = hg_demo_node(&t->d, NULL, "sun", NULL, sun_direction, 0);
    hg_demo_aim(sun, origin);
    struct hg_light *light = add_light(t, "sun", gold, 4.2f);
    if (sun)
        sun->light = light;
    const float spot_at[3] = {-3.4f, 3.9f, -3.4f}, mirror_at[3] = {0, 1.6f, 0};
    struct hg_node *spot = hg_demo_node(&t->d, NULL, "spot", NULL, spot_at, 0);
    hg_demo_aim(spot, mirror_at);
    struct hg_light *beam = add_light(t, "spot", amber, 26);
    if (spot && beam) {
        beam->kind = HG_LIGHT_SPOT;
        beam->range = 14;
        beam->inner_cone_rad = 0.16f;
        beam->outer_cone_rad = 0.34f;
        spot->light = beam;
    }
}

static void add_camera(
    struct terrace *t, const char *name, const float eye[3], const float target[3], float vfov_deg)
{
    struct hg_node *node = hg_demo_node(&t->d, NULL, name, NULL, eye, 0);
    struct hg_camera *camera = node ? hg_asset_add_camera(t->d.asset, name) : NULL;
    if (!camera) {
        t->d.status = t->d.status ? t->d.status : HG_E_NOMEM;
        return;
    }
    camera->vfov_rad = vfov_deg * (float)M_PI / 180;
    camera->near = 0.05f;
    node->camera = camera;
    hg_demo_aim(node, target);
}

static void make_cameras(struct terrace *t)
{
    static const float eye[3] = {4.75f, 1.75f, 6.9f}, target[3] = {-0.55f, 1.42f, -0.6f};
    static const float near_eye[3] = {1.55f, 1.95f, 2.0f}, near_target[3] = {0, 1.72f, 0};
    add_camera(t, "terrace", eye, target, 40);
    add_camera(t, "heliograph", near_eye, near_target, 38);
}

void hg_demo_environment(struct hg_environment *environment)
{
    environment->kind = HG_ENV_SKY;
    memcpy(environment->sun_direction, sun_direction, sizeof sun_direction);
    hg_normalize3(environment->sun_direction);
    environment->turbidity = 1.2f;
    environment->intensity = 1;
}

// ---- all of it ---------------------------------------------------------------------------------

static void collect_roots(struct hg_demo *d)
{
    d->asset->roots = hg_calloc(d->asset->node_count, sizeof *d->asset->roots);
    if (!d->asset->roots) {
        d->status = HG_E_NOMEM;
        return;
    }
    for (uint32_t i = 0; i < d->asset->node_count; i++)
        if (!d->asset->nodes[i]->parent)
            d->asset->roots[d->asset->root_count++] = d->asset->nodes[i];
}

static void make_animation(struct terrace *t)
{
    struct hg_asset *asset = t->d.asset;
    asset->animations = hg_calloc(1, sizeof *asset->animations);
    if (asset->animations) {
        t->turning = asset->animations;
        asset->animation_count = 1;
        t->turning->name = hg_strdup("turning");
        t->turning->channels = hg_calloc(16, sizeof *t->turning->channels);
        t->turning->duration_s = 24;
    }
    if (!t->turning || !t->turning->name || !t->turning->channels)
        t->d.status = HG_E_NOMEM;
}

enum hg_status hg_demo_create(
    uint32_t number, struct hg_jobs *jobs, struct hg_asset **out, struct hg_error *err)
{
    *out = NULL;
    struct terrace t = {.d = {.jobs = jobs, .asset = hg_asset_create(number, "demo:")}};
    if (!t.d.asset)
        return hg_error_set(err, HG_E_NOMEM, "demo:", NULL, "no memory");
    snprintf(t.d.asset->file.format, sizeof t.d.asset->file.format, "demo");
    snprintf(t.d.asset->file.generator, sizeof t.d.asset->file.generator, "Heliograph");
    static void (*const steps[])(struct terrace *) = {make_animation, make_materials, make_ground,
        make_arcade, make_balustrade, make_heliograph, make_plinths, make_bench, make_pots,
        make_lanterns, make_lights, make_cameras};
    hg_demo_draw_sets(&t.d);
    for (size_t i = 0; !t.d.status && i < sizeof steps / sizeof *steps; i++)
        steps[i](&t);
    if (!t.d.status)
        collect_roots(&t.d);
    if (t.d.status) {
        hg_asset_destroy(t.d.asset);
        return hg_error_set(err, t.d.status, "demo:", NULL, "no memory for the demo scene");
    }
    *out = t.d.asset;
    return HG_OK;
}
