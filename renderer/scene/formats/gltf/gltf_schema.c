#include "renderer/scene/formats/gltf/gltf_schema.h"

#include <stddef.h>
#include <string.h>

#define REQ  HG_SCHEMA_REQUIRED
#define SOFT HG_SCHEMA_SOFT
#define BIG  9007199254740992.0
#define OBJECT(variable, ...)                                                                      \
    static const struct hg_schema_object variable = {                                              \
        (const struct hg_schema_member[]){__VA_ARGS__, NAMED, {.name = NULL}}}
#define BARE(variable, ...)                                                                        \
    static const struct hg_schema_object variable = {                                              \
        (const struct hg_schema_member[]){__VA_ARGS__, {.name = NULL}}}
#define NAMED                                                                                      \
    {                                                                                              \
        "name", HG_SCHEMA_STRING, SOFT, 0, 0, NULL, NULL                                           \
    }

#define OBJ(n, f, child)                                                                           \
    {                                                                                              \
        n, HG_SCHEMA_OBJECT, f, 0, 0, NULL, child                                                  \
    }
#define OBJS(n, f, child)                                                                          \
    {                                                                                              \
        n, HG_SCHEMA_OBJECTS, f, 0, 0, NULL, child                                                 \
    }
#define STR(n, f, values)                                                                          \
    {                                                                                              \
        n, HG_SCHEMA_STRING, f, 0, 0, values, NULL                                                 \
    }
#define STRS(n, f)                                                                                 \
    {                                                                                              \
        n, HG_SCHEMA_STRINGS, f, 0, 0, NULL, NULL                                                  \
    }
#define NUM(n, f, low, high)                                                                       \
    {                                                                                              \
        n, HG_SCHEMA_NUMBER, f, low, high, NULL, NULL                                              \
    }
#define INT(n, f, low, high)                                                                       \
    {                                                                                              \
        n, HG_SCHEMA_INTEGER, f, low, high, NULL, NULL                                             \
    }
#define BOOL(n)                                                                                    \
    {                                                                                              \
        n, HG_SCHEMA_BOOLEAN, 0, 0, 0, NULL, NULL                                                  \
    }
#define IDX(n, f, array)                                                                           \
    {                                                                                              \
        n, HG_SCHEMA_INDEX, f, 0, 0, array, NULL                                                   \
    }
#define IDXS(n, f, array)                                                                          \
    {                                                                                              \
        n, HG_SCHEMA_INDEXES, f, 0, 0, array, NULL                                                 \
    }
#define NUMS(n, f, low, high)                                                                      \
    {                                                                                              \
        n, HG_SCHEMA_NUMBERS, f, low, high, NULL, NULL                                             \
    }
#define MAP(n, f, array)                                                                           \
    {                                                                                              \
        n, HG_SCHEMA_MAP, f, 0, 0, array, NULL                                                     \
    }

// ---- core --------------------------------------------------------------------------------------

BARE(sparse_indices, IDX("bufferView", REQ, "bufferViews"), INT("byteOffset", 0, 0, BIG),
    INT("componentType", REQ, 5121, 5125));
BARE(sparse_values, IDX("bufferView", REQ, "bufferViews"), INT("byteOffset", 0, 0, BIG));
BARE(sparse, INT("count", REQ, 1, BIG), OBJ("indices", REQ, &sparse_indices),
    OBJ("values", REQ, &sparse_values));
OBJECT(accessor, IDX("bufferView", 0, "bufferViews"), INT("byteOffset", 0, 0, BIG),
    INT("componentType", REQ, 5120, 5126), BOOL("normalized"), INT("count", REQ, 1, BIG),
    STR("type", REQ, "SCALAR VEC2 VEC3 VEC4 MAT2 MAT3 MAT4"), NUMS("max", 0, 1, 16),
    NUMS("min", 0, 1, 16), OBJ("sparse", 0, &sparse));

BARE(channel_target, IDX("node", 0, "nodes"),
    STR("path", REQ, "translation rotation scale weights pointer"));
BARE(channel, INT("sampler", REQ, 0, BIG), OBJ("target", REQ, &channel_target));
BARE(animation_sampler, IDX("input", REQ, "accessors"),
    STR("interpolation", 0, "LINEAR STEP CUBICSPLINE"), IDX("output", REQ, "accessors"));
OBJECT(animation, OBJS("channels", REQ, &channel), OBJS("samplers", REQ, &animation_sampler));

BARE(asset, STR("copyright", SOFT, NULL), STR("generator", SOFT, NULL), STR("version", REQ, NULL),
    STR("minVersion", 0, NULL));

OBJECT(buffer, STR("uri", 0, NULL), INT("byteLength", REQ, 1, BIG));
OBJECT(buffer_view, IDX("buffer", REQ, "buffers"), INT("byteOffset", 0, 0, BIG),
    INT("byteLength", REQ, 1, BIG), INT("byteStride", 0, 4, 252), INT("target", 0, 34962, 34963));

BARE(orthographic, NUM("xmag", REQ, 0, 0), NUM("ymag", REQ, 0, 0), NUM("zfar", REQ, 1e-30, BIG),
    NUM("znear", REQ, 0, BIG));
BARE(perspective, NUM("aspectRatio", 0, 1e-30, BIG), NUM("yfov", REQ, 1e-30, BIG),
    NUM("zfar", 0, 1e-30, BIG), NUM("znear", REQ, 1e-30, BIG));
OBJECT(camera, OBJ("orthographic", 0, &orthographic), OBJ("perspective", 0, &perspective),
    STR("type", REQ, "perspective orthographic"));

OBJECT(image, STR("uri", 0, NULL), STR("mimeType", 0, "image/jpeg image/png image/webp image/ktx2"),
    IDX("bufferView", 0, "bufferViews"));

BARE(texture_info, IDX("index", REQ, "textures"), INT("texCoord", 0, 0, BIG));
BARE(normal_info, IDX("index", REQ, "textures"), INT("texCoord", 0, 0, BIG), NUM("scale", 0, 0, 0));
BARE(occlusion_info, IDX("index", REQ, "textures"), INT("texCoord", 0, 0, BIG),
    NUM("strength", 0, 0, 1));
BARE(metallic_roughness, NUMS("baseColorFactor", 0, 4, 4),
    OBJ("baseColorTexture", 0, &texture_info), NUM("metallicFactor", 0, 0, 1),
    NUM("roughnessFactor", 0, 0, 1), OBJ("metallicRoughnessTexture", 0, &texture_info));
OBJECT(material, OBJ("pbrMetallicRoughness", 0, &metallic_roughness),
    OBJ("normalTexture", 0, &normal_info), OBJ("occlusionTexture", 0, &occlusion_info),
    OBJ("emissiveTexture", 0, &texture_info), NUMS("emissiveFactor", 0, 3, 3),
    STR("alphaMode", 0, "OPAQUE MASK BLEND"), NUM("alphaCutoff", 0, 0, BIG), BOOL("doubleSided"));

BARE(primitive, MAP("attributes", REQ, "accessors"), IDX("indices", 0, "accessors"),
    IDX("material", 0, "materials"), INT("mode", 0, 0, 6),
    {"targets", HG_SCHEMA_OBJECTS, 0, 0, 0, "accessors", NULL});
OBJECT(mesh, OBJS("primitives", REQ, &primitive), NUMS("weights", 0, 1, BIG));

OBJECT(node, IDX("camera", 0, "cameras"), IDXS("children", 0, "nodes"), IDX("skin", 0, "skins"),
    NUMS("matrix", 0, 16, 16), IDX("mesh", 0, "meshes"), NUMS("rotation", 0, 4, 4),
    NUMS("scale", 0, 3, 3), NUMS("translation", 0, 3, 3), NUMS("weights", 0, 1, BIG));

OBJECT(sampler, INT("magFilter", 0, 9728, 9729), INT("minFilter", 0, 9728, 9987),
    INT("wrapS", 0, 10497, 33648), INT("wrapT", 0, 10497, 33648));
OBJECT(scene, IDXS("nodes", 0, "nodes"));
OBJECT(skin, IDX("inverseBindMatrices", 0, "accessors"), IDX("skeleton", 0, "nodes"),
    IDXS("joints", REQ, "nodes"));
OBJECT(texture, IDX("sampler", 0, "samplers"), IDX("source", 0, "images"));

const struct hg_schema_object hg_gltf_schema = {(const struct hg_schema_member[]){
    STRS("extensionsUsed", 0), STRS("extensionsRequired", 0), OBJS("accessors", 0, &accessor),
    OBJS("animations", 0, &animation), OBJ("asset", REQ, &asset), OBJS("buffers", 0, &buffer),
    OBJS("bufferViews", 0, &buffer_view), OBJS("cameras", 0, &camera), OBJS("images", 0, &image),
    OBJS("materials", 0, &material), OBJS("meshes", 0, &mesh), OBJS("nodes", 0, &node),
    OBJS("samplers", 0, &sampler), IDX("scene", 0, "scenes"), OBJS("scenes", 0, &scene),
    OBJS("skins", 0, &skin), OBJS("textures", 0, &texture), {.name = NULL}}};

// ---- extensions --------------------------------------------------------------------------------

BARE(transform, NUMS("offset", 0, 2, 2), NUM("rotation", 0, 0, 0), NUMS("scale", 0, 2, 2),
    INT("texCoord", 0, 0, BIG));
BARE(meshopt, IDX("buffer", 0, "buffers"), INT("byteOffset", 0, 0, BIG),
    INT("byteLength", 0, 1, BIG), INT("byteStride", 0, 2, 256), INT("count", 0, 1, BIG),
    STR("mode", 0, "ATTRIBUTES TRIANGLES INDICES"),
    STR("filter", 0, "NONE OCTAHEDRAL QUATERNION EXPONENTIAL"), BOOL("fallback"));
BARE(draco, IDX("bufferView", REQ, "bufferViews"), MAP("attributes", REQ, NULL));
BARE(other_image, IDX("source", 0, "images")); // webp, basisu
BARE(instancing, MAP("attributes", REQ, "accessors"));
BARE(spot, NUM("innerConeAngle", 0, 0, 1.5708), NUM("outerConeAngle", 0, 1e-30, 1.5709));
OBJECT(light, NUMS("color", 0, 3, 3), NUM("intensity", 0, 0, BIG), OBJ("spot", 0, &spot),
    STR("type", REQ, "directional point spot"), NUM("range", 0, 1e-30, BIG));
BARE(lights, OBJS("lights", 0, &light), INT("light", 0, 0, BIG));
OBJECT(ies_light, STR("uri", 0, NULL), IDX("bufferView", 0, "bufferViews"),
    STR("mimeType", 0, "application/x-ies-lm-63"));
BARE(ies_lights, OBJS("lights", 0, &ies_light), INT("light", 0, 0, BIG),
    NUM("multiplier", 0, 0, BIG), NUMS("color", 0, 3, 3));
BARE(unlit, NAMED);
BARE(emissive_strength, NUM("emissiveStrength", 0, 0, BIG));
OBJECT(variant, STR("name", REQ, NULL));
BARE(mapping, {"variants", HG_SCHEMA_INDEXES, REQ, 0, 0, NULL, NULL},
    IDX("material", REQ, "materials"), STR("name", SOFT, NULL));
BARE(variants, OBJS("variants", 0, &variant), OBJS("mappings", 0, &mapping));
BARE(spec_gloss, NUMS("diffuseFactor", 0, 4, 4), OBJ("diffuseTexture", 0, &texture_info),
    NUMS("specularFactor", 0, 3, 3), NUM("glossinessFactor", 0, 0, 1),
    OBJ("specularGlossinessTexture", 0, &texture_info));
BARE(clearcoat, NUM("clearcoatFactor", 0, 0, 1), OBJ("clearcoatTexture", 0, &texture_info),
    NUM("clearcoatRoughnessFactor", 0, 0, 1), OBJ("clearcoatRoughnessTexture", 0, &texture_info),
    OBJ("clearcoatNormalTexture", 0, &normal_info));
BARE(sheen, NUMS("sheenColorFactor", 0, 3, 3), OBJ("sheenColorTexture", 0, &texture_info),
    NUM("sheenRoughnessFactor", 0, 0, 1), OBJ("sheenRoughnessTexture", 0, &texture_info));
BARE(
    transmission, NUM("transmissionFactor", 0, 0, 1), OBJ("transmissionTexture", 0, &texture_info));
BARE(volume, NUM("thicknessFactor", 0, 0, BIG), OBJ("thicknessTexture", 0, &texture_info),
    NUM("attenuationDistance", 0, 0, 0), NUMS("attenuationColor", 0, 3, 3));
BARE(ior, NUM("ior", 0, 0, BIG));
BARE(specular, NUM("specularFactor", 0, 0, 1), OBJ("specularTexture", 0, &texture_info),
    NUMS("specularColorFactor", 0, 3, 3), OBJ("specularColorTexture", 0, &texture_info));
BARE(iridescence, NUM("iridescenceFactor", 0, 0, 1), OBJ("iridescenceTexture", 0, &texture_info),
    NUM("iridescenceIor", 0, 1, BIG), NUM("iridescenceThicknessMinimum", 0, 0, BIG),
    NUM("iridescenceThicknessMaximum", 0, 0, BIG),
    OBJ("iridescenceThicknessTexture", 0, &texture_info));
BARE(anisotropy, NUM("anisotropyStrength", 0, 0, 1), NUM("anisotropyRotation", 0, 0, 0),
    OBJ("anisotropyTexture", 0, &texture_info));
BARE(dispersion, NUM("dispersion", 0, 0, BIG));
BARE(diffuse_transmission, NUM("diffuseTransmissionFactor", 0, 0, 1),
    OBJ("diffuseTransmissionTexture", 0, &texture_info),
    NUMS("diffuseTransmissionColorFactor", 0, 3, 3),
    OBJ("diffuseTransmissionColorTexture", 0, &texture_info));

const struct hg_schema_object *hg_gltf_extension_schema(const char *name)
{
    static const struct {
        const char *name;
        const struct hg_schema_object *schema;
    } table[] = {{"KHR_texture_transform", &transform}, {"EXT_meshopt_compression", &meshopt},
        {"KHR_draco_mesh_compression", &draco}, {"EXT_texture_webp", &other_image},
        {"KHR_texture_basisu", &other_image}, {"EXT_mesh_gpu_instancing", &instancing},
        {"KHR_lights_punctual", &lights}, {"EXT_lights_ies", &ies_lights},
        {"KHR_materials_unlit", &unlit}, {"KHR_materials_emissive_strength", &emissive_strength},
        {"KHR_materials_variants", &variants}, {"KHR_materials_pbrSpecularGlossiness", &spec_gloss},
        {"KHR_materials_clearcoat", &clearcoat}, {"KHR_materials_sheen", &sheen},
        {"KHR_materials_transmission", &transmission}, {"KHR_materials_volume", &volume},
        {"KHR_materials_ior", &ior}, {"KHR_materials_specular", &specular},
        {"KHR_materials_iridescence", &iridescence}, {"KHR_materials_anisotropy", &anisotropy},
        {"KHR_materials_dispersion", &dispersion},
        {"KHR_materials_diffuse_transmission", &diffuse_transmission}};
    for (size_t i = 0; i < sizeof table / sizeof *table; i++)
        if (strcmp(table[i].name, name) == 0)
            return table[i].schema;
    return NULL;
}
