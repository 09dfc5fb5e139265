// A wave is over: what its paths brought goes to the ring (kind 0). When the pixels around are there
// as well, the film takes one sample of each pixel (kind 1), which with HG_PATH_SPLATS is made of
// those of nine pixels, weighted by the filter. Their places in their pixels are the same, so the
// weights are as well. Where a neighbour has no sample in this pass (the picture's edge, tiles that
// are done) the others count for it.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/path.glsl"

layout(local_size_x = HG_PATH_GROUP) in;

layout(constant_id = 0) const uint kind = 0u;

#define OWN 4u // of the nine
const uint from = HG_PATH_CAN(HG_PATH_SPLATS) ? 0u : OWN;
const uint to = HG_PATH_CAN(HG_PATH_SPLATS) ? 9u : OWN + 1u;

uint ring_plane() // words of a channel
{
    return hg_path.columns * hg_path.ring_rows * HG_PATH_TILE_PX;
}

uint ring_at(uvec2 pixel)
{
    uint row = (pixel.y / HG_PATH_TILE_SIDE) % hg_path.ring_rows;
    return (row * HG_PATH_TILE_SIDE + pixel.y % HG_PATH_TILE_SIDE) *
        (hg_path.columns * HG_PATH_TILE_SIDE) + pixel.x;
}

void keep(uint slot, uvec2 pixel)
{
    uint at = ring_at(pixel), plane = ring_plane();
    for (uint k = 0u; k < hg_path.channels - 1u; k++) // squares are not among them
        hg_path.ring.v[k * plane + at] = hg_path_get(HG_PATH_OUT + k, slot);
}

// Places in the ring of the pixels whose samples count here, and how much.
struct taps {
    uint at[9];
    float weight[9];
};

taps taps_of(uvec2 pixel, uint number)
{
    taps t;
    float sum = 0.0;
    for (uint i = from; i < to; i++) {
        uvec2 p = pixel + uvec2(i % 3u, i / 3u) - 1u; // wraps at the edge
        bool there = p.x < hg_frame.width && p.y < hg_frame.height;
        p = there ? p : pixel;
        uvec2 tile = p / HG_PATH_TILE_SIDE;
        there = there && hg_path.traced.v[tile.y * hg_path.columns + tile.x] == number + 1u;
        float weight = 1.0;
        if (HG_PATH_CAN(HG_PATH_SPLATS))
            weight = hg_path.splat_x[i % 3u] * hg_path.splat_y[i / 3u];
        t.at[i] = ring_at(p);
        t.weight[i] = there ? weight : 0.0;
        sum += t.weight[i];
    }
    for (uint i = from; i < to; i++)
        t.weight[i] /= sum;
    return t;
}

// A sample of a pixel, of one channel.
float taken(taps t, uint channel)
{
    uint first = (hg_path_out(channel) - HG_PATH_OUT) * ring_plane();
    float sum = 0.0;
    for (uint i = from; i < to; i++)
        sum += hg_path.ring.v[first + t.at[i]] * t.weight[i];
    return sum;
}

// The pixel's own sample.
float own(taps t, uint channel)
{
    return hg_path.ring.v[(hg_path_out(channel) - HG_PATH_OUT) * ring_plane() + t.at[OWN]];
}

// Denoiser inputs are not splatted: the denoiser assumes independent noise of neighbouring pixels.
bool is_own(uint channel)
{
    uint moved = hg_path.planes[HG_PATH_PLANE_MOVED], guide = hg_path.planes[HG_PATH_PLANE_GUIDE];
    return HG_PATH_CAN(HG_PATH_PLANES) &&
        (channel >= guide || (channel >= moved && channel - moved < HG_PATH_MOVED_WORDS));
}

// HG_PATH_SHOWN_* of a sample.
float shown(taps t, uint guide, uint channel)
{
    if (channel == HG_PATH_SHOWN_HITS)
        return taken(t, guide + HG_PATH_GUIDE_HITS);
    if (channel >= HG_PATH_SHOWN_ALBEDO)
        return taken(t, guide + HG_PATH_GUIDE_ALBEDO + channel - HG_PATH_SHOWN_ALBEDO);
    return taken(t, guide + HG_PATH_GUIDE_DIRECT + channel) +
        taken(t, guide + HG_PATH_GUIDE_INDIRECT + channel) +
        taken(t, guide + HG_PATH_GUIDE_SPECULAR + channel);
}

// More of a sample for the name that it met, in a list of the pixel.
void list_name(uint list, uint pixels, float draw, float weight)
{
    bool open = true;
    for (uint i = 0u; i < HG_PATH_DRAWS_LENGTH; i++) {
        uint k = list + 2u * i * pixels;
        float there = hg_path.film.v[k];
        float count = hg_path.film.v[k + pixels];
        bool here = open && (there == 0.0 || there == draw);
        hg_path.film.v[k] = here ? draw : there;
        hg_path.film.v[k + pixels] = count + (here ? weight : 0.0);
        open = open && !here;
    }
}

void list_names(taps t, uint number, uint at, uint pixels, bool first)
{
    uint list = (hg_path.lists + number * 2u * HG_PATH_DRAWS_LENGTH) * pixels + at;
    uint ring = (hg_path_out(hg_path.planes[HG_PATH_PLANE_DRAWS]) - HG_PATH_OUT) * ring_plane();
    for (uint i = 0u; i < 2u * HG_PATH_DRAWS_LENGTH && first; i++)
        hg_path.film.v[list + i * pixels] = 0.0;
    for (uint i = from; i < to; i++) {
        uint draw = uint(hg_path.ring.v[ring + t.at[i]]);
        if (draw > 0u && t.weight[i] > 0.0) {
            uint name = hg_path.names.v[number * hg_path.name_draws + draw - 1u];
            list_name(list, pixels, float(name + 1u), t.weight[i]);
        }
    }
}

void add(uvec2 pixel, uint number)
{
    uint at = pixel.y * hg_frame.width + pixel.x, pixels = hg_frame.width * hg_frame.height;
    bool first = number == 0u;
    taps t = taps_of(pixel, number);
    vec3 color = vec3(taken(t, 0u), taken(t, 1u), taken(t, 2u));
    float luminance = dot(color, vec3(0.2126, 0.7152, 0.0722));
    uint object = hg_path.planes[HG_PATH_PLANE_OBJECT];
    uint material = hg_path.planes[HG_PATH_PLANE_MATERIAL];
    uint draws = hg_path.planes[HG_PATH_PLANE_DRAWS];
    uint moved = hg_path.planes[HG_PATH_PLANE_MOVED];
    uint what = moved == HG_PATH_NO_PLANE ? moved : moved + HG_PATH_MOVED_WHAT;
    uint guide = hg_path.planes[HG_PATH_PLANE_GUIDE];
    bool first_half = HG_PATH_IS_FIRST_HALF(number), gathers = HG_PATH_CAN(HG_PATH_GATHERS);
    uint halves = gathers ? HG_PATH_GUIDE_LIGHT : HG_PATH_GUIDE_CHANNELS;
    for (uint i = 0u; HG_PATH_CAN(HG_PATH_PLANES) && i < hg_path.list_count; i++)
        list_names(t, i, at, pixels, first);
    for (uint c = 0u; c < hg_path.channels; c++) {
        float value = luminance * luminance;
        if (c != HG_PATH_FILM_SQUARES)
            value = is_own(c) ? own(t, c) : taken(t, c);
        uint k = c * pixels + at;
        float before = first ? 0.0 : hg_path.film.v[k];
        if (c == object || c == material || c == draws || c == what) // of the first sample
            value = first ? own(t, c) : 0.0;
        hg_path.film.v[k] = before + value;
        if (HG_PATH_CAN(HG_PATH_PLANES) && c >= guide && c - guide < halves && first_half) {
            uint h = k + HG_PATH_GUIDE_CHANNELS * pixels;
            hg_path.film.v[h] = (first ? 0.0 : hg_path.film.v[h]) + value;
        }
    }
    for (uint c = 0u; !gathers && HG_PATH_HAS(HG_PATH_PLANE_GUIDE) && c < HG_PATH_SHOWN_CHANNELS; c++) {
        uint k = (guide + 2u * HG_PATH_GUIDE_CHANNELS + c) * pixels + at;
        hg_path.film.v[k] = (first ? 0.0 : hg_path.film.v[k]) + shown(t, guide, c);
    }
}

void main()
{
    uint slot = gl_GlobalInvocationID.x;
    uvec2 pixel = hg_path_pixel(min(slot, push.count - 1u));
    if (slot >= push.count || pixel.x >= hg_frame.width || pixel.y >= hg_frame.height)
        return;
    if (kind == 0u)
        keep(slot, pixel);
    else
        add(pixel, hg_path_sample(slot));
}
