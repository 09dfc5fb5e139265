// light.h - lights, clusters, shadow maps and the environment as shaders see them.
// Floor 0, shared by C and GLSL. Embedded by value in struct hg_gpu_frame; filled by
// hg_lighting_fill (renderer/light/lighting.h). Metres, candela, lux, linear Rec.709 radiance.
#ifndef HG_SHADERS_SHARED_LIGHT_H
#define HG_SHADERS_SHARED_LIGHT_H

#include "shared/light_table.h"
#include "shared/types.h"

#define HG_LIGHT_KIND_DIRECTIONAL 0
#define HG_LIGHT_KIND_POINT       1
#define HG_LIGHT_KIND_SPOT        2
#define HG_LIGHT_KIND_RECTANGLE   3
#define HG_LIGHT_KIND_DISC        4
#define HG_LIGHT_KIND_TUBE        5

#define HG_SHADOW_NONE    0xffffffffu
#define HG_LIGHT_TOGETHER 0xffffffffu // it stands for several lamps
#define HG_SHADOW_UNASKED 0xfffffffeu // in the tables of emitters: nothing is in its light's way
#define HG_SHADOW_TAPS    4 // of one filtered lookup
#define HG_CASCADE_COUNT  4

#define HG_SUN_RADIUS       0.004675f // angular, of the sun of skies
#define HG_SHADOW_RADIUS_PX 1.5f      // of the filter, in texels
#define HG_PENUMBRA_MOST_PX 40.0f     // as far as the filter widens for the sun's disc

// Pages of a sun's shadow in pictures in motion (renderer/light/shadow/shadow_pages.h). A word of
// their table is 0 or the number of the physical page + 1, and what tells pages apart that share a
// place of the window.
#define HG_SHADOW_PAGE_PX        128 // with its border
#define HG_SHADOW_PAGE_INNER_PX  120
#define HG_SHADOW_PAGE_LEVELS    12
#define HG_SHADOW_PAGE_WINDOW    16 // pages, a power of two
#define HG_SHADOW_PAGE_WORDS     (HG_SHADOW_PAGE_LEVELS * HG_SHADOW_PAGE_WINDOW * HG_SHADOW_PAGE_WINDOW)
#define HG_SHADOW_PAGE_SLOT_MASK 0x3ffu
#define HG_SHADOW_PAGE_TAG_MASK  0x7ffu
#define HG_SHADOW_PAGE_TAG_X     10
#define HG_SHADOW_PAGE_TAG_Y     21
#define HG_SHADOW_PAGE_TRIES     3 // levels that a surface looks into before the whole map

#define HG_ENV_KIND_NONE  0 // black
#define HG_ENV_KIND_COLOR 1 // the same radiance from everywhere: no images are read
#define HG_ENV_KIND_IMAGE 2

#define HG_DFG_SIZE        32 // samples of cos(theta) and of perceptual roughness
#define HG_SHEEN_SIZE      24 // likewise
#define HG_SHEEN_FIRST     (HG_DFG_SIZE * HG_DFG_SIZE + HG_DFG_SIZE) // word of the table
#define HG_ANGLES_FIRST    (HG_SHEEN_FIRST + HG_SHEEN_SIZE * HG_SHEEN_SIZE)
#define HG_ANGLES_SIZE     24 // samples of cos(theta) and of perceptual roughness
#define HG_ANGLE_NODES     3 // facets that stand for all
#define HG_VNDF_NODES     4 // likewise, below films on glass
#define HG_MEAN_NODES      6 // likewise, of all directions
#define HG_LAYER_SIZE      16 // samples of cos(theta) and of perceptual roughness
#define HG_LAYER_ROUGHS    8  // of the layer's own roughness
#define HG_LAYER_WORDS     (HG_LAYER_ROUGHS * HG_LAYER_SIZE * HG_LAYER_SIZE)
#define HG_COAT_FIRST      (HG_ANGLES_FIRST + HG_ANGLE_NODES * HG_ANGLES_SIZE * HG_ANGLES_SIZE)
#define HG_CLOTH_FIRST     (HG_COAT_FIRST + HG_LAYER_WORDS)
#define HG_COATED_FIRST    (HG_CLOTH_FIRST + HG_LAYER_WORDS)
#define HG_DFG_BLOCK_WORDS 16384 // up to here in a uniform block, from here on by address
#define HG_GLASS_FIRST     HG_DFG_BLOCK_WORDS
#define HG_GLASS_EDGE      (2.0f / 3.0f) // place of total reflection among cosines: an entry
#define HG_GLASS_COSINES   61
#define HG_GLASS_ROUGHS    40
#define HG_GLASS_IORS      24
#define HG_GLASS_WORDS     (HG_GLASS_IORS * HG_GLASS_ROUGHS * HG_GLASS_COSINES) // of one side
#define HG_GLASS_MEANS     (HG_GLASS_FIRST + 2 * HG_GLASS_WORDS)
#define HG_FILM_FIRST      (HG_GLASS_MEANS + 2 * HG_GLASS_IORS * HG_GLASS_ROUGHS)
#define HG_FILM_COSINES    31
#define HG_FILM_ROUGHS     24
#define HG_FILM_IORS       8
#define HG_FILM_WORDS      (HG_FILM_IORS * HG_FILM_ROUGHS * HG_FILM_COSINES) // of one side
#define HG_FILM_MEANS      (HG_FILM_FIRST + 2 * 2 * HG_VNDF_NODES * HG_FILM_WORDS)
#define HG_HELD_FIRST \
    (HG_FILM_MEANS + 2 * 2 * HG_MEAN_NODES * HG_FILM_IORS * HG_FILM_ROUGHS)
#define HG_HELD_COSINES    31
#define HG_HELD_ROUGHS     16
#define HG_HELD_IORS       8
#define HG_HELD_LAYERS     12 // of the layer's own roughness
#define HG_HELD_MEANS                                                             \
    (HG_HELD_FIRST + 2 * HG_HELD_LAYERS * HG_HELD_IORS * HG_HELD_ROUGHS * HG_HELD_COSINES)
#define HG_ANISO_FIRST     (HG_HELD_MEANS + 2 * HG_HELD_LAYERS * HG_HELD_IORS * HG_HELD_ROUGHS)
#define HG_ANISO_COSINES   20
#define HG_ANISO_AZIMUTHS  28
#define HG_ANISO_STRENGTHS 20
#define HG_ANISO_ROUGHS    30
#define HG_ANISO_MEANS                                                            \
    (HG_ANISO_FIRST +                                                             \
        HG_ANISO_ROUGHS * HG_ANISO_STRENGTHS * HG_ANISO_AZIMUTHS * HG_ANISO_COSINES)
#define HG_OVER_ANISO_FIRST     (HG_ANISO_MEANS + HG_ANISO_ROUGHS * HG_ANISO_STRENGTHS)
#define HG_OVER_ANISO_COSINES   16
#define HG_OVER_ANISO_AZIMUTHS  10
#define HG_OVER_ANISO_STRENGTHS 16
#define HG_OVER_ANISO_ROUGHS    16
#define HG_OVER_ANISO_LAYERS    12 // of the layer's own roughness
#define HG_OVER_ANISO_SIDE      (HG_OVER_ANISO_COSINES * HG_OVER_ANISO_AZIMUTHS)
#define HG_OVER_ANISO_BASES     (HG_OVER_ANISO_STRENGTHS * HG_OVER_ANISO_ROUGHS)
#define HG_OVER_ANISO_WORDS \
    (HG_OVER_ANISO_LAYERS * HG_OVER_ANISO_BASES * HG_OVER_ANISO_SIDE) // of coats
#define HG_OVER_ANISO_MEANS     (HG_OVER_ANISO_FIRST + 2 * HG_OVER_ANISO_WORDS)
#define HG_BRUSHED_FIRST     (HG_OVER_ANISO_MEANS + HG_OVER_ANISO_LAYERS * HG_OVER_ANISO_BASES)
#define HG_BRUSHED_COSINES   31
#define HG_BRUSHED_AZIMUTHS  17 // odd: total reflection is in the middle
#define HG_BRUSHED_STRENGTHS 10
#define HG_BRUSHED_ROUGHS    20
#define HG_BRUSHED_IORS      12 // without 1, where nothing is missing
#define HG_BRUSHED_MEANS                                                             \
    (HG_BRUSHED_FIRST +                                                              \
        HG_BRUSHED_IORS * HG_BRUSHED_ROUGHS * HG_BRUSHED_STRENGTHS * HG_BRUSHED_AZIMUTHS * \
            HG_BRUSHED_COSINES)
#define HG_DFG_WORDS                                                                 \
    (HG_BRUSHED_MEANS + HG_BRUSHED_IORS * HG_BRUSHED_ROUGHS * HG_BRUSHED_STRENGTHS)
#define HG_LTC_FIRST           HG_DFG_WORDS // renderer/light/ltc/ltc.h, by address
#define HG_LTC_SIZE            32
#define HG_LTC_WORDS           (2 * HG_LTC_SIZE * HG_LTC_SIZE)
#define HG_LTC_LEAST_ROUGHNESS 0.045f // of HG_MIN_ALPHA
#define HG_BRUSHED_MOST    4.0f  // largest ratio of the means
#define HG_GLASS_FAR       0.5f  // largest (ior - 1) / (ior + 1) of the table
#define HG_DISPERSION_HALF_SPREAD 0.025f // of the index less 1, per unit of KHR_materials_dispersion
#define HG_ANISO_RANGE     1.0f  // largest correction, either way
#define HG_MIN_ALPHA       0.002025f // of HG_MIN_ROUGHNESS in lib/brdf.glsl
#define HG_SHEEN_MIN_ALPHA 0.005f
#define HG_SHEEN_MOST      4.0f // the table holds albedo over this: single scattering alone exceeds 1
#define HG_IRRADIANCE_SIZE 60 // side of the octahedral irradiance map, without its border of one

// One light (KHR_lights_punctual, and area lights). With a size it is a surface of the radiance
// color * radiance: POINT and SPOT a sphere, DIRECTIONAL a disc at infinity.
struct hg_gpu_light {
    HG_VEC3 position_ws;
    float inv_range_sq;   // 1 / range^2; 0 = infinite
    HG_VEC3 direction_ws; // unit, the way the light travels (-z of its node)
    HG_UINT kind;         // HG_LIGHT_KIND_*
    HG_VEC3 color;        // rgb * intensity: lux (directional) or candela
    HG_UINT shadow;       // first of its shadow maps, HG_SHADOW_NONE; HG_SHADOW_UNASKED
    float spot_scale;     // cone: saturate(cos * scale + offset)^2
    float spot_offset;
    HG_UINT shadow_count; // cascades: 1..HG_CASCADE_COUNT, spot 1, point and wide spot 6
    HG_UINT id;           // index of the light in its scene; HG_LIGHT_TOGETHER
    HG_VEC3 axis_ws;      // unit, x of its node: along the width of rectangles, and tubes
    float radius;         // metres; DIRECTIONAL: sine of half its angular diameter
    float half_width, half_height; // metres; TUBE: half its length is the width's; POINT, SPOT without
                          // a size: lamps that it stands for are that far apart, nearer it gets no brighter
    float radiance;       // 1 / m^2, or 1 / sr; 0: it has no size
    float bound;          // metres from position_ws that hold all of it; DIRECTIONAL: cosine of the half angle
    float shadow_fade;    // share of the light that ignores its shadow maps
    HG_UINT profile;      // first word of its photometric profile in the tables; HG_LIGHT_NO_TABLE
    HG_UINT image;        // likewise of its image. DIRECTIONAL: half_width and half_height are those of the
                          // image, around position_ws
};
HG_SHARED_SIZE(hg_gpu_light, 108);

// One square projection in the shadow atlas. With q = (right, up, forward) . (p - origin):
//   orthographic: xy = q.xy * scale, depth = 1 - q.z * depth_scale
//   perspective:  xy = q.xy * scale / q.z, depth = depth_scale / q.z (depth_scale = near)
// xy in -1..1 inside the map (y up); depth 1 is nearest to the light (reversed), as in the frame.
struct hg_gpu_shadow {
    HG_VEC3 origin_ws;
    float scale;
    HG_VEC3 right_ws;
    float depth_scale;
    HG_VEC3 up_ws;
    float texel_size; // metres; perspective: metres at distance 1 m
    HG_VEC3 forward_ws;
    HG_UINT perspective; // 0 or 1
    HG_VEC2 rect_px;     // corner of the map in the atlas
    float size_px;       // side of the map
    float extent;        // |xy| up to which the map may be read (1 less the filter's reach)
};
HG_SHARED_SIZE(hg_gpu_shadow, 80);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly restrict buffer hg_lights_ref
{
    hg_gpu_light v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly restrict buffer
    hg_shadows_ref
{
    hg_gpu_shadow v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly restrict buffer
    hg_light_list_ref
{
    uint v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly restrict buffer
    hg_light_vec4_ref
{
    vec4 v[];
};
#endif

// The pages of one light, which is directional and without a size.
struct hg_gpu_shadow_pages {
    HG_PTR(hg_light_list_ref) table; // [levels][window][window]
    HG_UINT first;    // of the table, among the words of the shadow maps
    HG_UINT shadow;   // first map of the light; HG_SHADOW_NONE
    HG_VEC2 rect_px;  // of the pool in the atlas
    HG_UINT side;     // pages in a row of the pool
    float texel;      // metres, of level 0; twice that of level 1
    float per_depth, constant; // texels of level 0 in one that a surface needs: per metre of view depth; always
};
HG_SHARED_SIZE(hg_gpu_shadow_pages, 40);

struct hg_gpu_lighting {
    HG_PTR(hg_lights_ref) lights;            // [light_count]; the first global_count reach all
    HG_PTR(hg_shadows_ref) shadows;          // [shadow_count]
    HG_PTR(hg_light_list_ref) clusters;      // [x * y * z + 1] first index of each cluster's list
    HG_PTR(hg_light_list_ref) cluster_lights; // light numbers, ascending in each list
    HG_PTR(hg_light_vec4_ref) irradiance;    // [(HG_IRRADIANCE_SIZE + 2)^2] W/m^2 per unit, rgb
    HG_PTR(hg_light_list_ref) dfg;           // [HG_DFG_WORDS] of 2 x 16 bits: renderer/light/albedo/dfg.h
    HG_PTR(hg_light_list_ref) tables;        // of profiles and images of lights: shared/light_table.h
    HG_UINT light_count, global_count;
    HG_UINT clustered; // 0: all lights are looped over
    HG_UINT cluster_x, cluster_y, cluster_z;
    float cluster_scale_x, cluster_scale_y; // clusters per pixel
    float cluster_z_scale, cluster_z_bias;  // slice = log2(view depth) * scale + bias
    HG_UINT env_kind;        // HG_ENV_KIND_*
    float env_specular_lods; // highest level of the prefiltered cube
    HG_VEC3 env_color;       // COLOR: radiance, intensity included; IMAGE: intensity, thrice
    float env_rotation_cos, env_rotation_sin; // of world about +y
    float shadow_inv_size;   // 1 / side of the atlas in texels
    float shadow_dither;     // 0..1, changes with every sample: where cascades change over
    HG_VEC2 shadow_taps_px[HG_SHADOW_TAPS]; // in the filter disk, turned with every sample
    // What is seen may lie off its surface by slack_m + slack_per_m * view depth metres, where levels
    // of detail are simplified more than those in shadow maps.
    float shadow_slack_m, shadow_slack_per_m;
    HG_STRUCT(hg_gpu_shadow_pages) pages; // HG_FEATURE2_SHADOW_PAGES
};
HG_SHARED_SIZE(hg_gpu_lighting, 216);

#endif
