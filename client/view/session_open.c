// session_open.c - a viewer's session: from the options to a scene that is shown.
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "client/view/session_state.h"

enum { NODES_PER_QUERY = 4096 };

static void on_tick(void *user)
{
    struct hg_view_session *s = user;
    pthread_mutex_lock(&s->lock);
    const bool stop = s->wanted.stop;
    pthread_mutex_unlock(&s->lock);
    if (stop)
        helio_interrupt(s->work.render.cli.h);
}

static void on_progress(void *user, const struct hgp_progress *progress)
{
    char stage[72];
    hg_cli_clean(stage, sizeof stage, progress->stage.data, progress->stage.size);
    hg_view_say_stage(
        user, stage, progress->total ? (double)progress->done / (double)progress->total : -1);
    on_tick(user);
}

static void on_notice(void *user, const struct hgp_notice *notice)
{
    char what[200], reason[260];
    hg_cli_clean(what, sizeof what, notice->what.data, notice->what.size);
    hg_cli_clean(reason, sizeof reason, notice->reason.data, notice->reason.size);
    hg_view_say(user, "%s%s%s", what, what[0] ? ": " : "", reason);
}

// ---- what the scene offers ---------------------------------------------------------------------

static void note_asset(struct hg_view_work *work, uint64_t node)
{
    const uint32_t asset = (uint32_t)(node >> 32);
    for (uint32_t i = 0; i < work->asset_count; i++)
        if (work->assets[i] == asset)
            return;
    if (asset != 0 && work->asset_count < HG_VIEW_ASSETS_MAX)
        work->assets[work->asset_count++] = asset;
}

static void note_nodes(
    struct hg_view_work *work, const struct hgp_nodes *nodes, struct hg_view_scene *scene)
{
    for (uint32_t i = 0; i < nodes->nodes.count; i++) {
        const struct hgp_node_entry *node = &nodes->nodes.items[i];
        note_asset(work, node->node);
        if (!node->camera || scene->camera_count == HG_VIEW_NAMES_MAX)
            continue;
        struct hg_view_name *name = &scene->cameras[scene->camera_count++];
        hg_cli_clean(name->text, sizeof name->text, node->name.data, node->name.size);
        name->id = node->node;
    }
}

static enum hg_status list_nodes(
    struct hg_view_session *s, struct hg_view_scene *scene, struct hg_error *err)
{
    uint32_t first = 0, total = 1;
    s->work.asset_count = 0;
    while (first < total) {
        const struct hgp_nodes_query query = {.first = first, .count = NODES_PER_QUERY};
        struct helio_message *answer;
        enum hg_status status = helio_call_for(
            s->work.render.cli.h, HGP_T_nodes_query, &query, HGP_T_nodes, &answer, err);
        if (status)
            return status;
        const struct hgp_nodes *nodes = &answer->body->nodes;
        note_nodes(&s->work, nodes, scene);
        total = nodes->nodes.count ? nodes->total : 0;
        first += nodes->nodes.count;
        helio_message_free(answer);
    }
    return HG_OK;
}

bool hg_view_read_flow(const char *text, size_t size, struct hg_view_flow *out)
{
    json_t *root = json_loadb(text, size, 0, NULL), *flow = json_object_get(root, "flow");
    const bool is_known = json_is_object(flow);
    *out = (struct hg_view_flow){.is_known = is_known,
        .target_fps = json_number_value(json_object_get(flow, "target_fps")),
        .target_ms = json_number_value(json_object_get(flow, "target_ms")),
        .rate_mbit_s = json_number_value(json_object_get(flow, "rate_mbit_s")),
        .rtt_ms = json_number_value(json_object_get(flow, "rtt_ms")),
        .delay_ms = json_number_value(json_object_get(flow, "delay_ms")),
        .quality = (uint32_t)json_integer_value(json_object_get(flow, "quality")),
        .bitrate = (uint64_t)json_integer_value(json_object_get(flow, "bitrate")),
        .under_way = (uint64_t)json_integer_value(json_object_get(flow, "under_way")),
        .bytes_under_way = (uint64_t)json_integer_value(json_object_get(flow, "bytes_under_way")),
        .held = (uint64_t)json_integer_value(json_object_get(flow, "held"))};
    json_decref(root);
    return is_known;
}

static void note_variants(const json_t *list, struct hg_view_scene *scene)
{
    for (size_t i = 0; i < json_array_size(list); i++) {
        const char *text = json_string_value(json_array_get(list, i));
        if (!text || strlen(text) >= HG_VIEW_NAME_BYTES ||
            scene->variant_count == HG_VIEW_NAMES_MAX)
            continue;
        snprintf(scene->variants[scene->variant_count++].text, HG_VIEW_NAME_BYTES, "%s", text);
    }
}

// An animation of the asset at this place that hg_view_session_pose poses.
static bool is_played(
    const struct hg_view_session *s, size_t asset, size_t index, json_t *animation)
{
    const struct hg_cli_animations *chosen = &s->work.render.loaded.chosen;
    bool named = false;
    if (asset > 0 || chosen->count == 0)
        return !json_is_true(json_object_get(animation, "conflicts"));
    for (uint32_t i = 0; i < chosen->count; i++)
        named |= chosen->items[i] == (int32_t)index;
    return named;
}

// Variants of the first asset, which are those that can be chosen; durations of all.
static enum hg_status read_info(
    struct hg_view_session *s, struct hg_view_scene *scene, struct hg_error *err)
{
    char *text;
    json_error_t wrong;
    size_t a, i;
    json_t *asset, *animation;
    enum hg_status status = helio_query_json(s->work.render.cli.h, HGP_T_info_query, 0, &text, err);
    if (status)
        return status;
    json_t *info = json_loads(text, 0, &wrong), *assets = json_object_get(info, "assets");
    helio_text_free(text);
    note_variants(json_object_get(json_array_get(assets, 0), "variants"), scene);
    json_array_foreach(assets, a, asset)
    {
        json_array_foreach(json_object_get(asset, "animations"), i, animation)
        {
            const double s_long = json_number_value(json_object_get(animation, "duration_s"));
            if (is_played(s, a, i, animation))
                scene->duration_s = fmax(scene->duration_s, s_long);
        }
    }
    json_decref(info);
    return HG_OK;
}

static enum hg_status read_bounds(
    struct hg_view_session *s, struct hg_view_scene *scene, struct hg_error *err)
{
    const struct hgp_bounds_query query = {0};
    struct helio_message *answer;
    double sum = 0;
    enum hg_status status = helio_call_for(
        s->work.render.cli.h, HGP_T_bounds_query, &query, HGP_T_bounds, &answer, err);
    if (status)
        return status;
    const struct hgp_bounds *b = &answer->body->bounds;
    for (int i = 0; i < 3 && !b->empty; i++)
        sum += pow(((double)b->max[i] - b->min[i]) / 2, 2);
    scene->has_box = !b->empty;
    memcpy(scene->min, b->min, sizeof scene->min);
    memcpy(scene->max, b->max, sizeof scene->max);
    scene->radius = sum > 0 && isfinite(sum) ? sqrt(sum) : 1;
    helio_message_free(answer);
    return HG_OK;
}

static bool read_vector(const json_t *list, float out[3])
{
    if (json_array_size(list) != 3)
        return false;
    for (size_t i = 0; i < 3; i++)
        out[i] = (float)json_number_value(json_array_get(list, i));
    return true;
}

// The statistics' camera: eye, target and lens, whoever placed it.
static enum hg_status take_camera(
    const json_t *seen, struct hgp_view_camera *camera, struct hg_error *err)
{
    const char *kind = json_string_value(json_object_get(seen, "kind"));
    const bool flat = kind && strcmp(kind, "orthographic") == 0;
    if (!read_vector(json_object_get(seen, "eye"), camera->eye) ||
        !read_vector(json_object_get(seen, "target"), camera->target))
        return hg_error_set(err, HG_E_FORMAT, "statistics", "/camera", "holds no eye and target");
    camera->has_eye = camera->has_target = camera->has_kind = true;
    camera->kind = flat ? HGP_camera_kind_ORTHOGRAPHIC : HGP_camera_kind_PERSPECTIVE;
    camera->has_half_height = flat;
    camera->half_height = (float)json_number_value(json_object_get(seen, "half_height"));
    camera->has_vfov_rad = !flat;
    camera->vfov_rad = (float)(json_number_value(json_object_get(seen, "vfov_deg")) *
                               3.14159265358979323846 / 180);
    return HG_OK;
}

enum hg_status hg_view_ask_place(
    struct hg_view_session *s, struct hgp_view_camera *camera, struct hg_error *err)
{
    json_t *stats = NULL;
    enum hg_status status = hg_cli_stats(&s->work.render.cli, &stats, err);
    if (!status)
        status = take_camera(json_object_get(stats, "camera"), camera, err);
    json_decref(stats);
    return status;
}

// A camera of the scene as eye and target, too: the controls go on from where it stands.
static enum hg_status read_camera(
    struct hg_view_session *s, struct hg_view_scene *scene, struct hg_error *err)
{
    scene->camera = s->work.render.turntable.start;
    return scene->camera.has_camera ? hg_view_ask_place(s, &scene->camera, err) : HG_OK;
}

static enum hg_status describe(struct hg_view_session *s, struct hg_error *err)
{
    struct hg_view_scene *scene = hg_calloc(1, sizeof *scene);
    if (!scene)
        return hg_error_set(err, HG_E_NOMEM, "scene", NULL, "no memory");
    enum hg_status status = list_nodes(s, scene, err);
    if (!status)
        status = read_info(s, scene, err);
    if (!status)
        status = read_bounds(s, scene, err);
    if (!status)
        status = read_camera(s, scene, err);
    if (!status) {
        pthread_mutex_lock(&s->lock);
        s->shown.scene = *scene;
        s->shown.status.scene++;
        pthread_mutex_unlock(&s->lock);
    }
    hg_free(scene);
    return status;
}

// ---- opening -----------------------------------------------------------------------------------

// Pixels as they are where bytes cost nothing: of a private worker and over a unix socket.
static bool is_near(const struct hg_cli_options *o)
{
    return !o->connect || strncmp(o->connect, "unix:", 5) == 0;
}

static enum hg_status subscribe(struct hg_view_session *s, struct hg_error *err)
{
    const bool near = is_near(&s->work.options);
    uint8_t codecs[HG_VIEW_CODECS_MAX];
    const struct hgp_view_set view = {
        .view = HG_CLI_VIEW,
        .has_encoding = true,
        .encoding = near ? HGP_encoding_RAW_RGBA8 : HGP_encoding_JPEG,
        .has_codecs = !near,
        .codecs = {codecs, near ? 0 : (uint32_t)hg_view_codecs(codecs)},
        .has_names = true,
        .names = 1,
        .has_still_encoding = true,
        .still_encoding = near ? HGP_encoding_RAW_RGBA8 : HGP_encoding_ZSTD_RGBA8,
    };
    const struct hgp_subscribe sub = {.view = HG_CLI_VIEW, .credit_frames = HG_VIEW_CREDIT};
    struct helio *h = s->work.render.cli.h;
    enum hg_status status = helio_call_for(h, HGP_T_view_set, &view, HGP_T_ok, NULL, err);
    return status ? status : helio_call_for(h, HGP_T_subscribe, &sub, HGP_T_ok, NULL, err);
}

// The shared scene of --join. *fresh: this session has made it, and fills it.
static enum hg_status join(struct hg_view_session *s, bool *fresh, struct hg_error *err)
{
    struct hg_cli_render *r = &s->work.render;
    r->doing = HG_CLI_DOING_ARGUMENTS;
    enum hg_status status = helio_scene_open(r->cli.h, r->o->join, &r->cli.scene, err);
    *fresh = !status && !r->cli.scene.existed;
    if (!status && *fresh && r->o->arg_count == 0)
        status = hg_error_set(err, HG_E_NOTFOUND, "--join", r->o->join,
            "no session holds a scene of that name, and no file to fill it with was given");
    return status;
}

static void say_open(struct hg_view_session *s)
{
    struct helio_info info;
    const struct hg_cli_options *o = &s->work.options;
    const char *path = o->join ? o->join : o->args[0], *slash = strrchr(path, '/');
    helio_get_info(s->work.render.cli.h, &info);
    pthread_mutex_lock(&s->lock);
    struct hg_view_status *status = &s->shown.status;
    const char *name = slash ? slash + 1 : path;
    hg_cli_clean(status->title, sizeof status->title, name, strlen(name));
    const char *where = o->connect ? o->connect : "private worker";
    hg_cli_clean(status->server, sizeof status->server, where, strlen(where));
    status->may_edit = s->work.may_edit = info.role >= HGP_role_EDIT;
    pthread_mutex_unlock(&s->lock);
}

enum hg_status hg_view_open_scene(struct hg_view_session *s, struct hg_error *err)
{
    struct hg_cli_render *r = &s->work.render;
    const struct hg_cli_options *o = &s->work.options;
    bool fresh = true;
    hg_view_say_stage(s, o->connect ? "connecting" : "starting a private worker", -1);
    enum hg_status status = hg_cli_render_connect(r, !o->join, err);
    if (status)
        return status;
    helio_set_handlers(
        r->cli.h, &(struct helio_handlers){
                      .user = s, .tick = on_tick, .progress = on_progress, .notice = on_notice});
    if (o->join)
        status = join(s, &fresh, err);
    if (!status && s->work.recorder)
        status = hg_cli_recorder_attach(
            s->work.recorder, r->cli.h, &r->cli.scene, o->join ? o->join : "", err);
    say_open(s);
    hg_view_say_stage(s, "loading", -1);
    if (!status && fresh)
        status = hg_cli_render_load(r, err);
    if (!status)
        status = hg_cli_render_set_view(r, err);
    if (status)
        return status;
    r->doing = HG_CLI_DOING_RENDER;
    status = describe(s, err);
    return status ? status : subscribe(s, err);
}
