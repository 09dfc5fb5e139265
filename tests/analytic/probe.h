// probe.h - runs the renderer's GLSL functions on the device over arrays of inputs.
// Test support. A probe owns a device, a scene and its lighting; the shader is
// tests/analytic/shaders/probe.comp, one function per operation.
#ifndef HG_TESTS_ANALYTIC_PROBE_H
#define HG_TESTS_ANALYTIC_PROBE_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "renderer/light/lighting.h"

enum probe_op {          // specialisation constant 0 of probe.comp
    PROBE_D_INTEGRAL,    // alpha -> integral of D n.h over the hemisphere
    PROBE_WHITE_FURNACE, // alpha, n.v -> integral of the visible normals' density
    PROBE_RECIPROCITY,   // roughness, metallic, seeds -> f(v, l), f(l, v), relative difference
    PROBE_ALBEDO,        // roughness, metallic, n.v, base -> albedo by importance sampling
    PROBE_FRESNEL,       // f0, v.h -> F
    PROBE_SAMPLE,        // roughness, metallic, n.v; index -> direction
    PROBE_PDF,           // roughness, metallic, n.v; direction -> pdf
    PROBE_DFG,           // n.v, roughness -> a, b, averages
    PROBE_TONEMAP,       // rgb, operator -> rgb
    PROBE_SRGB,          // linear -> encoded, decoded again
    PROBE_RADIANCE,      // direction -> background radiance
    PROBE_IRRADIANCE,    // normal -> irradiance / pi
    PROBE_PREFILTERED,   // direction, roughness -> mean radiance of the lobe
    PROBE_ENVIRONMENT,   // roughness, metallic, n.v, base -> light reflected
    PROBE_ILLUMINANCE,   // position, light -> illuminance
    PROBE_LIGHTS,        // position, pixel and depth in the second vector -> reflected light
    PROBE_D_VALUE,       // n.h, alpha -> D, V at n.l = n.v = n.h
};

struct probe {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    struct hg_scene *scene;
    struct hg_lighting *lighting;
    struct hg_lighting_view view;
    struct hg_gpu_camera camera;
    struct hg_gpu_lighting block; // of the newest sync; tests may change it before a run
    uint32_t layers;              // validation messages are counted
};

// The camera looks from (0, 0, 0) along -z, 90 degrees wide and high, 512 x 512 px.
void probe_init(struct probe *probe, struct hg_store *store);
void probe_finish(struct probe *probe);
// Of a group of tests: *state is its probe.
int probe_setup(void **state);
int probe_teardown(void **state);
// Brings the lighting in line with probe->scene.
void probe_sync(struct probe *probe);
// out[i] = op(in[2 i], in[2 i + 1]) for `count` pairs of vec4.
void probe_run(struct probe *probe, enum probe_op op, uint32_t count, const struct hg_vec4 *in,
    struct hg_vec4 *out);

// Any shader that pushes {source, result, count}: `in_size` vec4 as they are, `out_size` vec4 back.
struct probe_dispatch {
    const char *shader;
    uint32_t op;    // specialisation constant 0
    uint32_t count; // invocations
};
void probe_run_shader(struct probe *probe, const struct probe_dispatch *dispatch,
    const struct hg_vec4 *in, uint32_t in_size, struct hg_vec4 *out, uint32_t out_size);

// In [0, 1), the same ones in every run: of 53 bits, and of 24 that a float holds.
double probe_random(void);
float probe_random_float(void);

#define probe_near(value, expected, tolerance)                                                     \
    probe_assert_near(                                                                             \
        (double)(value), (double)(expected), (double)(tolerance), #value, __FILE__, __LINE__)
void probe_assert_near(
    double value, double expected, double tolerance, const char *text, const char *file, int line);

#endif
