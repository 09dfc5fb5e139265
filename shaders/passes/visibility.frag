// Draw and primitive of the nearest surface.
#version 460

layout(location = 0) flat in uint in_draw;
layout(location = 0) out uvec2 out_visibility;

void main()
{
    out_visibility = uvec2(in_draw + 1u, gl_PrimitiveID);
}
