// session_requests.c - a viewer's session: what the window asks for goes out, and answers come
// back.
#include <string.h>

#include "client/view/session_look.h"
#include "client/view/session_state.h"

// ---- the newest of each ------------------------------------------------------------------------

static enum hg_status send_camera(struct hg_view_session *s, struct hg_error *err)
{
    struct hgp_view_camera camera;
    pthread_mutex_lock(&s->lock);
    const bool has = s->wanted.has_camera;
    camera = s->wanted.camera;
    s->wanted.has_camera = false;
    pthread_mutex_unlock(&s->lock);
    return has ? hg_view_send(s, HGP_T_view_camera, &camera, err) : HG_OK;
}

// Of the file that the command named, what --animation chose; of others all that have no conflicts.
static enum hg_status pose_asset(
    struct hg_view_session *s, uint32_t asset, double time_s, struct hg_error *err)
{
    const struct hg_cli_render *r = &s->work.render;
    const struct hg_cli_animations *chosen = &r->loaded.chosen;
    const uint32_t count = asset == r->cli.scene.first_id ? chosen->count : 0;
    struct hgp_animation_set pose = {.asset = asset, .animation = -1, .time_s = time_s};
    enum hg_status status = count ? HG_OK : hg_view_send(s, HGP_T_animation_set, &pose, err);
    for (uint32_t i = 0; i < count && !status; i++) {
        pose.animation = chosen->items[i];
        status = hg_view_send(s, HGP_T_animation_set, &pose, err);
    }
    return status;
}

static enum hg_status send_pose(struct hg_view_session *s, struct hg_error *err)
{
    pthread_mutex_lock(&s->lock);
    const bool has = s->wanted.has_pose;
    const double time_s = s->wanted.pose_s;
    s->wanted.has_pose = false;
    pthread_mutex_unlock(&s->lock);
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; has && !status && i < s->work.asset_count; i++)
        status = pose_asset(s, s->work.assets[i], time_s, err);
    return status;
}

static enum hg_status send_clip(struct hg_view_session *s, struct hg_error *err)
{
    pthread_mutex_lock(&s->lock);
    const bool has = s->wanted.has_clip;
    struct hg_clipping_list cut = s->wanted.clip;
    s->wanted.has_clip = false;
    pthread_mutex_unlock(&s->lock);
    const struct hgp_view_clip clip = {
        .view = HG_CLI_VIEW, .planes = {cut.items, cut.count}, .has_caps = true, .caps = cut.caps};
    return has ? hg_view_send(s, HGP_T_view_clip, &clip, err) : HG_OK;
}

static enum hg_status find_fit(
    struct hg_view_session *s, const struct hg_view_request *q, struct hg_error *err)
{
    struct hgp_view_fit fit = {.view = HG_CLI_VIEW, .has_node = q->node != 0, .node = q->node};
    struct hgp_view_camera camera = {.view = HG_CLI_VIEW};
    enum hg_status status = HG_OK;
    if (q->ask == HG_VIEW_ASK_NODE) {
        camera.has_camera = true;
        camera.camera = q->node;
        status = hg_view_send(s, HGP_T_view_camera, &camera, err);
        if (!status)
            status = hg_view_ask_place(s, &camera, err);
    } else {
        if (q->text[0])
            status = hg_cli_parse_view("view", q->text, &fit, err);
        if (!status)
            status = helio_camera_fit(s->work.render.cli.h, &fit, &camera, err);
    }
    if (status)
        return status;
    pthread_mutex_lock(&s->lock);
    s->shown.fitted = camera;
    s->shown.status.fits++;
    pthread_mutex_unlock(&s->lock);
    hg_view_tell(s);
    return HG_OK;
}

// ---- answers -----------------------------------------------------------------------------------

static void answer_window(struct hg_view_session *s, const struct hg_view_answer *answer)
{
    pthread_mutex_lock(&s->lock);
    const uint32_t number = ++s->shown.status.answers;
    s->shown.answers[number % HG_VIEW_ANSWERS_MAX] = *answer;
    pthread_mutex_unlock(&s->lock);
    hg_view_tell(s);
}

static enum hg_status pick(
    struct hg_view_session *s, const struct hg_view_request *q, struct hg_error *err)
{
    const struct hgp_pick ask = {.view = HG_CLI_VIEW, .x = q->at.x, .y = q->at.y};
    struct helio_message *m;
    enum hg_status status =
        helio_call_for(s->work.render.cli.h, HGP_T_pick, &ask, HGP_T_picked, &m, err);
    if (status)
        return status;
    const struct hgp_picked *p = &m->body->picked;
    struct hg_view_answer answer = {
        .ask = q->ask, .hit = p->hit, .node = p->node, .revision = p->revision};
    memcpy(answer.position, p->position, sizeof answer.position);
    memcpy(answer.normal, p->normal, sizeof answer.normal);
    helio_message_free(m);
    answer_window(s, &answer);
    return HG_OK;
}

// Of the frame that the user looked at: when the view shows another state by now, the server says
// so.
static enum hg_status find_point(
    struct hg_view_session *s, const struct hg_view_request *q, struct hg_error *err)
{
    enum { NORMAL = 2, POSITION = 4, NODE = 8, BYTES = 2 * 3 * 4 + 8 };
    const struct hgp_surface_query ask = {.view = HG_CLI_VIEW,
        .x = q->at.x,
        .y = q->at.y,
        .width = 1,
        .height = 1,
        .what = NORMAL | POSITION | NODE,
        .has_frame = true,
        .frame = q->at.frame};
    struct helio_message *m;
    enum hg_status status =
        helio_call_for(s->work.render.cli.h, HGP_T_surface_query, &ask, HGP_T_surfaces, &m, err);
    if (status)
        return status;
    const struct hgp_surfaces *found = &m->body->surfaces;
    struct hg_view_answer answer = {.ask = q->ask, .revision = found->revision};
    if (found->what != ask.what || found->data.size != BYTES) {
        status = hg_error_set(
            err, HG_E_FORMAT, "surfaces", NULL, "is not the answer to the question for one pixel");
    } else {
        memcpy(answer.normal, found->data.data, sizeof answer.normal);
        memcpy(answer.position, found->data.data + 12, sizeof answer.position);
        memcpy(&answer.node, found->data.data + 24, sizeof answer.node);
        answer.hit = answer.node != 0;
        answer_window(s, &answer);
    }
    helio_message_free(m);
    return status;
}

// Of that frame too, if the view still shows its state: the camera may have moved since.
static enum hg_status find_node(
    struct hg_view_session *s, const struct hg_view_request *q, struct hg_error *err)
{
    const enum hg_status status = find_point(s, q, err);
    return status == HG_E_STATE ? pick(s, q, err) : status;
}

// Waited for: what is refused must not be shown as done.
static enum hg_status set_visible(
    struct hg_view_session *s, const struct hg_view_request *q, struct hg_error *err)
{
    struct hg_view_answer answer = {.ask = q->ask, .node = q->node, .visible = q->visible};
    if (!s->work.may_edit) {
        enum hg_status status = hg_view_look_hide(s, q->node, !q->visible, err);
        if (!status)
            answer_window(s, &answer);
        return status;
    }
    const struct hgp_node_set edit = {.node = q->node, .has_visible = true, .visible = q->visible};
    struct helio_message *m;
    enum hg_status status =
        helio_call_for(s->work.render.cli.h, HGP_T_node_set, &edit, HGP_T_ok, &m, err);
    if (status)
        return status;
    answer.revision = m->body->ok.revision;
    answer_window(s, &answer);
    helio_message_free(m);
    return HG_OK;
}

// Of the scene, or of this view alone.
static enum hg_status choose_variant(
    struct hg_view_session *s, const char *name, struct hg_error *err)
{
    const uint32_t asset = s->work.asset_count ? s->work.assets[0] : 0;
    const struct hgp_variant_set variant = {.asset = asset, .variant = hgp_str_make(name)};
    if (!asset)
        return HG_OK;
    return s->work.may_edit ? hg_view_send(s, HGP_T_variant_set, &variant, err)
                            : hg_view_look_variant(s, asset, name, err);
}

// ---- the list of nodes -------------------------------------------------------------------------

static enum hg_status read_nodes(
    struct hg_view_session *s, struct hg_tree *tree, struct hg_error *err)
{
    enum { NODES_PER_QUERY = 4096 };
    uint32_t first = 0;
    tree->total = 1;
    while (first < tree->total && first < HG_TREE_NODES_MAX) {
        const struct hgp_nodes_query query = {.first = first, .count = NODES_PER_QUERY};
        struct helio_message *m;
        enum hg_status status =
            helio_call_for(s->work.render.cli.h, HGP_T_nodes_query, &query, HGP_T_nodes, &m, err);
        if (status)
            return status;
        const struct hgp_nodes *nodes = &m->body->nodes;
        for (uint32_t i = 0; i < nodes->nodes.count && !status; i++)
            status = hg_tree_add(tree, &nodes->nodes.items[i], err);
        tree->total = nodes->total;
        tree->revision = nodes->revision;
        const uint32_t count = nodes->nodes.count;
        first += count;
        helio_message_free(m);
        if (status || count == 0)
            return status;
    }
    return HG_OK;
}

static enum hg_status list_nodes(struct hg_view_session *s, struct hg_error *err)
{
    struct hg_tree tree = {0};
    enum hg_status status = read_nodes(s, &tree, err);
    if (!status)
        status = hg_tree_link(&tree, err);
    if (!status)
        hg_view_look_mark(&s->work.look, &tree);
    if (status) {
        hg_tree_finish(&tree);
        return status;
    }
    pthread_mutex_lock(&s->lock);
    struct hg_tree before = s->shown.nodes;
    s->shown.nodes = tree;
    s->shown.has_nodes = true;
    s->shown.status.lists++;
    pthread_mutex_unlock(&s->lock);
    hg_tree_finish(&before);
    hg_view_tell(s);
    return HG_OK;
}

// ---- files -------------------------------------------------------------------------------------

// A settled view is not rendered again: the file holds the pixels that are shown.
static enum hg_status shoot(
    struct hg_view_session *s, const struct hg_view_request *q, struct hg_error *err)
{
    const struct hgp_frame_request ask = {
        .view = HG_CLI_VIEW, .has_encoding = true, .encoding = HGP_encoding_PNG8};
    struct helio_message *answer;
    enum hg_status status = hg_cli_check_output(q->text, err);
    if (status)
        return status;
    status = helio_frame(s->work.render.cli.h, &ask, &answer, err);
    if (status)
        return status;
    const struct hgp_frame *frame = &answer->body->frame;
    status = hg_cli_write_output(q->text, frame->data.data, frame->data.size, err);
    helio_message_free(answer);
    if (!status)
        hg_view_say(s, "written: %s", q->text);
    return status;
}

// ---- the requests ------------------------------------------------------------------------------

static enum hg_status do_query(
    struct hg_view_session *s, const struct hg_view_request *q, struct hg_error *err)
{
    switch (q->ask) {
    case HG_VIEW_ASK_NODE:
    case HG_VIEW_ASK_FIT:
        return find_fit(s, q, err);
    case HG_VIEW_ASK_PICK:
    case HG_VIEW_ASK_CENTRE:
        return find_node(s, q, err);
    case HG_VIEW_ASK_POINT:
        return find_point(s, q, err);
    case HG_VIEW_ASK_LIST:
        return list_nodes(s, err);
    case HG_VIEW_ASK_SHOT:
        return shoot(s, q, err);
    default:
        return HG_OK;
    }
}

static enum hg_status do_request(
    struct hg_view_session *s, struct hg_view_request *q, struct hg_error *err)
{
    switch (q->ask) {
    case HG_VIEW_ASK_SET:
        q->view.view = HG_CLI_VIEW;
        return hg_view_send(s, HGP_T_view_set, &q->view, err);
    case HG_VIEW_ASK_ENVIRONMENT:
        return hg_view_send(s, HGP_T_environment_set, &q->environment, err);
    case HG_VIEW_ASK_VARIANT:
        return choose_variant(s, q->text, err);
    case HG_VIEW_ASK_SELECT:
        return hg_view_look_select(s, q->node, err);
    case HG_VIEW_ASK_VISIBLE:
        return set_visible(s, q, err);
    default:
        return do_query(s, q, err);
    }
}

static bool next_request(struct hg_view_session *s, struct hg_view_request *out)
{
    pthread_mutex_lock(&s->lock);
    struct hg_view_wanted *wanted = &s->wanted;
    const bool has = wanted->count > 0 && !wanted->open && !wanted->stop;
    if (has) {
        *out = wanted->requests[wanted->first];
        wanted->first = (wanted->first + 1) % HG_VIEW_REQUESTS_MAX;
        wanted->count--;
    }
    pthread_mutex_unlock(&s->lock);
    return has;
}

void hg_view_do_wanted(struct hg_view_session *s)
{
    struct hg_view_request request;
    struct hg_error err = {0};
    if (!helio_want_write(s->work.render.cli.h) && send_clip(s, &err))
        hg_view_say_error(s, &err);
    while (next_request(s, &request))
        if (do_request(s, &request, &err))
            hg_view_say_error(s, &err);
    if (helio_want_write(s->work.render.cli.h))
        return; // what is newest when there is room again goes out
    if (send_camera(s, &err) || send_pose(s, &err))
        hg_view_say_error(s, &err);
}
