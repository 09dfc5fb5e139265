// A wave is over: its paths are added to the film, one sample of each pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/path.glsl"

layout(local_size_x = HG_PATH_GROUP) in;

void main()
{
    uint slot = gl_GlobalInvocationID.x;
    uvec2 pixel = hg_path_pixel(min(slot, push.count - 1u));
    if (slot >= push.count || pixel.x >= hg_frame.width || pixel.y >= hg_frame.height)
        return;
    uint at = pixel.y * hg_frame.width + pixel.x, pixels = hg_frame.width * hg_frame.height;
    bool first = hg_path_sample(slot) == 0u;
    vec3 color = hg_path_get3(HG_PATH_OUT, slot);
    float luminance = dot(color, vec3(0.2126, 0.7152, 0.0722));
    uint object = hg_path.planes[HG_PATH_PLANE_OBJECT];
    uint material = hg_path.planes[HG_PATH_PLANE_MATERIAL];
    for (uint c = 0u; c < hg_path.channels; c++) {
        float value = luminance * luminance;
        if (c != HG_PATH_FILM_SQUARES)
            value = hg_path_get(hg_path_out(c), slot);
        uint k = c * pixels + at;
        float before = first ? 0.0 : hg_path.film.v[k];
        if (c == object || c == material) // of the first sample
            value = first ? value : 0.0;
        hg_path.film.v[k] = before + value;
    }
}
