// env_device.h - the environment of one lighting object on the device.
// Floor 2 (light). Thread: the render thread.
#ifndef HG_RENDERER_LIGHT_ENV_ENV_DEVICE_H
#define HG_RENDERER_LIGHT_ENV_ENV_DEVICE_H

#include "base/jobs.h"
#include "renderer/gpu/gpu.h"
#include "renderer/scene/scene.h"
#include "base/store/store.h"
#include "shaders/shared/light.h"

struct hg_sky_cache;

#define HG_ENV_COARSE_SIDE 32

// Zero-initialise.
struct hg_env_device {
    uint32_t kind;   // HG_ENV_KIND_* of what the images hold
    uint8_t key[32]; // content on the device
    bool has_key;
    struct hg_gpu_image specular, radiance;
    struct hg_gpu_buffer irradiance;
    uint32_t specular_lods;
    uint64_t prefilter_ns;
    bool from_cache;
    float *coarse; // [6][HG_ENV_COARSE_SIDE^2][3] radiance, for rays on the host; faces as in
                   // cubemap.h
    struct hg_vec4 *host_irradiance; // what `irradiance` holds, for the same
};

// Black 1x1 images, so that bindings are always valid.
enum hg_status hg_env_device_init(
    struct hg_env_device *env, struct hg_gpu *gpu, struct hg_error *err) HG_MUST_CHECK;
void hg_env_device_finish(struct hg_env_device *env, struct hg_gpu *gpu);

// What makes the content of an environment; all borrowed. store may be NULL.
struct hg_env_maker {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    struct hg_store *store;
    struct hg_sky_cache *sky;
};

// Prefilters and uploads when the content changed. has_sun: a directional light stands for the disc
// of a sky. On error the content before stays. HG_E_NOMEM, HG_E_LIMIT, device errors.
enum hg_status hg_env_device_sync(struct hg_env_device *env, const struct hg_env_maker *maker,
    const struct hg_environment *source, bool has_sun, struct hg_error *err) HG_MUST_CHECK;

#endif
