// Sorts the lists of more than one node front to back; the depth test chooses their pixels.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"

layout(early_fragment_tests) in;

layout(push_constant, scalar) uniform hg_push
{
    hg_blend_reports reports;
    uvec2 first; // pixel of the area
    uint report;
    uvec2 end; // of the area; first: all of the frame
} push;

#define NODE(i) hg_frame.blend.nodes.v[i]

// Nearest first; at the same depth in draw order.
bool before(uint a, uint b)
{
    float da = NODE(a).depth, db = NODE(b).depth;
    uvec2 ia = uvec2(NODE(a).draw, NODE(a).primitive), ib = uvec2(NODE(b).draw, NODE(b).primitive);
    return da > db || (da == db && (ia.x < ib.x || (ia.x == ib.x && ia.y <= ib.y)));
}

// Of count nodes; a bottom-up merge sort that moves links only. Returns the first. Rounds are counted,
// here and below, so that no content of the lists makes it run for ever.
// Source: Knuth 1998, "The Art of Computer Programming" vol. 3, section 5.2.4, algorithm L.
uint sort(uint head, uint count)
{
    for (uint width = 1u; width < count; width *= 2u) {
        uint p = head, tail = 0u;
        head = 0u;
        for (uint merged = 0u; merged < count && p != 0u; merged += 2u * width) {
            uint q = p, ps = 0u, qs = width;
            while (ps < width && q != 0u) {
                q = NODE(q).next;
                ps++;
            }
            while (ps > 0u || (qs > 0u && q != 0u)) {
                bool first = ps > 0u && (qs == 0u || q == 0u || before(p, q));
                uint taken = first ? p : q, next = NODE(taken).next;
                p = first ? next : p;
                q = first ? q : next;
                ps -= first ? 1u : 0u;
                qs -= first ? 0u : 1u;
                if (tail == 0u)
                    head = taken;
                else
                    NODE(tail).next = taken;
                tail = taken;
            }
            p = q;
        }
        NODE(tail).next = 0u;
    }
    return head;
}

// Cuts the list after so many nodes; true where it was longer. *count: its length.
bool cut(uint head, uint most, out uint count)
{
    uint at = head, last = 0u;
    count = 0u;
    while (at != 0u && count < most) {
        last = at;
        at = NODE(at).next;
        count++;
    }
    if (at != 0u)
        NODE(last).next = 0u;
    return at != 0u;
}

// Of surfaces at the same depth the first is seen.
void drop_equals(uint head, uint count)
{
    uint at = head;
    for (uint i = 0u; i < count && at != 0u; i++) {
        uint next = NODE(at).next;
        bool same = next != 0u && NODE(next).depth == NODE(at).depth;
        if (same)
            NODE(at).next = NODE(next).next;
        at = same ? at : next;
    }
}

void main()
{
    // Helper invocations beyond the area would follow old lists, and links that they wrote in vain: for
    // ever. (gl_HelperInvocation is not for llvmpipe of Mesa 22.)
    uvec2 pixel = uvec2(gl_FragCoord.xy);
    uvec2 end = push.end == push.first ? uvec2(hg_frame.width, hg_frame.height) : push.end;
    if (any(lessThan(pixel, push.first)) || any(greaterThanEqual(pixel, end)))
        return;
    uint place = pixel.y * hg_frame.width + pixel.x, count, kept;
    bool too_deep = cut(hg_frame.blend.heads.v[place], HG_BLEND_MAX_SORTED, count);
    uint head = sort(hg_frame.blend.heads.v[place], count);
    drop_equals(head, count);
    too_deep = cut(head, HG_BLEND_MAX_LAYERS, kept) || too_deep;
    hg_frame.blend.heads.v[place] = head;
    if (too_deep)
        atomicOr(push.reports.v[push.report].too_deep, 1u);
}
