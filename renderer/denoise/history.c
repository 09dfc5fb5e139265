#include "renderer/denoise/history.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/vec3d.h"
#include "renderer/denoise/history_state.h"

#define NORMAL_LEAST 0.9f   // cosine between normals of the same surface
#define DEPTH_REACH  0.02f  // difference of depths of the same place, relative
#define CHANGE_REACH 2.0f   // standard deviations of a patch that are no change
#define IMAGE_REACH  0.1f   // the same of an image
#define LEAST_NEARER 0.25   // how far mirrors may magnify: 1 / this
#define STILL_PX     0.02   // px that count as none
#define ALBEDO_REACH 4.0f   // standard deviations of an albedo that are no change
#define PATCH        3      // px: radius of what is compared
#define BAND         64u    // rows that are looked up together

// Temporary planes while a picture is filtered.
#define OWN_PLANES (HG_DN_KINDS * 2 + HG_DN_LOBES * 2 + 1)

// --- cameras ------------------------------------------------------------------------------------

static void place_of(
    const struct hg_denoise_camera *c, double x, double y, double depth, double out[3])
{
    for (int i = 0; i < 3; i++) {
        const double across = c->across[i] + x * c->x[i] + y * c->y[i];
        out[i] = c->orthographic ? across + depth * c->forward[i] : c->eye[i] + depth * across;
    }
}

// Pixel coordinates and depth of a point; false: behind the camera.
static bool find(
    const struct hg_denoise_camera *c, const double place[3], double *x, double *y, double *depth)
{
    double d[3];
    for (int i = 0; i < 3; i++)
        d[i] = place[i] - (c->orthographic ? c->across[i] : c->eye[i]);
    *depth = hg_dot3d(d, c->forward);
    if (!c->orthographic) {
        if (!(*depth > 1e-9))
            return false;
        for (int i = 0; i < 3; i++)
            d[i] = d[i] / *depth - c->across[i];
    }
    *x = hg_dot3d(d, c->x) / hg_dot3d(c->x, c->x);
    *y = hg_dot3d(d, c->y) / hg_dot3d(c->y, c->y);
    return true;
}

// --- keeping -------------------------------------------------------------------------------------

enum hg_status hg_dn_history_begin(struct hg_denoise *d, const struct hg_denoise_input *input)
{
    const size_t pixels = (size_t)input->width * input->height;
    enum hg_status status = hg_dn_past_init(&d->now, input->width, input->height);
    hg_free(d->own);
    d->own = status == HG_OK ? hg_calloc(OWN_PLANES * pixels, sizeof(float)) : NULL;
    if (d->own == NULL) {
        hg_dn_past_finish(&d->now);
        return HG_E_NOMEM;
    }
    float *at = d->own;
    for (int k = 0; k < HG_DN_KINDS; k++, at += 2 * pixels) {
        d->own_luma[k] = at;
        d->own_variance[k] = at + pixels;
    }
    for (int l = 0; l < HG_DN_LOBES; l++, at += 2 * pixels) {
        d->tone_var[l] = at;
        d->slope[l] = at + pixels;
    }
    d->nearer = at;
    d->now.camera = input->camera;
    return HG_OK;
}

struct keep {
    struct hg_denoise *d;
    const struct hg_dn_planes *p;
    const struct hg_dn_rect *rect;
    const struct hg_dn_clean *clean;
};

static float slope_of(const struct hg_dn_face *face, size_t at)
{
    const float both = fabsf(face->disparity_dx[at]) + fabsf(face->disparity_dy[at]);
    return face->disparity[at] > 0.0f ? both / face->disparity[at] : 0.0f;
}

static void place_at(const struct keep *k, uint32_t x, uint32_t y, size_t at, double out[3])
{
    const double depth = 1.0 / (double)k->p->face[HG_DN_SCATTERS].disparity[at];
    place_of(&k->d->now.camera, x + 0.5, y + 0.5, depth, out);
}

// Curvature of the surface at a pixel along rows (step 1) or columns, 1 / m; > 0: convex.
static double curvature(const struct keep *k, uint32_t x, uint32_t y, size_t at, bool columns)
{
    const struct hg_dn_planes *p = k->p;
    const uint32_t dx = columns ? 0 : 1, dy = columns ? 1 : 0;
    const size_t step = columns ? p->stride : 1;
    double a[3], b[3], along = 0.0, length2 = 0.0;
    if (!(p->seen[at - step] > 0.0f && p->seen[at + step] > 0.0f))
        return 0.0;
    place_at(k, x - dx, y - dy, at - step, a);
    place_at(k, x + dx, y + dy, at + step, b);
    for (int c = 0; c < 3; c++) {
        const float *normal = p->face[HG_DN_SCATTERS].normal[c];
        along += (b[c] - a[c]) * (double)(normal[at + step] - normal[at - step]);
        length2 += (b[c] - a[c]) * (b[c] - a[c]);
    }
    return length2 > 0.0 ? along / length2 : 0.0;
}

// Depth of the virtual image in a smooth surface: in a plane mirror as far behind it as the object
// is in front, in a convex one nearer (mirror equation). 0: the surface is rough, or there is no
// virtual image.
static float image_disparity(
    const struct keep *k, uint32_t x, uint32_t y, size_t at, float *out_nearer)
{
    const struct hg_dn_face *first = &k->p->face[HG_DN_SCATTERS],
                            *seen = &k->p->face[HG_DN_MIRRORS];
    float own = 0.0f, all = 0.0f;
    for (int c = 0; c < 3; c++) {
        own += seen->normal[c][at] * seen->normal[c][at];
        all += first->normal[c][at] * first->normal[c][at];
    }
    if (!(first->disparity[at] > seen->disparity[at]) || 4.0f * own > all)
        return 0.0f;
    double a[3], b[3], metres = 0.0;
    const double depth = 1.0 / (double)first->disparity[at];
    const double behind = 1.0 / (double)seen->disparity[at] - depth;
    place_of(&k->d->now.camera, x + 0.5, y + 0.5, depth, a);
    place_of(&k->d->now.camera, x + 0.5, y + 0.5, depth + behind, b);
    for (int c = 0; c < 3; c++)
        metres += (b[c] - a[c]) * (b[c] - a[c]);
    const double bend = curvature(k, x, y, at, false) + curvature(k, x, y, at, true); // 2 / radius
    const double nearer = 1.0 + bend * sqrt(metres);
    *out_nearer = (float)nearer;
    return nearer > LEAST_NEARER ? (float)(1.0 / (depth + behind / nearer)) : 0.0f;
}

static void keep_pixel(const struct keep *k, uint32_t x, uint32_t y, size_t at, size_t to)
{
    const struct hg_dn_planes *p = k->p;
    const struct hg_dn_face *face = &p->face[HG_DN_SCATTERS];
    struct hg_denoise *d = k->d;
    struct hg_dn_past *now = &d->now;
    for (int i = 0; i < HG_DN_KINDS; i++) {
        for (int c = 0; c < 3; c++)
            now->rgb[i][c][to] = k->clean->rgb[i][c][at];
        now->variance[i][to] = k->clean->variance[i][at];
    }
    for (int l = 0; l < HG_DN_LOBES; l++) {
        for (int c = 0; c < 3; c++)
            now->albedo[l][c][to] = p->face[l].albedo[c][at];
        d->tone_var[l][to] = p->face[l].tone_var[at];
    }
    for (int c = 0; c < 3; c++)
        now->normal[c][to] = face->normal[c][at];
    now->disparity[to] = face->disparity[at];
    now->image[to] = image_disparity(k, x, y, at, &d->nearer[to]);
    now->seen[to] = p->seen[at];
    for (int l = 0; l < HG_DN_LOBES; l++)
        d->slope[l][to] = slope_of(&p->face[l], at);
}

static void keep_row(void *user, size_t row)
{
    const struct keep *k = user;
    const uint32_t y = k->rect->y + (uint32_t)row;
    for (uint32_t x = k->rect->x; x < k->rect->x + k->rect->width; x++)
        keep_pixel(
            k, x, y, hg_dn_at(k->p, x - k->p->x, y - k->p->y), (size_t)y * k->d->now.width + x);
}

void hg_dn_history_keep(struct hg_denoise *d, const struct hg_dn_planes *p,
    const struct hg_dn_rect *rect, const struct hg_dn_clean *clean, struct hg_jobs *jobs)
{
    struct keep keep = {d, p, rect, clean};
    hg_jobs_for(jobs, rect->height, keep_row, &keep);
}

// --- where it was --------------------------------------------------------------------------------

struct work {
    struct hg_denoise *d;
    const struct hg_denoise_input *input;
    const struct hg_dn_energy *energy;
    const struct hg_dn_past *before;
    struct hg_dn_past *now;
    float *out;
    // Of before, where the pixels of now were, in a band of rows of now from `first` on.
    uint32_t first, skip; // skip: rows of the band before those that are blended
    float *rgb[HG_DN_KINDS][3], *variance[HG_DN_KINDS], *length[HG_DN_KINDS], *trust[HG_DN_KINDS];
    float *still; // lobes of which a pixel showed the same then, to a part of a pixel
    float *memory;
};

static size_t band_at(const struct work *w, uint32_t x, uint32_t y)
{
    return (size_t)(y - w->first) * w->now->width + x;
}

// Kinds of light that are reprojected together.
struct kinds {
    int first, last;
};
static const struct kinds all_kinds = {0, HG_DN_KINDS - 1}, scattered = {0, HG_DN_INDIRECT},
                          mirrored = {HG_DN_SPECULAR, HG_DN_SPECULAR};

// At object edges, the first hit of a pixel does not represent its other samples.
static bool is_inside(const struct hg_dn_past *now, uint32_t x, uint32_t y)
{
    const float id = now->id[(size_t)y * now->width + x];
    for (uint32_t j = y > 0 ? y - 1 : 0; j <= y + 1 && j < now->height; j++) {
        for (uint32_t i = x > 0 ? x - 1 : 0; i <= x + 1 && i < now->width; i++) {
            if (now->id[(size_t)j * now->width + i] != id)
                return false;
        }
    }
    return true;
}

// The same surface; for specular light also the same virtual image.
static bool is_same(const struct work *w, size_t at, size_t old, double depth, bool image)
{
    const struct hg_dn_past *now = w->now, *past = w->before;
    const double there = (double)(image ? past->image : past->disparity)[old] * depth; // 1: so deep
    const float reach = (image ? IMAGE_REACH : DEPTH_REACH) + 2.0f * w->d->slope[image][at];
    float cosine = 0.0f, length = 0.0f, length_old = 0.0f;
    for (int c = 0; c < 3; c++) {
        cosine += now->normal[c][at] * past->normal[c][old];
        length += now->normal[c][at] * now->normal[c][at];
        length_old += past->normal[c][old] * past->normal[c][old];
    }
    return past->seen[old] > 0.0f && cosine > NORMAL_LEAST * sqrtf(length * length_old) &&
           fabs(there - 1.0) < (double)reach;
}

static void take(struct work *w, const struct kinds *kinds, size_t to, size_t old, float weight)
{
    for (int k = kinds->first; k <= kinds->last; k++) {
        for (int c = 0; c < 3; c++)
            w->rgb[k][c][to] += weight * w->before->rgb[k][c][old];
        w->variance[k][to] += weight * w->before->variance[k][old];
        w->length[k][to] += weight * w->before->length[k][old];
    }
}

static void scale(struct work *w, const struct kinds *kinds, size_t to, float factor)
{
    for (int k = kinds->first; k <= kinds->last; k++) {
        for (int c = 0; c < 3; c++)
            w->rgb[k][c][to] *= factor;
        w->variance[k][to] *= factor;
        w->length[k][to] *= factor;
    }
}

// Mean of three channels of what moved over so many samples, added to a place; false: none has.
static bool move(
    const struct work *w, size_t at, size_t channel, double samples, double scale, double place[3])
{
    const struct hg_denoise_input *in = w->input;
    const size_t pixels = (size_t)in->width * in->height;
    bool moves = false;
    for (size_t i = 0; i < 3 && in->moved != NULL && samples > 0.0; i++) {
        const float by = in->moved[(channel + i) * pixels + at];
        place[i] += scale * (double)by / samples;
        moves = moves || by != 0.0f;
    }
    return moves;
}

// Previous position of the virtual image in a pixel's surface.
static bool move_image(const struct work *w, size_t at, double place[3])
{
    const struct hg_denoise_input *in = w->input;
    const size_t pixels = (size_t)in->width * in->height;
    const float samples =
        in->sums[HG_PATH_GUIDE_SEEN * pixels + at] - in->sums[HG_PATH_GUIDE_SEEN_OWN * pixels + at];
    const double scale = 1.0 / fmax((double)w->d->nearer[at], LEAST_NEARER);
    return move(w, at, HG_PATH_MOVED_SEEN, (double)samples, scale, place);
}

// The surface has not moved: edge pixels are noisy and may be averaged including albedo; specular
// light only if the reflected objects have not moved either.
static bool take_still(
    struct work *w, uint32_t column, uint32_t row, double x, double y, bool image_moves)
{
    const struct hg_dn_past *past = w->before;
    const size_t to = band_at(w, column, row), old = (size_t)row * past->width + column;
    if (!(fabs(x - column) < STILL_PX && fabs(y - row) < STILL_PX) || column >= past->width ||
        row >= past->height)
        return false;
    if (!(past->seen[old] > 0.0f))
        return false;
    take(w, image_moves ? &scattered : &all_kinds, to, old, 1.0f);
    w->still[to] = image_moves ? 1.0f : HG_DN_LOBES;
    return true;
}

// Previous position of a pixel's surface, or of the virtual image in it.
struct place {
    double x, y, depth; // px in the picture before; of the middle of its pixel (0, 0) 0
    bool image;
};

// Bilinear lookup among the four previous pixels that pass the surface test; false: none does.
static bool take_around(struct work *w, const struct kinds *kinds, uint32_t column, uint32_t row,
    const struct place *there)
{
    const struct hg_dn_past *past = w->before;
    const size_t at = (size_t)row * w->now->width + column, to = band_at(w, column, row);
    const int x0 = (int)floor(there->x), y0 = (int)floor(there->y);
    const bool inside = w->input->moved != NULL && is_inside(w->now, column, row);
    float sum = 0.0f;
    for (int i = 0; i < 4; i++) {
        const int px = x0 + i % 2, py = y0 + i / 2;
        const float weight = (float)((1.0 - fabs(there->x - px)) * (1.0 - fabs(there->y - py)));
        if (px < 0 || py < 0 || px >= (int)past->width || py >= (int)past->height)
            continue;
        const size_t old = (size_t)py * past->width + (size_t)px;
        if ((inside && past->id[old] != w->now->id[at]) ||
            !is_same(w, at, old, there->depth, there->image))
            continue;
        take(w, kinds, to, old, weight);
        sum += weight;
    }
    scale(w, kinds, to, sum > 0.1f ? 1.0f / sum : 0.0f);
    return sum > 0.1f;
}

// Reprojection into the previous picture; false: outside.
static bool project(const struct work *w, const double place[3], struct place *out)
{
    const struct hg_dn_past *past = w->before;
    if (!find(&past->camera, place, &out->x, &out->y, &out->depth))
        return false;
    out->x -= 0.5;
    out->y -= 0.5;
    return out->x > -1.0 && out->y > -1.0 && out->x < past->width && out->y < past->height;
}

// Reprojects specular light of a smooth surface by its virtual image.
static bool take_image(struct work *w, uint32_t column, uint32_t row, const double image[3])
{
    struct place there = {.image = true};
    const bool any = w->now->image[(size_t)row * w->now->width + column] > 0.0f;
    return any && project(w, image, &there) && take_around(w, &mirrored, column, row, &there);
}

static void find_pixel(struct work *w, uint32_t column, uint32_t row)
{
    const struct hg_dn_past *now = w->now;
    const size_t at = (size_t)row * now->width + column;
    const double hits = (double)now->seen[at] * hg_dn_samples(w->input, column, row);
    const double x = column + 0.5, y = row + 0.5;
    struct place there = {0};
    double place[3], image[3] = {0};
    bool image_moves = false;
    if (!(now->seen[at] > 0.0f) || !(now->disparity[at] > 0.0f))
        return;
    place_of(&now->camera, x, y, 1.0 / (double)now->disparity[at], place);
    const bool moves = move(w, at, HG_PATH_MOVED_BY, hits, 1.0, place);
    if (now->image[at] > 0.0f) {
        place_of(&now->camera, x, y, 1.0 / (double)now->image[at], image);
        image_moves = move_image(w, at, image);
    }
    const bool found = project(w, place, &there),
               still = found && !moves && w->input->moved != NULL;
    if (still && take_still(w, column, row, there.x, there.y, image_moves)) {
        if (image_moves)
            (void)take_image(w, column, row, image);
        return;
    }
    const bool taken = take_image(w, column, row, image);
    if (found)
        take_around(w, taken ? &scattered : &all_kinds, column, row, &there);
}

static void find_row(void *user, size_t index)
{
    struct work *w = user;
    for (uint32_t column = 0; column < w->now->width; column++)
        find_pixel(w, column, w->first + (uint32_t)index);
}

// --- how much it counts --------------------------------------------------------------------------

static float luma_at(float *const rgb[3], size_t at)
{
    return hg_dn_luma(rgb[0][at], rgb[1][at], rgb[2][at]);
}

// 1 where the patch means of both pictures agree within their noise, falling to 0 where not.
static float trust(const struct work *w, int kind, uint32_t x, uint32_t y)
{
    float difference = 0.0f, variance = 0.0f, brightness = 0.0f, count = 0.0f;
    for (int dy = -PATCH; dy <= PATCH; dy++) {
        for (int dx = -PATCH; dx <= PATCH; dx++) {
            const int64_t i = (int64_t)x + dx, j = (int64_t)y + dy;
            if (i < 0 || j < 0 || i >= w->now->width || j >= w->now->height)
                continue;
            const size_t q = band_at(w, (uint32_t)i, (uint32_t)j);
            if (!(w->length[kind][q] > 0.0f))
                continue;
            const size_t own = (size_t)j * w->now->width + (size_t)i;
            const float now = w->d->own_luma[kind][own], then = luma_at(w->rgb[kind], q);
            difference += now - then;
            variance += w->d->own_variance[kind][own] + w->variance[kind][q];
            brightness += now + then;
            count += 1.0f;
        }
    }
    if (count == 0.0f)
        return 0.0f;
    // Noise that is left is alike over many pixels: the patch is not much better than one of them.
    const float off = difference * difference / (count * count);
    const float least = 1e-6f * brightness * brightness / (count * count) + 1e-20f;
    const float t = off / (CHANGE_REACH * CHANGE_REACH * variance / count + least) - 1.0f;
    return t <= 0.0f ? 1.0f : t >= 3.0f ? 0.0f : 1.0f - t / 3.0f;
}

static void trust_row(void *user, size_t index)
{
    struct work *w = user;
    const uint32_t y = w->first + w->skip + (uint32_t)index;
    for (uint32_t x = 0; x < w->now->width; x++) {
        const size_t at = band_at(w, x, y);
        for (int k = 0; k < HG_DN_KINDS; k++)
            w->trust[k][at] = w->length[k][at] > 0.0f ? trust(w, k, x, y) : 0.0f;
    }
}

// Rounds mantissas, so that saved histories are small; applied whether or not it is saved, so that
// results are identical.
static float trim(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits = (bits & 0x7f800000u) == 0x7f800000u ? bits : (bits + 0x200u) & ~0x3ffu;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static void blend(struct work *w, int k, size_t at, size_t from)
{
    struct hg_dn_past *now = w->now;
    const float length = w->length[k][from] * w->trust[k][from];
    const float old = length / (length + 1.0f), own = 1.0f - old;
    for (int c = 0; c < 3; c++)
        now->rgb[k][c][at] = own * now->rgb[k][c][at] + old * w->rgb[k][c][from];
    now->variance[k][at] = own * own * now->variance[k][at] + old * old * w->variance[k][from];
    now->length[k][at] = fminf(length + 1.0f, HG_DN_MOST_HISTORY);
}

// Albedos at the edges of what stands still, which are noisy as well: the old one of the same pixel
// counts where both agree in all colours, which textures that move in a mirror do not.
static void blend_albedo(const struct work *w, size_t at, int lobes)
{
    struct hg_dn_past *now = w->now;
    for (int l = 0; l < lobes; l++) {
        const int kind = l == HG_DN_SCATTERS ? HG_DN_INDIRECT : HG_DN_SPECULAR;
        const float reach = ALBEDO_REACH * ALBEDO_REACH * w->d->tone_var[l][at];
        float off = 0.0f;
        for (int c = 0; c < 3; c++) {
            const float d = now->albedo[l][c][at] - w->before->albedo[l][c][at];
            off += d * d / 3.0f;
        }
        const float length = off < reach ? now->length[kind][at] - 1.0f : 0.0f;
        const float old = length / (length + 1.0f);
        for (int c = 0; c < 3; c++)
            now->albedo[l][c][at] =
                (1.0f - old) * now->albedo[l][c][at] + old * w->before->albedo[l][c][at];
    }
}

static void blend_row(void *user, size_t index)
{
    struct work *w = user;
    struct hg_dn_past *now = w->now;
    const uint32_t y = w->first + w->skip + (uint32_t)index;
    const size_t pixels = (size_t)now->width * now->height;
    for (uint32_t x = 0; x < now->width; x++) {
        const size_t at = (size_t)y * now->width + x, from = band_at(w, x, y);
        for (int k = 0; k < HG_DN_KINDS; k++)
            blend(w, k, at, from);
        if (w->still[from] > 0.0f)
            blend_albedo(w, at, (int)w->still[from]);
        for (size_t i = 0; i < HG_DENOISE_LIGHT; i++)
            w->out[i * pixels + at] =
                now->rgb[i / 3][i % 3][at] * now->albedo[hg_dn_lobe((int)i / 3)][i % 3][at];
        for (size_t i = 0; i < HG_DN_KEPT; i++)
            now->memory[i * pixels + at] = trim(now->memory[i * pixels + at]);
    }
}

// --- all -----------------------------------------------------------------------------------------

// Restores energy, and stores the unblended picture for comparison before blending.
static void own_row(void *user, size_t y)
{
    struct work *w = user;
    struct hg_dn_past *now = w->now;
    const size_t pixels = (size_t)now->width * now->height;
    for (uint32_t x = 0; x < now->width; x++) {
        const size_t at = y * now->width + x;
        for (int k = 0; k < HG_DN_KINDS; k++) {
            const float factor = hg_dn_energy_at(w->energy, k, x, (uint32_t)y);
            for (int c = 0; c < 3; c++)
                now->rgb[k][c][at] *= factor;
            now->variance[k][at] *= factor * factor;
            w->d->own_luma[k][at] = luma_at(now->rgb[k], at);
            w->d->own_variance[k][at] = now->variance[k][at];
        }
        now->id[at] = w->input->moved != NULL ? w->input->moved[3 * pixels + at] : 0.0f;
    }
}

static enum hg_status make_work(struct work *w)
{
    const uint32_t rows = BAND + 2 * PATCH;
    const size_t count = (size_t)(rows < w->now->height ? rows : w->now->height) * w->now->width;
    w->memory = hg_calloc((HG_DN_KINDS * 6 + 1) * count, sizeof(float));
    if (w->memory == NULL)
        return HG_E_NOMEM;
    float *at = w->memory;
    w->still = at;
    at += count;
    for (int k = 0; k < HG_DN_KINDS; k++) {
        float **single[] = {&w->rgb[k][0], &w->rgb[k][1], &w->rgb[k][2], &w->variance[k],
            &w->length[k], &w->trust[k]};
        for (size_t i = 0; i < sizeof single / sizeof *single; i++, at += count)
            *single[i] = at;
    }
    return HG_OK;
}

// Rows y0 to y1 of the picture; those around them are looked up for their patches.
static void blend_band(struct work *w, struct hg_jobs *jobs, uint32_t y0, uint32_t y1)
{
    const uint32_t width = w->now->width, height = w->now->height;
    const uint32_t first = y0 > PATCH ? y0 - PATCH : 0;
    const uint32_t end = y1 + PATCH < height ? y1 + PATCH : height;
    w->first = first;
    w->skip = y0 - first;
    memset(w->memory, 0,
        (HG_DN_KINDS * 6 + 1) * sizeof(float) * width *
            (size_t)(BAND + 2 * PATCH < height ? BAND + 2 * PATCH : height));
    if (w->before->width > 0)
        hg_jobs_for(jobs, end - first, find_row, w);
    if (w->before->width > 0)
        hg_jobs_for(jobs, y1 - y0, trust_row, w);
    hg_jobs_for(jobs, y1 - y0, blend_row, w);
}

enum hg_status hg_dn_history_blend(struct hg_denoise *d, struct hg_jobs *jobs,
    const struct hg_denoise_input *input, const struct hg_dn_energy *energy, float *out)
{
    struct work w = {
        .d = d, .input = input, .energy = energy, .before = &d->before, .now = &d->now, .out = out};
    enum hg_status status = make_work(&w);
    if (status == HG_OK) {
        hg_jobs_for(jobs, input->height, own_row, &w);
        for (uint32_t y = 0; y < input->height; y += BAND)
            blend_band(&w, jobs, y, input->height - y < BAND ? input->height : y + BAND);
    }
    hg_free(w.memory);
    hg_free(d->own);
    d->own = NULL;
    return status;
}
