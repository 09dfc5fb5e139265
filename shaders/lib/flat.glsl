// flat.glsl - words of the frame that come to fragments with the vertices of a full-screen triangle.
//
// Fragment shaders of Mesa's software rasteriser read every uniform word lane by lane, constant
// offsets and push constants included (25 instructions); a flat input is one broadcast for 16
// pixels. Such passes define HG_FRAME_FLAT (HG_FLAT_SENDS in the vertex shader): then hg_frame is a
// copy whose most used words are these, and hg_sun and hg_sun_map are the only light and its last
// shadow map (not HG_FEATURE_NO_SUN).
// Include lib/tables.glsl first.
#ifndef HG_LIB_FLAT_GLSL
#define HG_LIB_FLAT_GLSL

#ifdef HG_FLAT_SENDS
#define HG_FLAT out
#else
#define HG_FLAT in
#endif
layout(location = 0) flat HG_FLAT vec4 hg_flat[15];
layout(location = 15) flat HG_FLAT uvec4 hg_flat_bits[3];

hg_gpu_light hg_sun;
hg_gpu_shadow hg_sun_map;

#ifdef HG_FLAT_SENDS
void hg_flat_send()
{
    hg_sun.shadow = HG_SHADOW_NONE;
    hg_sun.shadow_count = 0u;
    if (hg_frame.lighting.light_count > 0u)
        hg_sun = hg_light_at(0u);
    if (hg_sun.shadow != HG_SHADOW_NONE)
        hg_sun_map = hg_shadow_at(hg_sun.shadow + hg_sun.shadow_count - 1u);
    hg_gpu_camera c = hg_frame.camera;
    hg_gpu_lighting l = hg_frame.lighting;
    hg_flat[0] = vec4(c.eye_ws, hg_frame.textures.bias);
    hg_flat[1] = vec4(c.forward_ws, l.env_specular_lods);
    hg_flat[2] = vec4(c.ray_origin_ws, l.env_rotation_cos);
    hg_flat[3] = vec4(c.ray_x_ws, l.env_rotation_sin);
    hg_flat[4] = vec4(c.ray_y_ws, hg_frame.exposure);
    hg_flat[5] = vec4(l.env_color, l.shadow_inv_size);
    hg_flat[6] = vec4(l.shadow_taps_px[0], l.shadow_taps_px[1]);
    hg_flat[7] = vec4(l.shadow_taps_px[2], l.shadow_taps_px[3]);
    hg_flat[8] = vec4(hg_sun.direction_ws, l.shadow_dither);
    hg_flat[9] = vec4(hg_sun.color, l.shadow_slack_m);
    hg_flat[10] = vec4(hg_sun_map.origin_ws, hg_sun_map.scale);
    hg_flat[11] = vec4(hg_sun_map.right_ws, hg_sun_map.depth_scale);
    hg_flat[12] = vec4(hg_sun_map.up_ws, hg_sun_map.texel_size);
    hg_flat[13] = vec4(hg_sun_map.forward_ws, l.shadow_slack_per_m);
    hg_flat[14] = vec4(hg_sun_map.rect_px, hg_sun_map.size_px, hg_sun_map.extent);
    hg_flat_bits[0] = uvec4(c.orthographic, hg_frame.sample_index, hg_frame.seed, hg_frame.flags);
    hg_flat_bits[1] = uvec4(l.env_kind, hg_sun.shadow, hg_sun.shadow_count, l.light_count);
    hg_flat_bits[2] = uvec4(hg_frame.textures.mode, hg_frame.textures.run,
        hg_frame.textures.lottery, l.global_count);
}
#else
void hg_flat_receive()
{
    hg_frame = hg_frame_uniform;
    hg_frame.camera.eye_ws = hg_flat[0].xyz;
    hg_frame.textures.bias = hg_flat[0].w;
    hg_frame.camera.forward_ws = hg_flat[1].xyz;
    hg_frame.lighting.env_specular_lods = hg_flat[1].w;
    hg_frame.camera.ray_origin_ws = hg_flat[2].xyz;
    hg_frame.lighting.env_rotation_cos = hg_flat[2].w;
    hg_frame.camera.ray_x_ws = hg_flat[3].xyz;
    hg_frame.lighting.env_rotation_sin = hg_flat[3].w;
    hg_frame.camera.ray_y_ws = hg_flat[4].xyz;
    hg_frame.exposure = hg_flat[4].w;
    hg_frame.lighting.env_color = hg_flat[5].xyz;
    hg_frame.lighting.shadow_inv_size = hg_flat[5].w;
    hg_frame.lighting.shadow_taps_px[0] = hg_flat[6].xy;
    hg_frame.lighting.shadow_taps_px[1] = hg_flat[6].zw;
    hg_frame.lighting.shadow_taps_px[2] = hg_flat[7].xy;
    hg_frame.lighting.shadow_taps_px[3] = hg_flat[7].zw;
    hg_sun.direction_ws = hg_flat[8].xyz;
    hg_frame.lighting.shadow_dither = hg_flat[8].w;
    hg_sun.color = hg_flat[9].xyz;
    hg_frame.lighting.shadow_slack_m = hg_flat[9].w;
    hg_sun_map.origin_ws = hg_flat[10].xyz;
    hg_sun_map.scale = hg_flat[10].w;
    hg_sun_map.right_ws = hg_flat[11].xyz;
    hg_sun_map.depth_scale = hg_flat[11].w;
    hg_sun_map.up_ws = hg_flat[12].xyz;
    hg_sun_map.texel_size = hg_flat[12].w;
    hg_sun_map.forward_ws = hg_flat[13].xyz;
    hg_frame.lighting.shadow_slack_per_m = hg_flat[13].w;
    hg_sun_map.rect_px = hg_flat[14].xy;
    hg_sun_map.size_px = hg_flat[14].z;
    hg_sun_map.extent = hg_flat[14].w;
    hg_sun_map.perspective = 0u;
    hg_frame.camera.orthographic = hg_flat_bits[0].x;
    hg_frame.sample_index = hg_flat_bits[0].y;
    hg_frame.seed = hg_flat_bits[0].z;
    hg_frame.flags = hg_flat_bits[0].w;
    hg_frame.lighting.env_kind = hg_flat_bits[1].x;
    hg_sun.shadow = hg_flat_bits[1].y;
    hg_sun.shadow_count = hg_flat_bits[1].z;
    hg_sun.kind = HG_LIGHT_KIND_DIRECTIONAL;
    hg_frame.lighting.light_count = hg_flat_bits[1].w;
    hg_frame.textures.mode = hg_flat_bits[2].x;
    hg_frame.textures.run = hg_flat_bits[2].y;
    hg_frame.textures.lottery = hg_flat_bits[2].z;
    hg_frame.lighting.global_count = hg_flat_bits[2].w;
}
#endif

#endif
