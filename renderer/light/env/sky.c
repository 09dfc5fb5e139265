#include "renderer/light/env/sky.h"

#include "base/alloc.h"
#include "renderer/math/vec.h"

// Kilometres; coefficients per kilometre at sea level (Hillaire 2020, table 1).
#define GROUND_KM     6360.0f
#define TOP_KM        6460.0f
#define EYE_KM        0.05f
#define MIE_G         0.8f
#define GROUND_ALBEDO 0.3f
#define SUN_RADIUS    0.004675f // radians

static const float rayleigh_scattering[3] = {5.802e-3f, 13.558e-3f, 33.1e-3f};
static const float ozone_absorption[3] = {0.650e-3f, 1.881e-3f, 0.085e-3f};
#define MIE_ALBEDO 0.9f // scattering over extinction, Bruneton 2017
// Haze is bluer than white: extinction falls with the wavelength to the power of 1.3 (Angstrom
// 1929; Preetham 1999, appendix A.1), here at 680, 550 and 440 nm over that at 550 nm.
static const float haze_spectrum[3] = {0.7590f, 1.0f, 1.3365f};
#define RAYLEIGH_KM 8.0f // scale heights
#define MIE_KM      1.2f

#define TABLE_X 64 // cosine of the sun's zenith angle
#define TABLE_Y 32 // height

struct atmosphere {
    struct hg_sky sky;
    float mie_scattering, mie_absorption;
    float transmittance[TABLE_Y][TABLE_X][3]; // to the top of the atmosphere, 0 behind the earth
    float multiple[TABLE_Y][TABLE_X][3];      // radiance of orders >= 2 per unit of illuminance
};

struct medium {
    float rayleigh[3], mie[3]; // scattering
    float extinction[3];
};

static struct medium medium_at(const struct atmosphere *a, float height_km)
{
    struct medium m;
    float r = expf(-height_km / RAYLEIGH_KM), d = expf(-height_km / MIE_KM);
    float ozone = fmaxf(0, 1 - fabsf(height_km - 25) / 15);
    for (int c = 0; c < 3; c++) {
        m.rayleigh[c] = rayleigh_scattering[c] * r;
        m.mie[c] = a->mie_scattering * d * haze_spectrum[c];
        m.extinction[c] = m.rayleigh[c] + m.mie[c] + a->mie_absorption * d * haze_spectrum[c] +
                          ozone_absorption[c] * ozone;
    }
    return m;
}

// Distance to a sphere about the earth's centre along a ray from radius r with cosine mu; < 0:
// none.
static float sphere_distance(float r, float mu, float radius)
{
    float h = r * r * (mu * mu - 1) + radius * radius;
    if (h < 0)
        return -1;
    float s = sqrtf(h), near = -r * mu - s;
    return near > 0 ? near : -r * mu + s;
}

static bool hits_ground(float r, float mu)
{
    return mu < 0 && r * r * (mu * mu - 1) + GROUND_KM * GROUND_KM >= 0;
}

// Rows are denser near the ground, columns near the horizon.
static float table_height(float y)
{
    return (TOP_KM - GROUND_KM) * y * y;
}

static void table_read(const float table[TABLE_Y][TABLE_X][3], float r, float mu, float out[3])
{
    float y = sqrtf(hg_clampf((r - GROUND_KM) / (TOP_KM - GROUND_KM), 0, 1)) * (TABLE_Y - 1);
    float s = (mu < 0 ? -1.0f : 1.0f) * sqrtf(fabsf(mu));
    float x = hg_clampf(0.5f + 0.5f * s, 0, 1) * (TABLE_X - 1);
    int i = (int)fminf(x, TABLE_X - 2), j = (int)fminf(y, TABLE_Y - 2);
    float fx = x - (float)i, fy = y - (float)j;
    for (int c = 0; c < 3; c++) {
        float low = table[j][i][c] + (table[j][i + 1][c] - table[j][i][c]) * fx;
        float high = table[j + 1][i][c] + (table[j + 1][i + 1][c] - table[j + 1][i][c]) * fx;
        out[c] = low + (high - low) * fy;
    }
}

static float table_mu(int i)
{
    float s = 2 * (float)i / (TABLE_X - 1) - 1;
    return s < 0 ? -s * s : s * s;
}

// Beer-Lambert to the top of the atmosphere; the earth is left out (its shadow is made soft in
// sun_light).
static void transmittance_row(void *user, size_t row)
{
    struct atmosphere *a = user;
    float r = GROUND_KM + table_height((float)row / (TABLE_Y - 1));
    for (int i = 0; i < TABLE_X; i++) {
        float mu = table_mu(i), depth[3] = {0, 0, 0};
        float length = sphere_distance(r, mu, TOP_KM);
        const float steps = 64;
        for (int k = 0; k < 64; k++) {
            // Denser at the start, where the air is.
            float t0 = (float)k / steps, t1 = (float)(k + 1) / steps;
            float from = length * t0 * t0, to = length * t1 * t1, t = 0.5f * (from + to);
            float rt = sqrtf(r * r + t * t + 2 * r * t * mu);
            struct medium m = medium_at(a, fmaxf(rt - GROUND_KM, 0));
            for (int c = 0; c < 3; c++)
                depth[c] += m.extinction[c] * (to - from);
        }
        for (int c = 0; c < 3; c++)
            a->transmittance[row][i][c] = expf(-depth[c]);
    }
}

// Sun light that reaches a point, per unit outside; fades while the disc sinks below the horizon.
static void sun_light(const struct atmosphere *a, float r, float mu, float out[3])
{
    float horizon = -sqrtf(fmaxf(0, 1 - GROUND_KM * GROUND_KM / (r * r)));
    float seen = hg_clampf((mu - horizon) / (2 * SUN_RADIUS) + 0.5f, 0, 1);
    table_read(a->transmittance, r, mu, out);
    for (int c = 0; c < 3; c++)
        out[c] *= seen * seen * (3 - 2 * seen);
}

// One march through the air. Directions in a frame whose y points up at the eye.
struct march {
    float r, dir[3], sun[3]; // radius of the start, unit directions
    int steps;
    bool isotropic; // for the multiple-scattering table: phase 1 / 4 pi, no higher orders
};

struct march_result {
    float light[3];         // per unit of the sun's illuminance
    float scattered[3];     // share of light that scattering passes on (isotropic)
    float transmittance[3]; // to the end
};

static float mie_phase(float cosine)
{
    // Cornette and Shanks 1992.
    const float g2 = MIE_G * MIE_G;
    float k = 1 + g2 - 2 * MIE_G * cosine;
    return (float)(3 / (8 * HG_PI)) * (1 - g2) * (1 + cosine * cosine) / ((2 + g2) * k * sqrtf(k));
}

static void march_step(const struct atmosphere *a, const struct march *m, const float at[3],
    float step, struct march_result *out)
{
    float r = hg_length3(at), mu = hg_dot3(at, m->sun) / r, sun[3], multiple[3] = {0, 0, 0};
    struct medium air = medium_at(a, fmaxf(r - GROUND_KM, 0));
    float cosine = hg_dot3(m->dir, m->sun);
    float phase_r = (float)(3 / (16 * HG_PI)) * (1 + cosine * cosine), phase_m = mie_phase(cosine);
    sun_light(a, r, mu, sun);
    if (m->isotropic)
        phase_r = phase_m = (float)(1 / (4 * HG_PI));
    else
        table_read(a->multiple, r, mu, multiple);
    for (int c = 0; c < 3; c++) {
        float scattering = air.rayleigh[c] + air.mie[c];
        float source =
            sun[c] * (air.rayleigh[c] * phase_r + air.mie[c] * phase_m) + multiple[c] * scattering;
        float pass = expf(-air.extinction[c] * step);
        // Hillaire 2016: the step's source integrated against its own extinction.
        float weight = out->transmittance[c] * (1 - pass) / air.extinction[c];
        out->light[c] += source * weight;
        out->scattered[c] += scattering * weight;
        out->transmittance[c] *= pass;
    }
}

// Light of the ground seen at the end of a march: sun and, unless isotropic, the sky's share.
static void add_ground(
    const struct atmosphere *a, const struct march *m, float length, struct march_result *out)
{
    float at[3] = {0, m->r, 0}, sun[3], sky[3] = {0, 0, 0};
    hg_mad3(at, m->dir, length, at);
    hg_normalize3(at);
    float mu = hg_dot3(at, m->sun);
    sun_light(a, GROUND_KM, mu, sun);
    if (!m->isotropic)
        table_read(a->multiple, GROUND_KM, mu, sky);
    for (int c = 0; c < 3; c++)
        out->light[c] += out->transmittance[c] * GROUND_ALBEDO *
                         (sun[c] * fmaxf(mu, 0) * (float)(1 / HG_PI) + sky[c]);
}

static struct march_result march(const struct atmosphere *a, const struct march *m)
{
    struct march_result out = {.transmittance = {1, 1, 1}};
    bool ground = hits_ground(m->r, m->dir[1]);
    float length = sphere_distance(m->r, m->dir[1], ground ? GROUND_KM : TOP_KM);
    for (int k = 0; k < m->steps; k++) {
        float t0 = (float)k / (float)m->steps, t1 = (float)(k + 1) / (float)m->steps;
        float from = length * t0 * t0, to = length * t1 * t1, at[3] = {0, m->r, 0};
        hg_mad3(at, m->dir, 0.5f * (from + to), at);
        march_step(a, m, at, to - from, &out);
    }
    if (ground)
        add_ground(a, m, length, &out);
    return out;
}

// Hillaire 2020, eq. 5..10: second order from 64 directions, further ones as a geometric series.
static void multiple_row(void *user, size_t row)
{
    struct atmosphere *a = user;
    for (int i = 0; i < TABLE_X; i++) {
        float mu = table_mu(i), second[3] = {0, 0, 0}, share[3] = {0, 0, 0};
        struct march m = {.r = GROUND_KM + fmaxf(table_height((float)row / (TABLE_Y - 1)), 0.01f),
            .sun = {sqrtf(fmaxf(0, 1 - mu * mu)), mu, 0},
            .steps = 20,
            .isotropic = true};
        for (int k = 0; k < 64; k++) {
            float y = 1 - 2 * ((float)(k / 8) + 0.5f) / 8, s = sqrtf(1 - y * y);
            float phi = (float)(2 * HG_PI) * ((float)(k % 8) + 0.5f) / 8;
            m.dir[0] = s * cosf(phi);
            m.dir[1] = y;
            m.dir[2] = s * sinf(phi);
            struct march_result r = march(a, &m);
            for (int c = 0; c < 3; c++) {
                second[c] += r.light[c] / 64;
                share[c] += r.scattered[c] / 64;
            }
        }
        for (int c = 0; c < 3; c++)
            a->multiple[row][i][c] = second[c] / (1 - fminf(share[c], 0.98f));
    }
}

struct sky_fill {
    struct atmosphere *a;
    struct hg_image *image;
};

// Share of a texel's width that lies inside the sun's disc, softened over one texel.
static float disc_cover(const float dir[3], const float sun[3])
{
    float d[3], texel = (float)(2 * HG_PI / HG_SKY_WIDTH);
    hg_sub3(dir, sun, d);
    float angle = 2 * asinf(hg_clampf(0.5f * hg_length3(d), 0, 1));
    return hg_clampf((SUN_RADIUS + texel - angle) / texel, 0, 1);
}

static void sky_row(void *user, size_t row)
{
    const struct sky_fill *fill = user;
    const struct atmosphere *a = fill->a;
    float *out = (float *)fill->image->pixels + row * HG_SKY_WIDTH * 4;
    float latitude = (float)HG_PI * (0.5f - ((float)row + 0.5f) / HG_SKY_HEIGHT);
    struct march m = {.r = GROUND_KM + EYE_KM, .steps = 40};
    hg_copy3(a->sky.sun_direction, m.sun);
    for (uint32_t x = 0; x < HG_SKY_WIDTH; x++, out += 4) {
        float phi = (float)(2 * HG_PI) * (((float)x + 0.5f) / HG_SKY_WIDTH - 0.5f);
        m.dir[0] = cosf(latitude) * cosf(phi);
        m.dir[1] = sinf(latitude);
        m.dir[2] = cosf(latitude) * sinf(phi);
        struct march_result r = march(a, &m);
        for (int c = 0; c < 3; c++)
            out[c] = r.light[c] * HG_SKY_SUN_LUX;
        out[3] = 1;
    }
}

struct hg_sky hg_sky_of(const struct hg_environment *environment, bool scene_has_sun)
{
    struct hg_sky sky = {.turbidity = environment->turbidity,
        .with_disc = environment->sun == HG_SKY_SUN_ON ||
                     (environment->sun == HG_SKY_SUN_AUTO && !scene_has_sun)};
    hg_copy3(environment->sun_direction, sky.sun_direction);
    hg_normalize3(sky.sun_direction);
    if (!(hg_dot3(sky.sun_direction, sky.sun_direction) > 0))
        sky.sun_direction[1] = 1;
    return sky;
}

// Exactly the sun's illuminance: cover is normalised over the texels the disc falls on.
void hg_sky_draw_disc(const struct hg_sky *sky, struct hg_image *image)
{
    float e[3], sun[3];
    double sum = 0;
    hg_sky_sun_illuminance(sky, e);
    hg_copy3(sky->sun_direction, sun);
    hg_normalize3(sun);
    for (int pass = 0; pass < 2; pass++)
        for (uint32_t y = 0; y < HG_SKY_HEIGHT; y++) {
            float latitude = (float)HG_PI * (0.5f - ((float)y + 0.5f) / HG_SKY_HEIGHT);
            float texel =
                cosf(latitude) * (float)(2 * HG_PI * HG_PI / HG_SKY_WIDTH / HG_SKY_HEIGHT);
            if (fabsf(latitude - asinf(hg_clampf(sun[1], -1, 1))) > 0.05f)
                continue;
            for (uint32_t x = 0; x < HG_SKY_WIDTH; x++) {
                float phi = (float)(2 * HG_PI) * (((float)x + 0.5f) / HG_SKY_WIDTH - 0.5f);
                float d[3] = {
                    cosf(latitude) * cosf(phi), sinf(latitude), cosf(latitude) * sinf(phi)};
                float cover = disc_cover(d, sun);
                float *out = (float *)image->pixels + ((size_t)y * HG_SKY_WIDTH + x) * 4;
                for (int c = 0; pass && c < 3 && sum > 0; c++)
                    out[c] += e[c] * cover / (float)sum;
                if (!pass)
                    sum += (double)(cover * texel);
            }
        }
}

static void set_air(struct atmosphere *a, const struct hg_sky *sky)
{
    a->sky = *sky;
    hg_normalize3(a->sky.sun_direction);
    // Turbidity is the extinction of hazy over that of pure air, straight up, in green light
    // (Preetham 1999, section 3.1).
    float turbidity = sky->turbidity > 0 ? hg_clampf(sky->turbidity, 1, 10) : 2;
    float haze = fmaxf(turbidity - 1, 0.02f) * rayleigh_scattering[1] * RAYLEIGH_KM / MIE_KM;
    a->mie_scattering = haze * MIE_ALBEDO;
    a->mie_absorption = haze * (1 - MIE_ALBEDO);
}

enum hg_status hg_sky_render(const struct hg_sky *sky, struct hg_jobs *jobs, struct hg_image *out)
{
    *out = (struct hg_image){0};
    struct atmosphere *a = hg_calloc(1, sizeof *a);
    if (!a)
        return HG_E_NOMEM;
    enum hg_status status =
        hg_image_create(HG_SKY_WIDTH, HG_SKY_HEIGHT, HG_PIXEL_RGBA32F, NULL, out);
    if (!status) {
        set_air(a, sky);
        hg_jobs_for(jobs, TABLE_Y, transmittance_row, a);
        hg_jobs_for(jobs, TABLE_Y, multiple_row, a);
        struct sky_fill fill = {a, out};
        hg_jobs_for(jobs, HG_SKY_HEIGHT, sky_row, &fill);
        if (sky->with_disc)
            hg_sky_draw_disc(sky, out);
    }
    hg_free(a);
    return status;
}

void hg_sky_sun_illuminance(const struct hg_sky *sky, float out[3])
{
    struct atmosphere a = {0};
    set_air(&a, sky);
    for (size_t row = 0; row < 2; row++)
        transmittance_row(&a, row);
    sun_light(&a, GROUND_KM + EYE_KM, a.sky.sun_direction[1], out);
    for (int c = 0; c < 3; c++)
        out[c] *= HG_SKY_SUN_LUX;
}
