// For tests of specialisation: every kind of branch on constants, on what the host passes, on both.
#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

layout(local_size_x = 64) in;

layout(constant_id = 0) const uint bits = 0u;
layout(constant_id = 1) const int step = -3;
layout(constant_id = 2) const bool loud = false;

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer words {
    uint v[];
};
layout(push_constant, scalar) uniform block {
    words target;
    uint count, value;
} push;

#define HAS(bit) ((bits & (bit)) != 0u)

const uint mixed = (bits << 3) + (HAS(2u) ? 7u : 11u);

uint leaves_early(uint i)
{
    if (HAS(1u))
        return i + 100u;
    if (i > 20u)
        return HAS(2u) ? 1u : 2u;
    return 3u;
}

uint only_sometimes(uint i)
{
    uint sum = 0u;
    for (uint k = 0u; k < 8u; k++) {
        if (HAS(4u) && k == 3u)
            continue;
        if (HAS(8u) || (k > 5u && i % 2u == 0u))
            break;
        sum += k + leaves_early(k);
    }
    return sum;
}

uint ends_in_all_ways(uint i)
{
    if (HAS(16u) && !loud)
        return 5u;
    else
        return i * 2u;
}

uint turns(uint i)
{
    for (;;) {
        if (HAS(32u))
            return 9u;
        i += 5u;
        if (i > 40u)
            break;
    }
    return i;
}

uint chooses(uint i)
{
    switch (i % 4u) {
    case 0u:
        if (HAS(64u))
            break;
        return 1u;
    case 1u:
        if (loud || step > 0)
            return uint(step + 50);
    case 2u:
        return 8u;
    default:
        return 4u;
    }
    return mixed;
}

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count)
        return;
    uint result = push.value;
    if (!HAS(128u) && (loud != HAS(1u)))
        result += only_sometimes(i) * 3u;
    result = result * 31u + ends_in_all_ways(i);
    result = result * 31u + turns(i);
    result = result * 31u + chooses(i);
    push.target.v[i] = result;
}
