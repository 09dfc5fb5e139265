// path_lights.glsl - lights with a size that the ray of a path meets. They are seen by all rays but those of
// the camera, hold nothing back, and the path goes on.
//
// Define struct path, weight_found and clamped first; include lib/path.glsl and lib/emitters.glsl.
#ifndef HG_LIB_PATH_LIGHTS_GLSL
#define HG_LIB_PATH_LIGHTS_GLSL

#define MOST_OPEN_NODES 32u // depth of the tree, and one

// Light of one of them, that the ray meets; pdf: with which rays to lights would have found it.
void found_light(path p, hg_gpu_light light, float distance, float pdf, uint candidates,
    vec3 throughput, uvec2 media)
{
    vec3 radiance = hg_light_radiance(light, p.ray.origin_ws) * weight_found(p, pdf, candidates);
    if (distance < HG_EMITTER_FAR)
        radiance *= hg_light_surface_tint(
            light, p.ray.origin_ws + p.ray.direction_ws * distance - light.position_ws);
    if (HG_MEDIA && distance < HG_EMITTER_FAR)
        throughput *= hg_bsdf_attenuation(hg_media_attenuation(media), distance);
    uint group = hg_path.light_groups.v[light.id] & HG_PATH_GROUP_MASK;
    hg_path_light(p.slot, p.bounce, 0u, group, clamped(throughput * radiance, p.bounce));
}

// Where the ray enters a box, less than `most` away.
bool meets_box(vec3 low, vec3 high, vec3 origin, vec3 inverse, float most)
{
    vec3 a = (low - origin) * inverse, b = (high - origin) * inverse;
    vec3 near = min(a, b), far = max(a, b);
    float begin = max(near.x, max(near.y, near.z)), end = min(far.x, min(far.y, far.z));
    return begin <= end * (1.0 + 1e-6) && end >= 0.0 && begin <= most;
}

void meet_lamp(path p, uint lamp, float most, vec3 throughput, uvec2 media)
{
    hg_gpu_light light = light_at(HG_EMITTERS.directional_count + lamp);
    hg_shape_hit hit = hg_shape_meet(light, p.ray.origin_ws, p.ray.direction_ws);
    // What casts no shadow is seen through everything, as rays to it are.
    if (hit.distance <= 0.0 || (light.shadow != HG_SHADOW_UNASKED && hit.distance >= most))
        return;
    float pdf = hg_emitter_pdf_lamp(p.ray.origin_ws, p.normal, lamp, light, hit);
    found_light(p, light, hit.distance, pdf, CANDIDATES, throughput, media);
}

void meet_suns(path p, bool out_of_scene, vec3 throughput, uvec2 media)
{
    for (uint i = 0u; i < HG_EMITTERS.directional_count; i++) {
        hg_gpu_light light = light_at(i);
        if (light.radiance <= 0.0 || -dot(light.direction_ws, p.ray.direction_ws) < light.bound ||
            !(out_of_scene || light.shadow == HG_SHADOW_UNASKED))
            continue;
        float pdf = hg_emitter_pdf_sun(p.ray.origin_ws, p.normal, i, light);
        found_light(p, light, HG_EMITTER_FAR, pdf, HG_EMITTER_APART ? 1u : CANDIDATES, throughput, media);
    }
}

// throughput: of the path before the medium took from it; media: around the ray; most: metres that the
// ray went, HG_EMITTER_FAR where it left the scene.
void meet_lights(path p, float most, vec3 throughput, uvec2 media)
{
    if (!HG_EMITTER_MAY(HG_EMITTER_KIND_SIZED) || p.bounce == 0u)
        return;
    bool drawn = HG_PATH_CAN(HG_PATH_GATHERS) && p.bounce == 1u; // real time draws suns
    if (HG_EMITTERS.sized_suns != 0u && !drawn)
        meet_suns(p, most >= HG_EMITTER_FAR, throughput, media);
    if (HG_EMITTERS.lamp_node_count == 0u)
        return;
    vec3 inverse = 1.0 / mix(p.ray.direction_ws, vec3(1e-20), equal(p.ray.direction_ws, vec3(0.0)));
    uint open[MOST_OPEN_NODES];
    uint count = 1u;
    open[0] = 0u;
    for (uint i = 0u; i < 65536u && count > 0u; i++) {
        hg_gpu_light_node node = HG_EMITTERS.lamp_nodes.v[open[--count]];
        if (!meets_box(node.min, node.max, p.ray.origin_ws, inverse, HG_EMITTER_FAR))
            continue;
        if ((node.child & HG_EMITTER_IS_LEAF) != 0u) {
            meet_lamp(p, node.child & ~HG_EMITTER_IS_LEAF, most, throughput, media);
        } else if (count + 2u <= MOST_OPEN_NODES) {
            open[count++] = node.child + 1u;
            open[count++] = node.child;
        }
    }
}

#endif
