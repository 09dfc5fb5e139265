// A 3D image sampled half a texel along x to another one: tests of the device room.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "shared/pass_io.h"

HG_TEST_VOLUME_IO(HG_IO_DECLARE)

layout(local_size_x = 4, local_size_y = 4, local_size_z = 4) in;

void main()
{
    ivec3 to = ivec3(gl_GlobalInvocationID);
    ivec3 size = imageSize(hg_volume_out);
    if (any(greaterThanEqual(to, size)))
        return;
    vec3 place = (vec3(to) + vec3(1.0, 0.5, 0.5)) / vec3(size);
    imageStore(hg_volume_out, to, textureLod(hg_volume, place, 0.0));
}
