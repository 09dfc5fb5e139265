// Mean of four texels of one mip to the next: storage images in the tests of the device room.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "shared/pass_io.h"

HG_TEST_MIP_IO(HG_IO_DECLARE)

layout(local_size_x = 8, local_size_y = 8) in;

void main()
{
    ivec2 to = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(to, imageSize(hg_coarser))))
        return;
    float sum = 0.0;
    for (int i = 0; i < 4; i++)
        sum += imageLoad(hg_finer, 2 * to + ivec2(i & 1, i >> 1)).r;
    imageStore(hg_coarser, to, vec4(0.25 * sum));
}
