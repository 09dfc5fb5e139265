#include "renderer/light/env/sky.h"

#include "base/alloc.h"
#include "renderer/math/vec.h"
#include "shaders/shared/light.h"

// Kilometres; coefficients per kilometre at sea level (Hillaire 2020, table 1).
#define GROUND_KM     6360.0f
#define TOP_KM        6460.0f
#define EYE_KM        0.05f
#define MIE_G         0.8f
#define GROUND_ALBEDO 0.3f

static const float rayleigh_scattering[3] = {5.802e-3f, 13.558e-3f, 33.1e-3f};
static const float ozone_absorption[3] = {0.650e-3f, 1.881e-3f, 0.085e-3f};
#define MIE_ALBEDO 0.9f // scattering over extinction, Bruneton 2017
// Haze is bluer than white: extinction falls with the wavelength to the power of 1.3 (Angstrom
// 1929; Preetham 1999, appendix A.1), here at 680, 550 and 440 nm over that at 550 nm.
static const float haze_spectrum[3] = {0.7590f, 1.0f, 1.3365f};
#define RAYLEIGH_KM 8.0f // scale heights
#define MIE_KM      1.2f

#define TABLE_X   64 // cosine of the sun's zenith angle
#define TABLE_Y   32 // height
#define SKY_STEPS 40 // of a march
#define SKY_TURNS 128 // marches of a row

struct atmosphere {
    struct hg_sky sky;
    float mie_scattering, mie_absorption;
    hg_v4 transmittance[TABLE_Y][TABLE_X]; // to the top of the atmosphere, 0 behind the earth
    hg_v4 multiple[TABLE_Y][TABLE_X];      // radiance of orders >= 2 per unit of illuminance
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

// A place between the entries of a table, along one of its axes.
struct table_place {
    int index;
    float between;
};

static struct table_place table_place(float at, int size)
{
    const int index = (int)fminf(at, (float)(size - 2));
    return (struct table_place){index, at - (float)index};
}

static struct table_place height_place(float r)
{
    return table_place(
        sqrtf(hg_clampf((r - GROUND_KM) / (TOP_KM - GROUND_KM), 0, 1)) * (TABLE_Y - 1), TABLE_Y);
}

static struct table_place mu_place(float mu)
{
    float s = (mu < 0 ? -1.0f : 1.0f) * sqrtf(fabsf(mu));
    return table_place(hg_clampf(0.5f + 0.5f * s, 0, 1) * (TABLE_X - 1), TABLE_X);
}

static hg_v4 table_read(
    const hg_v4 table[TABLE_Y][TABLE_X], struct table_place height, struct table_place mu)
{
    const hg_v4 *low_row = &table[height.index][mu.index], *high_row = low_row + TABLE_X;
    hg_v4 low = low_row[0] + (low_row[1] - low_row[0]) * mu.between;
    hg_v4 high = high_row[0] + (high_row[1] - high_row[0]) * mu.between;
    return low + (high - low) * height.between;
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
            a->transmittance[row][i][(size_t)c] = expf(-depth[c]);
    }
}

// What the light of the sun at a point depends on, but for the cosine of the sun's zenith angle.
struct sun_place {
    struct table_place height;
    float horizon; // its cosine
};

static struct sun_place sun_place(float r)
{
    return (struct sun_place){
        height_place(r), -sqrtf(fmaxf(0, 1 - GROUND_KM * GROUND_KM / (r * r)))};
}

// Sun light that reaches a point, per unit outside; fades while the disc sinks below the horizon.
static hg_v4 sun_light(
    const struct atmosphere *a, const struct sun_place *at, float mu, struct table_place mu_at)
{
    float seen = hg_clampf((mu - at->horizon) / (2 * HG_SUN_RADIUS) + 0.5f, 0, 1);
    return table_read(a->transmittance, at->height, mu_at) * (seen * seen * (3 - 2 * seen));
}

// The air along a ray, which is the same for every azimuth and every place of the sun: light
// scattered at each step is weighted by the transmittance from there to the start.
struct air_step {
    float t, r; // distance along the ray and radius, of the step's middle
    struct sun_place sun;
    hg_v4 rayleigh, mie; // weighted scattering
};

struct air {
    float r, y; // radius of the start, cosine of the zenith angle
    float length;
    bool ground; // the ray ends there
    int steps;
    hg_v4 scattered;     // share of light that scattering passes on (isotropic)
    hg_v4 transmittance; // to the end
    struct air_step step[SKY_STEPS];
};

static float radius_at(const struct air *air, float t)
{
    const double r = (double)air->r, d = (double)t;
    return (float)sqrt(r * r + d * d + 2 * r * d * (double)air->y);
}

static void add_step(const struct atmosphere *a, float from, float to, struct air *air)
{
    struct air_step *step = &air->step[air->steps++];
    const float t = 0.5f * (from + to), r = radius_at(air, t);
    const struct medium m = medium_at(a, fmaxf(r - GROUND_KM, 0));
    *step = (struct air_step){.t = t, .r = r, .sun = sun_place(r)};
    for (size_t c = 0; c < 3; c++) {
        const float pass = expf(-m.extinction[c] * (to - from));
        // Hillaire 2016: the step's source integrated against its own extinction.
        const float weight = air->transmittance[c] * (1 - pass) / m.extinction[c];
        step->rayleigh[c] = m.rayleigh[c] * weight;
        step->mie[c] = m.mie[c] * weight;
        air->transmittance[c] *= pass;
    }
    air->scattered += step->rayleigh + step->mie;
}

static void look_through(const struct atmosphere *a, float r, float y, int steps, struct air *out)
{
    *out = (struct air){.r = r, .y = y, .ground = hits_ground(r, y), .transmittance = {1, 1, 1, 1}};
    out->length = sphere_distance(r, y, out->ground ? GROUND_KM : TOP_KM);
    for (int k = 0; k < steps; k++) {
        const float t0 = (float)k / (float)steps, t1 = (float)(k + 1) / (float)steps;
        add_step(a, out->length * t0 * t0, out->length * t1 * t1, out);
    }
}

static float mie_phase(float cosine)
{
    // Cornette and Shanks 1992.
    const float g2 = MIE_G * MIE_G;
    float k = 1 + g2 - 2 * MIE_G * cosine;
    return (float)(3 / (8 * HG_PI)) * (1 - g2) * (1 + cosine * cosine) / ((2 + g2) * k * sqrtf(k));
}

// The sun above the start of a ray, and beside its direction.
struct sun_about {
    float y, cosine; // of its zenith angle at the start, and of the angle between it and the ray
    bool isotropic;  // for the multiple-scattering table: phase 1 / 4 pi, no higher orders
};

// Light of the ground seen at the end of a march: sun and, unless isotropic, the sky's share.
static hg_v4 ground_light(
    const struct atmosphere *a, const struct air *air, const struct sun_about *sun)
{
    const float mu = (air->r * sun->y + air->length * sun->cosine) / radius_at(air, air->length);
    const struct sun_place at = sun_place(GROUND_KM);
    const struct table_place mu_at = mu_place(mu);
    hg_v4 light = sun_light(a, &at, mu, mu_at) * (fmaxf(mu, 0) * (float)(1 / HG_PI));
    if (!sun->isotropic)
        light += table_read(a->multiple, at.height, mu_at);
    return air->transmittance * GROUND_ALBEDO * light;
}

// Light along a ray per unit of the sun's illuminance: scattered once, over the phase function of
// air or haze, and the rest. All of it changes slowly with the angle between ray and sun.
struct light {
    hg_v4 rayleigh, mie, rest;
};

static struct light march(
    const struct atmosphere *a, const struct air *air, const struct sun_about *sun)
{
    struct light light = {{0, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0}};
    for (int k = 0; k < air->steps; k++) {
        const struct air_step *step = &air->step[k];
        const float mu = (air->r * sun->y + step->t * sun->cosine) / step->r;
        const struct table_place at = mu_place(mu);
        const hg_v4 direct = sun_light(a, &step->sun, mu, at);
        light.rayleigh += direct * step->rayleigh;
        light.mie += direct * step->mie;
        if (!sun->isotropic)
            light.rest +=
                table_read(a->multiple, step->sun.height, at) * (step->rayleigh + step->mie);
    }
    if (air->ground)
        light.rest += ground_light(a, air, sun);
    return light;
}

// Hillaire 2020, eq. 5..10: second order from 64 directions, further ones as a geometric series.
static void multiple_row(void *user, size_t row)
{
    enum { RINGS = 8, AROUND = 8 };
    struct atmosphere *a = user;
    const float r = GROUND_KM + fmaxf(table_height((float)row / (TABLE_Y - 1)), 0.01f);
    hg_v4 second[TABLE_X] = {{0}}, share = {0, 0, 0, 0};
    for (int ring = 0; ring < RINGS; ring++) {
        struct air air;
        const float y = 1 - 2 * ((float)ring + 0.5f) / RINGS, s = sqrtf(1 - y * y);
        look_through(a, r, y, SKY_STEPS / 2, &air);
        share += air.scattered / RINGS;
        for (int i = 0; i < TABLE_X * AROUND; i++) {
            const float phi = (float)(2 * HG_PI) * ((float)(i % AROUND) + 0.5f) / AROUND;
            const float mu = table_mu(i / AROUND);
            const struct sun_about sun = {
                mu, s * cosf(phi) * sqrtf(fmaxf(0, 1 - mu * mu)) + y * mu, true};
            const struct light light = march(a, &air, &sun);
            second[i / AROUND] +=
                ((light.rayleigh + light.mie) * (float)(1 / (4 * HG_PI)) + light.rest) /
                (RINGS * AROUND);
        }
    }
    for (int i = 0; i < TABLE_X; i++)
        for (size_t c = 0; c < 3; c++)
            a->multiple[row][i][c] = second[i][c] / (1 - fminf(share[c], 0.98f));
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
    return hg_clampf((HG_SUN_RADIUS + texel - angle) / texel, 0, 1);
}

// A row's light depends on one cosine, that of the angle to the sun: middle - reach .. middle +
// reach.
struct turns {
    float middle, reach;
    struct light light[SKY_TURNS + 1];
};

static void make_turns(
    const struct atmosphere *a, const struct air *air, float y, struct turns *out)
{
    const float up = a->sky.sun_direction[1];
    out->middle = y * up;
    out->reach = sqrtf(fmaxf(0, 1 - y * y) * fmaxf(0, 1 - up * up));
    for (int i = 0; i <= SKY_TURNS; i++) {
        const float cosine = out->middle + out->reach * (2 * (float)i / SKY_TURNS - 1);
        const struct sun_about about = {up, cosine, false};
        out->light[i] = march(a, air, &about);
    }
}

static hg_v4 light_at(const struct turns *turns, float cosine)
{
    const float reach = fmaxf(turns->reach, 1e-6f);
    const float at = hg_clampf((cosine - turns->middle) / reach * 0.5f + 0.5f, 0, 1) * SKY_TURNS;
    const struct table_place place = table_place(at, SKY_TURNS + 1);
    const struct light *low = &turns->light[place.index], *high = low + 1;
    const float phase = (float)(3 / (16 * HG_PI)) * (1 + cosine * cosine);
    return (low->rayleigh + (high->rayleigh - low->rayleigh) * place.between) * phase +
           (low->mie + (high->mie - low->mie) * place.between) * mie_phase(cosine) +
           (low->rest + (high->rest - low->rest) * place.between);
}

static void sky_row(void *user, size_t row)
{
    const struct sky_fill *fill = user;
    const struct atmosphere *a = fill->a;
    float *out = (float *)fill->image->pixels + row * HG_SKY_WIDTH * 4;
    float latitude = (float)HG_PI * (0.5f - ((float)row + 0.5f) / HG_SKY_HEIGHT);
    const float y = sinf(latitude);
    struct air air;
    struct turns turns;
    look_through(a, GROUND_KM + EYE_KM, y, SKY_STEPS, &air);
    make_turns(a, &air, y, &turns);
    for (uint32_t x = 0; x < HG_SKY_WIDTH; x++, out += 4) {
        float phi = (float)(2 * HG_PI) * (((float)x + 0.5f) / HG_SKY_WIDTH - 0.5f);
        const float direction[3] = {cosf(latitude) * cosf(phi), y, cosf(latitude) * sinf(phi)};
        const hg_v4 light = light_at(&turns, hg_dot3(direction, a->sky.sun_direction));
        for (size_t c = 0; c < 3; c++)
            out[c] = light[c] * HG_SKY_SUN_LUX;
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
    struct atmosphere *a = hg_calloc_aligned(16, sizeof *a);
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
    const float mu = a.sky.sun_direction[1];
    const struct sun_place at = sun_place(GROUND_KM + EYE_KM);
    const hg_v4 light = sun_light(&a, &at, mu, mu_place(mu));
    for (size_t c = 0; c < 3; c++)
        out[c] = light[c] * HG_SKY_SUN_LUX;
}

void hg_sky_disc_update(
    struct hg_sky_disc *sun, const struct hg_environment *env, bool scene_has_sun)
{
    memset(sun->lux, 0, sizeof sun->lux);
    memset(sun->towards_ws, 0, sizeof sun->towards_ws);
    if (env->kind != HG_ENV_SKY)
        return;
    const struct hg_sky sky = hg_sky_of(env, scene_has_sun);
    const float *to = sky.sun_direction;
    if (memcmp(sun->sun_direction, to, sizeof sun->sun_direction) != 0 ||
        sun->turbidity != sky.turbidity) {
        hg_copy3(to, sun->sun_direction);
        sun->turbidity = sky.turbidity;
        hg_sky_sun_illuminance(&sky, sun->illuminance);
    }
    const float lux[3] = {sun->illuminance[0] * env->intensity,
        sun->illuminance[1] * env->intensity, sun->illuminance[2] * env->intensity};
    if (!sky.with_disc || !(fmaxf(lux[0], fmaxf(lux[1], lux[2])) > 0))
        return;
    const float c = cosf(env->rotation_rad), s = sinf(env->rotation_rad);
    const float towards[3] = {c * to[0] + s * to[2], to[1], c * to[2] - s * to[0]};
    hg_copy3(lux, sun->lux);
    hg_copy3(towards, sun->towards_ws);
}

float hg_sky_sun_luminance(const struct hg_environment *environment, bool scene_has_sun)
{
    const struct hg_sky sky = hg_sky_of(environment, scene_has_sun);
    float lux[3];
    if (environment->kind != HG_ENV_SKY || !sky.with_disc)
        return 0;
    hg_sky_sun_illuminance(&sky, lux);
    return (0.2126f * lux[0] + 0.7152f * lux[1] + 0.0722f * lux[2]) * environment->intensity /
           (float)HG_PI;
}
