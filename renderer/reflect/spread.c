// spread.c - see spread.h.
#include "renderer/reflect/spread.h"

#include "renderer/gi/words.h"

#define LEAST   1e-3f // weight of a block that is of the same surface by its distance alone
#define AT_ONCE 64    // blocks along a row; loops over them are vectorised

enum { NX, NY, NZ, PX, PY, PZ, ROUGHNESS, DEPTH, KNOWN, SURFACE_PLANES };
enum { RED = SURFACE_PLANES, GREEN, BLUE, OPEN, PLANES };
_Static_assert((int)PLANES == (int)HG_REFLECT_PLANES, "planes");

// Rough texels of one row, every second one, and what blocks have for them.
struct strip {
    float surface[SURFACE_PLANES][AT_ONCE];
    float sums[HG_REFLECT_WEIGHT + 1][AT_ONCE];
};

static size_t pitch_of(const struct hg_reflect *r)
{
    return (size_t)r->levels[HG_REFLECT_BLOCKS].image.columns + 2;
}

static float *plane_of(const struct hg_reflect *r, int plane)
{
    return r->planes + (size_t)plane * pitch_of(r) * (r->levels[HG_REFLECT_BLOCKS].image.rows + 2);
}

// Blocks as planes, with a border of unknown ones.
static void fill_row(void *user, size_t y)
{
    const struct hg_reflect_work *w = user;
    const struct hg_reflect_level *l = &w->r->levels[HG_REFLECT_BLOCKS];
    float *to[PLANES];
    for (int k = 0; k < PLANES; k++)
        to[k] = plane_of(w->r, k) + (y + 1) * pitch_of(w->r) + 1;
    for (uint32_t x = 0; x < l->image.columns; x++) {
        const struct hg_reflect_texel *t = &l->texels[y * l->image.columns + x];
        const hg_reflect_sums *s = &l->sums[y * l->image.columns + x];
        const bool known = t->mirrors && (*s)[HG_REFLECT_WEIGHT] > 0;
        const float scale = known ? 1 / (*s)[HG_REFLECT_WEIGHT] : 0;
        to[KNOWN][x] = known ? 1 : 0;
        for (int c = 0; c < 3 && known; c++) {
            to[NX + c][x] = t->normal[c];
            to[PX + c][x] = t->position[c];
            to[RED + c][x] = (*s)[HG_REFLECT_RED + c] * scale;
        }
        if (!known)
            continue;
        to[OPEN][x] = (*s)[HG_REFLECT_OPEN] * scale;
        to[ROUGHNESS][x] = t->roughness;
        to[DEPTH][x] = t->depth;
    }
}

static bool is_rough(const struct hg_reflect *r, size_t texel)
{
    return r->sources[texel] != HG_REFLECT_NOTHING &&
           !r->levels[HG_REFLECT_TEXELS].texels[texel].mirrors;
}

// Normals and positions of the texels (x + 2 k, y).
static void read_strip(
    const struct hg_reflect_work *w, uint32_t x, uint32_t y, uint32_t count, struct strip *s)
{
    const struct hg_gpu_camera *c = w->p->camera;
    const struct hg_reflect_image *image = &w->r->levels[HG_REFLECT_TEXELS].image;
    const float eye[3] = {c->eye_ws.x, c->eye_ws.y, c->eye_ws.z};
    const float ahead[3] = {c->forward_ws.x, c->forward_ws.y, c->forward_ws.z};
    const float origin[3] = {c->ray_origin_ws.x, c->ray_origin_ws.y, c->ray_origin_ws.z};
    const float right[3] = {c->ray_x_ws.x, c->ray_x_ws.y, c->ray_x_ws.z};
    const float down[3] = {c->ray_y_ws.x, c->ray_y_ws.y, c->ray_y_ws.z};
    const float py = fminf((float)(y * HG_PROBE_LIGHT_PX + 2), (float)(w->p->height - 1)) + 0.5f;
    const float most = (float)(w->p->width - 1);
    for (uint32_t k = 0; k < count; k++) {
        const size_t i = (size_t)y * image->columns + x + 2 * k;
        const uint32_t word = w->p->mirrors[2 * i];
        s->surface[NX][k] = (float)(int16_t)(word & 0xffff) / 32767;
        s->surface[NY][k] = (float)(int16_t)(word >> 16) / 32767;
        s->surface[ROUGHNESS][k] = image->texels[i].roughness;
        s->surface[DEPTH][k] = is_rough(w->r, i) ? image->texels[i].depth : 1;
    }
    for (uint32_t k = 0; k < count; k++) {
        const float u = s->surface[NX][k], v = s->surface[NY][k], z = 1 - fabsf(u) - fabsf(v);
        const float fold = z < 0 ? -z : 0;
        const float nx = u + (u >= 0 ? -fold : fold), ny = v + (v >= 0 ? -fold : fold);
        const float scale = 1 / sqrtf(nx * nx + ny * ny + z * z);
        s->surface[NX][k] = nx * scale;
        s->surface[NY][k] = ny * scale;
        s->surface[NZ][k] = z * scale;
    }
    for (int a = 0; a < 3; a++)
        for (uint32_t k = 0; k < count; k++) {
            const float middle = (float)((x + 2 * k) * HG_PROBE_LIGHT_PX + 2);
            const float px = (middle < most ? middle : most) + 0.5f;
            const float ray = origin[a] + px * right[a] + py * down[a], d = s->surface[DEPTH][k];
            s->surface[PX + a][k] = c->orthographic ? ray + ahead[a] * d : eye[a] + ray * d;
        }
}

// Adds one block to each texel, from[k] to texel k. part: by the distance on the screen.
static void add_blocks(
    const float *const from[PLANES], float part, uint32_t count, struct strip *restrict s)
{
    for (uint32_t k = 0; k < count; k++) {
        const float nx = s->surface[NX][k], ny = s->surface[NY][k], nz = s->surface[NZ][k];
        const float dx = from[PX][k] - s->surface[PX][k], dy = from[PY][k] - s->surface[PY][k],
                    dz = from[PZ][k] - s->surface[PZ][k];
        const float depth = s->surface[DEPTH][k];
        const float off = fabsf(dx * nx + dy * ny + dz * nz);
        const float cosine = from[NX][k] * nx + from[NY][k] * ny + from[NZ][k] * nz;
        const float rougher = fabsf(from[ROUGHNESS][k] - s->surface[ROUGHNESS][k]);
        const float same = hg_reflect_alike(cosine, off, HG_REFLECT_APART * depth, rougher);
        const float deep = fabsf(from[DEPTH][k] - depth) / depth;
        const float weight =
            part * from[KNOWN][k] * (same + LEAST * hg_reflect_fall(0, 0.1f, deep));
        s->sums[HG_REFLECT_RED][k] += weight * from[RED][k];
        s->sums[HG_REFLECT_GREEN][k] += weight * from[GREEN][k];
        s->sums[HG_REFLECT_BLUE][k] += weight * from[BLUE][k];
        s->sums[HG_REFLECT_OPEN][k] += weight * from[OPEN][k];
        s->sums[HG_REFLECT_WEIGHT][k] += weight;
    }
}

static void write_texel(const struct hg_reflect_work *w, size_t i, const float s[])
{
    const uint32_t *light = w->p->light + 4 * i;
    uint32_t *out = w->out + 4 * i;
    if (!(s[HG_REFLECT_WEIGHT] > 1e-6f))
        return;
    const float scale = 1 / s[HG_REFLECT_WEIGHT];
    const float open = hg_clampf(s[HG_REFLECT_OPEN] * scale, 0, 1);
    out[1] = hg_gi_rgb9e5(
        s[HG_REFLECT_RED] * scale, s[HG_REFLECT_GREEN] * scale, s[HG_REFLECT_BLUE] * scale);
    out[2] = (light[2] & 0xffffff) | (uint32_t)(open * 255 + 0.5f) << 24;
}

// Every second texel from x on, of the blocks from x / 2 on.
static void spread_strip(const struct hg_reflect_work *w, uint32_t x, uint32_t y, uint32_t count)
{
    const struct hg_reflect *r = w->r;
    const size_t pitch = pitch_of(r);
    struct strip s;
    read_strip(w, x, y, count, &s);
    memset(s.sums, 0, sizeof s.sums);
    for (uint32_t tap = 0; tap < 4; tap++) { // bilinear: a texel lies a quarter off its block
        const size_t column = 1 + x / 2 - ((x & 1) == 0) + (tap & 1);
        const size_t row = 1 + y / 2 - ((y & 1) == 0) + (tap >> 1);
        const float across = column == 1 + x / 2 ? 0.75f : 0.25f;
        const float down = row == 1 + y / 2 ? 0.75f : 0.25f;
        const float *from[PLANES];
        for (int k = 0; k < PLANES; k++)
            from[k] = plane_of(r, k) + row * pitch + column;
        add_blocks(from, across * down, count, &s);
    }
    for (uint32_t k = 0; k < count; k++) {
        const size_t i = (size_t)y * r->levels[HG_REFLECT_TEXELS].image.columns + x + 2 * k;
        float sums[HG_REFLECT_WEIGHT + 1];
        for (int c = 0; c <= HG_REFLECT_WEIGHT; c++)
            sums[c] = s.sums[c][k];
        if (is_rough(r, i))
            write_texel(w, i, sums);
    }
}

static void spread_row(void *user, size_t y)
{
    const struct hg_reflect_work *w = user;
    const struct hg_reflect_level *l = &w->r->levels[HG_REFLECT_TEXELS];
    const size_t first = y * l->image.columns;
    memcpy(w->out + 4 * first, w->p->light + 4 * first, (size_t)16 * l->image.columns);
    for (uint32_t x = 0; x < l->image.columns; x += 2 * AT_ONCE)
        for (uint32_t odd = x; odd < x + 2 && odd < l->image.columns; odd++) {
            const uint32_t left = (l->image.columns - odd + 1) / 2;
            spread_strip(w, odd, (uint32_t)y, left < AT_ONCE ? left : AT_ONCE);
        }
    for (uint32_t x = 0; x < l->image.columns; x++) {
        float sums[HG_REFLECT_WEIGHT + 1];
        if (!l->texels[first + x].mirrors)
            continue;
        memcpy(sums, &l->sums[first + x], sizeof sums);
        write_texel(w, first + x, sums);
    }
}

void hg_reflect_spread(struct hg_reflect_work *w)
{
    hg_jobs_for(w->r->jobs, w->r->levels[HG_REFLECT_BLOCKS].image.rows, fill_row, w);
    hg_jobs_for(w->r->jobs, w->r->levels[HG_REFLECT_TEXELS].image.rows, spread_row, w);
}
