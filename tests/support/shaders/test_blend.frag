// A tenth of one image and another: tests of the frame graph.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "shared/pass_io.h"

HG_TEST_BLEND_IO(HG_IO_DECLARE)

layout(location = 0) out vec4 out_color;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    out_color = 0.1 * texelFetch(hg_first, pixel, 0) + texelFetch(hg_second, pixel, 0);
}
