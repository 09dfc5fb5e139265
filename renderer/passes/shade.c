#include "renderer/passes/shade.h"

#include "shaders/shared/unlit_tiles.h"
#include "shaders/shared/features.h"

static const struct hg_gpu_io shade_io = HG_GPU_IO(HG_SHADE_IO);
struct shade_inputs {
    HG_SHADE_IO(HG_GPU_IO_MEMBER)
};

// Values of the specialisation constant of shade.frag. LAYER: the nearest one; ALONE: the
// background of transmissive layers; LAYERS: of lists.
enum variant { OPAQUE, OPAQUE_BEHIND, LAYER, ALONE, LAYERS };

struct style {
    enum variant variant;
    bool background, first;
    bool unlit;       // no light reaches it
    bool masked;      // some pixels are left out
    bool flat;        // shade_flat.*, for CPU devices
    uint32_t picture; // 0, or a picture's curve + 1
};

#define LIGHT_FEATURES                                                                             \
    (HG_FEATURE_LIGHTS | HG_FEATURE_CLUSTERS | HG_FEATURE_LOCAL | HG_FEATURE_SHADOWS |             \
        HG_FEATURE_NO_SUN)

#define OPAQUE_FEATURES                                                                            \
    (HG_FEATURE2_GATHERED | HG_FEATURE2_LAMPS_GATHERED | HG_FEATURE2_PROBE_LIGHT |                 \
        HG_FEATURE2_MIRRORS)

static struct hg_gpu_pipeline_params pipeline_of(
    const struct style *style, uint32_t tables, uint32_t features, uint32_t features2)
{
    if (style->unlit) {
        features &= ~LIGHT_FEATURES;
        features2 &= ~(HG_FEATURE2_SIZED | HG_FEATURE2_LIGHT_TABLES);
    }
    if (style->variant != LAYER &&
        style->variant != LAYERS) // what lets light through is drawn as a layer
        features &= ~HG_FEATURE_TRANSMISSION;
    const bool lobes = (features & HG_FEATURE_LOBES) != 0 && !style->background;
    if (!lobes)
        features &= ~HG_FEATURE_LOBES;
    if ((features & HG_FEATURE_TRANSMISSION) == 0)
        features2 &= ~HG_MIX_OF_GLASS;
    if (!lobes)
        features2 &= ~HG_MIX_ALL;
    if (!style->background)
        features2 &= ~HG_FEATURE2_GROUND;
    else
        features2 &= ~(HG_FEATURE2_PROBES | OPAQUE_FEATURES);
    if (style->variant == LAYER || style->variant == LAYERS)
        features2 &= ~OPAQUE_FEATURES;
    else
        features2 &= ~(HG_FEATURE2_GLASS | HG_FEATURE2_GLASS_RAYS);
    return (struct hg_gpu_pipeline_params){
        .vertex = style->flat ? "shade_flat.vert" : "fullscreen.vert",
        .fragment = style->flat ? (lobes ? "shade_lobes_flat.frag" : "shade_flat.frag")
                                : (lobes ? "shade_lobes.frag" : "shade.frag"),
        .spec = {style->variant, tables, features, style->background, style->picture, features2},
        .spec_count = 6,
        .colors = {style->picture > 0 ? VK_FORMAT_R8G8B8A8_UNORM : HG_COLOR_FORMAT},
        .color_count = 1,
        // The triangle lies at infinity (0): in front of it is a surface, else nothing. With unlit
        // cells it lies a little nearer, where their surfaces were moved.
        .depth = VK_FORMAT_D32_SFLOAT,
        .depth_compare =
            style->background || style->unlit ? VK_COMPARE_OP_EQUAL : VK_COMPARE_OP_LESS,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST,
        .blend = style->first ? HG_GPU_BLEND_NONE : HG_GPU_BLEND_ADD,
        .io = &shade_io,
    };
}

// The environment's pages are floats, whatever the materials' are.
static uint32_t features_of(const struct hg_pass *pass, bool background)
{
    const uint32_t floats = pass->background & HG_FEATURE_SKY_PAGES ? HG_FEATURE_FLOAT : 0;
    return background ? pass->features | pass->background | floats : pass->features;
}

static enum hg_status draw(struct hg_pass *pass, const struct style *style, struct hg_error *err)
{
    const struct hg_gpu_pipeline_params params =
        pipeline_of(style, pass->tables, features_of(pass, style->background), pass->features2);
    enum hg_status status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status == HG_OK)
        vkCmdDraw(hg_gpu_cmd_handle(pass->cmd), 3, 1, 0, 0);
    return status;
}

// Pipelines of a pass, side by side when they are new.
static enum hg_status make_all(
    struct hg_pass *pass, const struct style *style, bool unlit, struct hg_error *err)
{
    struct style others[2] = {*style, *style};
    others[0].background = true;
    others[1].unlit = true;
    const struct hg_gpu_pipeline_params params[3] = {
        pipeline_of(style, pass->tables, features_of(pass, style->background), pass->features2),
        pipeline_of(&others[0], pass->tables, features_of(pass, true), pass->features2),
        pipeline_of(
            &others[1], pass->tables, features_of(pass, style->background), pass->features2)};
    return pass->jobs != NULL
               ? hg_gpu_pipelines_make(pass->gpu, params, unlit ? 3 : 2, pass->jobs, err)
               : HG_OK;
}

// Where the triangles of the next draws lie.
static void place(struct hg_pass *pass, const struct hg_gpu_image *target, float depth)
{
    const VkViewport view = {0.0f, 0.0f, (float)target->width, (float)target->height, depth, 1.0f};
    vkCmdSetViewport(hg_gpu_cmd_handle(pass->cmd), 0, 1, &view);
}

static enum hg_status draw_opaque(struct hg_pass *pass, const struct hg_gpu_image *target,
    struct style style, bool unlit, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    style.background = true;
    status = draw(pass, &style, err);
    style.background = false;
    if (unlit || style.masked)
        place(pass, target, HG_UNLIT_TILES_DEPTH);
    if (status == HG_OK)
        status = draw(pass, &style, err);
    style.unlit = true;
    return status == HG_OK && unlit ? draw(pass, &style, err) : status;
}

enum hg_status hg_shade_record(
    struct hg_pass *pass, const struct hg_shade *shade, struct hg_error *err)
{
    const struct shade_inputs inputs = {.visibility = {.image = shade->visibility},
        .front = {.image = shade->layer ? shade->behind : shade->front},
        .gathered = {.image = shade->layer              ? shade->glass_rays
                              : shade->gathered != NULL ? shade->gathered
                                                        : shade->probe_light},
        .mirrored = {.image = shade->layer ? shade->glass : shade->mirrored}};
    const bool picture = shade->picture != NULL, unlit = shade->unlit;
    struct hg_gpu_image *target = picture ? shade->picture : shade->target;
    const struct style style = {.variant = shade->lists           ? LAYERS
                                           : shade->layer         ? LAYER
                                           : shade->alone         ? ALONE
                                           : shade->front != NULL ? OPAQUE_BEHIND
                                                                  : OPAQUE,
        .first = picture || shade->clear || shade->layer,
        .flat = hg_gpu_strategy(pass->gpu)->flat_shading,
        .masked = shade->masked,
        .picture = picture ? shade->tonemap + 1 : 0};
    if (shade->gathered != NULL) // and below that of the picture what there is about lamps
        pass->features2 |=
            HG_FEATURE2_GATHERED |
            (shade->gathered->height > shade->visibility->height ? HG_FEATURE2_LAMPS_GATHERED : 0);
    else if (shade->probe_light != NULL)
        pass->features2 |= HG_FEATURE2_PROBE_LIGHT;
    if (shade->layer && shade->glass != NULL)
        pass->features2 |= HG_FEATURE2_GLASS;
    if (shade->layer && shade->glass_rays != NULL)
        pass->features2 |= HG_FEATURE2_GLASS_RAYS;
    if (shade->mirrored != NULL)
        pass->features2 |= HG_FEATURE2_MIRRORS;
    pass->features2 |= shade->checkerboard ? HG_FEATURE2_CHECKERBOARD : 0;
    enum hg_status status = hg_pass_bind(pass, &shade_io, &inputs, sizeof inputs, err);
    if (status == HG_OK && !shade->layer)
        status = make_all(pass, &style, unlit, err);
    if (status != HG_OK)
        return status;
    const struct hg_gpu_rendering rendering = {
        // Surfaces and background write every pixel between them.
        .colors = {{.image = target,
            .clear = shade->layer || (shade->clear && shade->masked),
            .discard = picture || (shade->clear && !shade->layer && !shade->masked)}},
        .color_count = 1,
        .depth = {.image = shade->depth},
        .area = pass->area};
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    hg_pass_view_whole(pass, target);
    status = shade->layer ? draw(pass, &style, err) : draw_opaque(pass, target, style, unlit, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}

enum hg_status hg_shade_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err)
{
    static const struct {
        enum variant variant;
        bool background;
    } styles[] = {{OPAQUE, false}, {OPAQUE_BEHIND, false}, {LAYERS, false}, {OPAQUE, true},
        {OPAQUE_BEHIND, true}};
    *count = sizeof styles / sizeof styles[0];
    const struct style style = {.variant = styles[index % *count].variant,
        .background = styles[index % *count].background,
        .first = true,
        .flat = hg_gpu_strategy(gpu)->flat_shading};
    const struct hg_gpu_pipeline_params params =
        pipeline_of(&style, 0, HG_FEATURE_ALL & ~HG_FEATURE_LOBES, 0);
    VkPipeline pipeline;
    return hg_gpu_pipeline_get(gpu, &params, &pipeline, err);
}
