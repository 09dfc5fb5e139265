// ground.glsl - a ground below the scene, of which only the shadow on it is seen, from above.
//
// Nothing of the scene lies below it, so a ray that meets nothing else meets it in front of the
// background. Include lib/frame.glsl first; with lib/light.glsl and lib/environment.glsl before it,
// it has the shadow of real-time pictures.
#ifndef HG_LIB_GROUND_GLSL
#define HG_LIB_GROUND_GLSL

// Lengths of `ray` from a point to the ground; 0: it is not met, or from below.
float hg_ground_distance(vec3 from_ws, vec3 ray)
{
    float down = -dot(hg_frame.ground_up, ray);
    float above = dot(hg_frame.ground_up, from_ws) - hg_frame.ground_height;
    return down > 0.0 && above > 0.0 ? above / down : 0.0;
}

#if defined(HG_LIB_LIGHT_GLSL) && defined(HG_LIB_ENVIRONMENT_GLSL)
float hg_ground_luminance(vec3 c)
{
    return dot(c, vec3(0.2126, 0.7152, 0.0722));
}

// Light on a white surface from one light: x as it arrives, y if nothing was in its way.
vec2 hg_ground_light(uint index, vec3 pos_ws)
{
    hg_gpu_light light = hg_light_at(index);
    vec3 l, n = hg_frame.ground_up;
    vec3 e = hg_light_illuminance(light, pos_ws, l);
    if (HG_HAS2(HG_FEATURE2_SIZED) && light.radiance > 0.0)
        e *= hg_light_lobe(light, l);
    float cosine = dot(n, l);
    float sum = hg_ground_luminance(e) * max(cosine, 0.0) * HG_INV_PI;
    if (!(sum > 0.0))
        return vec2(0.0);
    bool shadow = HG_HAS(HG_FEATURE_SHADOWS) && light.shadow != HG_SHADOW_NONE;
    return vec2(shadow ? hg_shadow(light, pos_ws, n, l, false) : 1.0, 1.0) * sum;
}

// Share of the light that reaches a point of the ground, luminance: as paths estimate it for a
// shadow catcher, but that the scene hides nothing of the environment.
float hg_ground_lit(vec3 pos_ws, vec2 pixel, float view_depth)
{
    vec2 sum = vec2(hg_ground_luminance(hg_environment_irradiance(hg_frame.ground_up)));
    if (!HG_HAS(HG_FEATURE_LIGHTS))
        return 1.0;
#ifdef HG_FRAME_FLAT
    if (!HG_HAS(HG_FEATURE_NO_SUN)) {
        vec3 l = -hg_sun.direction_ws;
        float e = hg_ground_luminance(hg_sun.color) * max(dot(hg_frame.ground_up, l), 0.0) * HG_INV_PI;
        bool shadow = HG_HAS(HG_FEATURE_SHADOWS) && hg_sun.shadow != HG_SHADOW_NONE && e > 0.0;
        sum += vec2(shadow ? hg_shadow_of_sun(pos_ws, hg_frame.ground_up, l) : 1.0, 1.0) * e;
        return sum.y > 0.0 ? sum.x / sum.y : 1.0;
    }
#endif
    uint everywhere = hg_frame.lighting.global_count;
    if (!HG_HAS(HG_FEATURE_CLUSTERS) || hg_frame.lighting.clustered == 0u)
        everywhere = hg_frame.lighting.light_count;
    for (uint i = 0u; i < everywhere; i++)
        sum += hg_ground_light(i, pos_ws);
    if (HG_HAS(HG_FEATURE_CLUSTERS) && hg_frame.lighting.clustered != 0u) {
        uint cluster = hg_light_cluster(pixel, view_depth);
        uint end = hg_frame.lighting.clusters.v[cluster + 1u];
        for (uint k = hg_frame.lighting.clusters.v[cluster]; k < end; k++)
            sum += hg_ground_light(hg_frame.lighting.cluster_lights.v[k], pos_ws);
    }
    return sum.y > 0.0 ? sum.x / sum.y : 1.0;
}
#endif

#endif
