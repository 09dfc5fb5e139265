// overlay.c - see overlay.h.
#include "renderer/frame/look/overlay.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/frame/look/caps.h"
#include "renderer/frame/view.h"
#include "shaders/shared/pick.h"

#define PART_PX    (1u << 18) // that are looked at at once
#define AT_REST    4          // samples of a pixel
#define OUTLINE_PX 2

struct overlay_key {
    uint64_t settings, camera, scene, geometry;
    uint32_t width, height, samples, reserved;
};

// RGBA8 of the whole picture: sRGB colour, coverage.
struct hg_overlay {
    struct overlay_key key;
    uint8_t *pixels;
    size_t capacity;
};

void hg_overlay_destroy(struct hg_overlay *o)
{
    if (o == NULL)
        return;
    hg_free(o->pixels);
    hg_free(o);
}

static bool has_caps(const struct hg_view_settings *s)
{
    return hg_look_clips(s->look) && s->look->clip.caps != HG_CAPS_NONE;
}

bool hg_overlay_is_wanted(const struct hg_view_state *view)
{
    const struct hg_view_settings *s = &view->settings;
    return s->look != NULL && s->debug == 0 && (has_caps(s) || s->look->selects);
}

static uint8_t encode(float linear)
{
    const float v =
        linear <= 0.0031308f ? 12.92f * linear : 1.055f * powf(linear, 1.0f / 2.4f) - 0.055f;
    return (uint8_t)(fminf(fmaxf(v, 0.0f), 1.0f) * 255.0f + 0.5f);
}

static float decode(uint8_t v)
{
    const float e = (float)v / 255.0f;
    return e <= 0.04045f ? e / 12.92f : powf((e + 0.055f) / 1.055f, 2.4f);
}

// --- caps ----------------------------------------------------------------------------------------

struct capping {
    struct hg_view_state *view;
    struct hg_overlay *overlay;
    struct hg_cap *caps; // of a part
    float *sums;         // [part px][4] linear, times coverage
    uint32_t samples;
};

static void add_caps(struct capping *c, const struct hg_draw *draw, VkRect2D part)
{
    const uint32_t area = part.extent.width * part.extent.height;
    for (uint32_t i = 0; i < area; i++) {
        float color[3];
        if (c->caps[i].draw_plus_one == 0)
            continue;
        hg_caps_color(draw, &c->caps[i], i % part.extent.width,
            (uint32_t)part.offset.y + i / part.extent.width, color);
        for (int k = 0; k < 3; k++)
            c->sums[i * 4 + k] += color[k];
        c->sums[i * 4 + 3] += 1.0f;
    }
}

static void store_caps(const struct capping *c, VkRect2D part)
{
    const uint32_t area = part.extent.width * part.extent.height;
    uint8_t *to = c->overlay->pixels + (size_t)part.offset.y * part.extent.width * 4;
    for (uint32_t i = 0; i < area; i++) {
        const float *sum = c->sums + (size_t)i * 4;
        for (int k = 0; k < 3 && sum[3] > 0.0f; k++)
            to[i * 4 + k] = encode(sum[k] / sum[3]);
        to[i * 4 + 3] = (uint8_t)(sum[3] / (float)c->samples * 255.0f + 0.5f);
    }
}

static enum hg_status cap_part(struct capping *c, VkRect2D part, struct hg_error *err)
{
    static const float at[AT_REST][2] = {
        {-0.125f, -0.375f}, {0.375f, -0.125f}, {-0.375f, 0.125f}, {0.125f, 0.375f}};
    struct hg_view_state *view = c->view;
    const uint32_t area = part.extent.width * part.extent.height;
    enum hg_status status = HG_OK;
    memset(c->sums, 0, area * 4 * sizeof *c->sums);
    for (uint32_t i = 0; i < c->samples && status == HG_OK; i++) {
        struct hg_draw_request request = {.settings = &view->settings,
            .camera = &view->camera,
            .flags = HG_DRAW_WAIT,
            .samples = view->settings.samples,
            .max_samples = 1,
            .error_px = view->accumulation.error_px,
            .moment = 1};
        if (c->samples > 1)
            memcpy(request.jitter_px, at[i], sizeof request.jitter_px);
        struct hg_draw draw = hg_view_draw(view, &request);
        draw.culling = view->buffers.pick_culling;
        status = hg_caps_find(&draw, part, c->caps, err);
        if (status == HG_OK)
            add_caps(c, &draw, part);
    }
    if (status == HG_OK)
        store_caps(c, part);
    return status;
}

static enum hg_status make_caps(
    struct hg_view_state *view, struct hg_overlay *o, struct hg_error *err)
{
    const uint32_t width = o->key.width, height = o->key.height;
    const uint32_t most = PART_PX / width > 0 ? PART_PX / width : 1;
    struct capping c = {.view = view, .overlay = o, .samples = o->key.samples};
    c.caps = hg_calloc((size_t)most * width, sizeof *c.caps);
    c.sums = hg_calloc((size_t)most * width, 4 * sizeof *c.sums);
    enum hg_status status = c.caps != NULL && c.sums != NULL
                                ? HG_OK
                                : hg_error_set(err, HG_E_NOMEM, "caps", NULL, "no memory");
    for (uint32_t y = 0; y < height && status == HG_OK; y += most) {
        const uint32_t rows = height - y < most ? height - y : most;
        status = cap_part(&c, (VkRect2D){{0, (int32_t)y}, {width, rows}}, err);
    }
    hg_free(c.caps);
    hg_free(c.sums);
    return status;
}

// --- outlines ------------------------------------------------------------------------------------

struct marking {
    const struct hg_look *look;
    uint8_t *marks; // [height][width] 1: something that is selected
    uint32_t width;
};

static void mark_row(void *user, uint32_t y, const struct hg_gpu_pick *pixels)
{
    const struct marking *m = user;
    for (uint32_t x = 0; x < m->width; x++) {
        const uint32_t draw = pixels[x].draw_plus_one;
        m->marks[(size_t)y * m->width + x] =
            draw > 0 && draw <= m->look->tables.draw_count && m->look->selected[draw - 1] != 0;
    }
}

static bool is_near(const struct marking *m, uint32_t height, uint32_t x, uint32_t y)
{
    for (int dy = -OUTLINE_PX; dy <= OUTLINE_PX; dy++)
        for (int dx = -OUTLINE_PX; dx <= OUTLINE_PX; dx++) {
            const int64_t nx = (int64_t)x + dx, ny = (int64_t)y + dy;
            if (dx * dx + dy * dy <= OUTLINE_PX * OUTLINE_PX && nx >= 0 && ny >= 0 &&
                nx < m->width && ny < height && m->marks[(size_t)ny * m->width + (size_t)nx])
                return true;
        }
    return false;
}

static void draw_outline(const struct marking *m, struct hg_overlay *o)
{
    uint8_t color[4] = {0, 0, 0, 255};
    for (int i = 0; i < 3; i++)
        color[i] = encode(m->look->select_color[i]);
    for (uint32_t y = 0; y < o->key.height; y++)
        for (uint32_t x = 0; x < o->key.width; x++) {
            const size_t at = (size_t)y * o->key.width + x;
            if (!m->marks[at] && is_near(m, o->key.height, x, y))
                memcpy(o->pixels + at * 4, color, sizeof color);
        }
}

static enum hg_status make_outline(
    struct hg_view_state *view, struct hg_overlay *o, struct hg_error *err)
{
    struct marking m = {.look = view->settings.look, .width = o->key.width};
    m.marks = hg_calloc((size_t)o->key.width, o->key.height);
    if (m.marks == NULL)
        return hg_error_set(err, HG_E_NOMEM, "outline", NULL, "no memory");
    const VkRect2D all = {{0, 0}, {o->key.width, o->key.height}};
    const enum hg_status status = hg_view_state_surfaces(view, all, mark_row, &m, err);
    if (status == HG_OK)
        draw_outline(&m, o);
    hg_free(m.marks);
    return status;
}

// --- all of it -----------------------------------------------------------------------------------

// Settled pictures always have the samples of a view at rest.
static struct overlay_key key_of(const struct hg_view_state *view)
{
    const struct hg_view_settings *s = &view->settings;
    const bool rests = view->accumulation.samples > 1 || s->samples == 1 || view->final;
    return (struct overlay_key){.settings = view->settings_revision,
        .camera = view->camera_revision,
        .scene = view->accumulation.key.scene,
        .geometry = view->scene_gpu->geometry_revision,
        .width = s->width,
        .height = s->height,
        .samples = rests ? AT_REST : 1};
}

static enum hg_status make(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_look *look = view->settings.look;
    const struct overlay_key key = key_of(view);
    if (look->overlay == NULL)
        look->overlay = hg_calloc(1, sizeof *look->overlay);
    struct hg_overlay *o = look->overlay;
    if (o != NULL && o->pixels != NULL && memcmp(&o->key, &key, sizeof key) == 0)
        return HG_OK;
    const size_t bytes = (size_t)key.width * key.height * 4;
    if (o == NULL || hg_grow(&o->pixels, &o->capacity, bytes, 1) != HG_OK)
        return hg_error_set(err, HG_E_NOMEM, "overlay", NULL, "no memory");
    memset(o->pixels, 0, bytes);
    o->key = key;
    enum hg_status status = has_caps(&view->settings) ? make_caps(view, o, err) : HG_OK;
    if (status == HG_OK && look->selects)
        status = make_outline(view, o, err);
    if (status != HG_OK)
        o->key = (struct overlay_key){0};
    return status;
}

static void blend8(uint8_t *p, const uint8_t *over)
{
    const uint32_t a = over[3];
    for (int i = 0; i < 3; i++)
        p[i] = (uint8_t)((p[i] * (255 - a) + over[i] * a + 127) / 255);
    p[3] = (uint8_t)(p[3] + (255 - p[3]) * a / 255);
}

static void blend16(uint8_t *at, const uint8_t *over)
{
    uint16_t p[4];
    const uint32_t a = over[3];
    memcpy(p, at, sizeof p);
    for (int i = 0; i < 3; i++)
        p[i] = (uint16_t)((p[i] * (255 - a) + over[i] * 257u * a + 127) / 255);
    p[3] = (uint16_t)(p[3] + (65535u - p[3]) * a / 255);
    memcpy(at, p, sizeof p);
}

static void blend32(uint8_t *at, const uint8_t *over)
{
    float p[4];
    const float a = (float)over[3] / 255.0f;
    memcpy(p, at, sizeof p);
    for (int i = 0; i < 3; i++)
        p[i] += (decode(over[i]) - p[i]) * a;
    p[3] += (1.0f - p[3]) * a;
    memcpy(at, p, sizeof p);
}

enum hg_status hg_overlay_apply(
    struct hg_view_state *view, uint32_t format, uint8_t *pixels, struct hg_error *err)
{
    static void (*const blends[3])(uint8_t *, const uint8_t *) = {blend8, blend16, blend32};
    static const uint32_t bytes[3] = {4, 8, 16};
    const struct hg_picture_region r = hg_view_region(&view->settings);
    const enum hg_status status = make(view, err);
    if (status != HG_OK)
        return status;
    const struct hg_overlay *o = view->settings.look->overlay;
    for (uint32_t y = 0; y < r.height; y++)
        for (uint32_t x = 0; x < r.width; x++) {
            const uint8_t *over = o->pixels + ((size_t)(r.y + y) * o->key.width + r.x + x) * 4;
            if (over[3] > 0)
                blends[format](pixels + ((size_t)y * r.width + x) * bytes[format], over);
        }
    return HG_OK;
}
