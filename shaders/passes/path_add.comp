// A wave is over: its paths are added to the film, one sample of each pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/path.glsl"

layout(local_size_x = HG_PATH_GROUP) in;

// One more sample for the draw that it met, in the pixel's list of draws.
void list_draw(uint at, uint pixels, uint slot, bool first)
{
    uint list = hg_path.planes[HG_PATH_PLANE_DRAWS] * pixels + at;
    float draw = hg_path_get(hg_path_out(hg_path.planes[HG_PATH_PLANE_DRAWS]), slot);
    bool open = draw > 0.0;
    for (uint i = 0u; i < HG_PATH_DRAWS_LENGTH; i++) {
        uint k = list + 2u * i * pixels;
        float there = first ? 0.0 : hg_path.film.v[k];
        float count = first ? 0.0 : hg_path.film.v[k + pixels];
        bool here = open && (there == 0.0 || there == draw);
        hg_path.film.v[k] = here ? draw : there;
        hg_path.film.v[k + pixels] = count + (here ? 1.0 : 0.0);
        open = open && !here;
    }
}

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
    uint draws = hg_path.planes[HG_PATH_PLANE_DRAWS];
    uint moved = hg_path.planes[HG_PATH_PLANE_MOVED];
    uint what = moved == HG_PATH_NO_PLANE ? moved : moved + HG_PATH_MOVED_WHAT;
    uint guide = hg_path.planes[HG_PATH_PLANE_GUIDE];
    bool first_half = HG_PATH_IS_FIRST_HALF(hg_path_sample(slot));
    if (HG_PATH_CAN(HG_PATH_PLANES) && draws != HG_PATH_NO_PLANE)
        list_draw(at, pixels, slot, first);
    for (uint c = 0u; c < hg_path.channels; c++) {
        float value = luminance * luminance;
        if (c != HG_PATH_FILM_SQUARES)
            value = hg_path_get(hg_path_out(c), slot);
        uint k = c * pixels + at;
        float before = first ? 0.0 : hg_path.film.v[k];
        if (c == object || c == material || c == what) // of the first sample
            value = first ? value : 0.0;
        if (c < draws || c >= draws + 2u * HG_PATH_DRAWS_LENGTH) // not the list's
            hg_path.film.v[k] = before + value;
        if (HG_PATH_CAN(HG_PATH_PLANES) && c >= guide && first_half) {
            uint h = k + HG_PATH_GUIDE_CHANNELS * pixels;
            hg_path.film.v[h] = (first ? 0.0 : hg_path.film.v[h]) + value;
        }
    }
}
