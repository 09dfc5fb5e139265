// fake_peer - stands in for a worker (--fd 3) or a daemon (--listen PATH, or --inherit 3: a socket
// that listens already) in tests of the client.
//
// Answers every message plausibly. The environment variable FAKE holds words that make it
// misbehave:
//   fail=MESSAGE:CODE   answer MESSAGE with the error CODE
//   die=MESSAGE         kill itself (worker) or close (daemon) when MESSAGE comes
//   half=MESSAGE        send half of the answer, then as die
//   silent=MESSAGE      never answer MESSAGE
//   late=MESSAGE        answer MESSAGE when the next one comes, with progress before it
//   token=T             ask for the token T
//   version=N           choose protocol version N
//   raw=HEX             send these bytes instead of the greeting
//   file=PATH           send the bytes of this file instead of the greeting, then close
//   dribble=1           send one byte at a time
//   have=1              claim to have every uploaded content
//   stray=1             send unrelated messages between the answers
//   alive=N             (worker) send N signs of life, pings and reports of work before each answer
//   beat=MS             wait so long before each of these signs
//   warnings=N          warn N times when an asset is loaded
//   tickets=1           one join ticket is listed
//   quiet=1             do not warn when an asset is loaded
//   large=1             send frames of 8 KiB
//   paced=N             refuse the first N frames: pixels of this second are taken
//   drain=MS            say before the first frame that the daemon stops after that time; the frame
//                       comes when a checkpoint was asked for, and no other one does
//   folder=PATH         make this folder when animations are posed
//   lost=N              warn with the N-th frame
//   job=N               what frames are made from: the first byte of its hash; default 1
//   parts=1|gap         send frames in parts of 3 bytes, begun twice; gap: one of them is left out
//   log=PATH            append "MESSAGE detail" for everything received
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "protocol/hgp.h"

// Arguments of %.*s.
#define TEXT(s) (int)(s).size, (s).size ? (s).data : ""

static int peer_fd;
static bool is_worker;

// The value of a word of FAKE, or NULL; lives until the next call.
static const char *word(const char *key)
{
    static char value[4096];
    const char *at = getenv("FAKE");
    size_t n = strlen(key);
    while (at && *at) {
        size_t length = strcspn(at, " ");
        if (length > n && memcmp(at, key, n) == 0 && at[n] == '=') {
            snprintf(value, sizeof value, "%.*s", (int)(length - n - 1), at + n + 1);
            return value;
        }
        at += length + strspn(at + length, " ");
    }
    return NULL;
}

static void end(void)
{
    if (is_worker)
        kill(getpid(), SIGKILL);
    _exit(0);
}

static void send_bytes(const uint8_t *data, size_t size)
{
    bool dribble = word("dribble") != NULL;
    while (size) {
        ssize_t n = send(peer_fd, data, dribble ? 1 : size, MSG_NOSIGNAL);
        if (n <= 0)
            _exit(0);
        data += n;
        size -= (size_t)n;
    }
}

static void answer(const struct hgp_header *to, enum hgp_type type, const void *message)
{
    struct hg_writer w = {0};
    uint32_t channel = to ? to->channel : 0, request = to ? to->request : 0;
    if (hgp_encode(&w, 1, (struct hgp_envelope){type, request, channel}, message, NULL))
        abort();
    const char *half = to ? word("half") : NULL;
    const struct hgp_message_info *info = to ? hgp_find(to->type) : NULL;
    if (half && info && strcmp(half, info->name) == 0) {
        send_bytes(w.data, w.size / 2);
        end();
    }
    send_bytes(w.data, w.size);
    hg_writer_finish(&w);
}

static bool receive(uint8_t *data, size_t size)
{
    while (size) {
        ssize_t n = recv(peer_fd, data, size, 0);
        if (n <= 0)
            return false;
        data += n;
        size -= (size_t)n;
    }
    return true;
}

// As a worker that was replaced after the first part: the frame begins again.
static void split_frame(const struct hgp_header *h, struct hgp_frame *frame, bool gap)
{
    struct hgp_bytes all = frame->data;
    answer(h, HGP_T_frame_part, &(struct hgp_frame_part){.data = {all.data, 2}});
    for (uint32_t at = 0; all.size - at > 3; at += 3) {
        frame->data = (struct hgp_bytes){all.data + at + 3, all.size - at - 3};
        if (!gap || at != 3)
            answer(h, HGP_T_frame_part,
                &(struct hgp_frame_part){.offset = at, .data = {all.data + at, 3}});
    }
    frame->has_size = true;
    frame->size = all.size;
}

static struct { // the frame that waits
    bool is_set;
    struct hgp_header header;
    struct hgp_frame_request request;
} held;

static bool hold_for_drain(const struct hgp_header *h, const struct hgp_frame_request *request)
{
    static int frames;
    const struct hgp_header nobody = {.channel = h->channel};
    if (!word("drain"))
        return false;
    if (frames++ > 0)
        return true;
    answer(&nobody, HGP_T_drain,
        &(struct hgp_drain){
            .deadline_ms = (uint32_t)atoi(word("drain")), .reason = hgp_str_make("new disks")});
    answer(&nobody, HGP_T_message,
        &(struct hgp_message){.from = hgp_str_make("ann"), .text = hgp_str_make("at noon")});
    held.is_set = true;
    held.header = *h;
    held.request = *request;
    return true;
}

static bool refuse_paced(const struct hgp_header *h)
{
    static int refused;
    if (!word("paced") || refused++ >= atoi(word("paced")))
        return false;
    answer(h, HGP_T_limited,
        &(struct hgp_limited){
            .request = h->request, .limit = hgp_str_make("max-pixel-rate"), .retry_after_ms = 20});
    answer(h, HGP_T_error,
        &(struct hgp_error){.code = HG_E_LIMIT, .reason = hgp_str_make("pixels are taken")});
    return true;
}

static void send_frame(const struct hgp_header *h, const struct hgp_frame_request *request)
{
    char data[8192];
    static uint64_t number;
    snprintf(data, sizeof data, "frame %llu as %s%*s\n", (unsigned long long)++number,
        hgp_enum_name("encoding", request->encoding), word("large") ? 8000 : 0, "");
    struct hgp_stage_time stage = {.name = hgp_str_make("shade"), .ns = 1000000};
    struct hgp_frame frame = {
        .view = request->view,
        .number = number,
        .width = 1280,
        .height = 720,
        .encoding = request->encoding,
        .samples = 32,
        .settled = true,
        .lossless = true,
        .has_hash = true,
        .hash = {0xab, 0xcd},
        .stages = {&stage, 1},
        .data = {(const uint8_t *)data, (uint32_t)strlen(data)},
    };
    struct hgp_progress progress = {.stage = hgp_str_make("samples"), .done = 16, .total = 32};
    struct hgp_notice lost = {
        .what = hgp_str_make("fake.gltf"), .reason = hgp_str_make("an image was lost")};
    answer(h, HGP_T_progress, &progress);
    if (word("lost") && strtoull(word("lost"), NULL, 10) == number)
        answer(h, HGP_T_notice, &lost);
    if (word("parts") && request->parts)
        split_frame(h, &frame, strcmp(word("parts"), "gap") == 0);
    answer(h, HGP_T_frame, &frame);
}

static uint8_t job_byte(void)
{
    return word("job") ? (uint8_t)atoi(word("job")) : 1;
}

// A frame's file is whole when its line ends, and is of the job 1.
static void send_image(const struct hgp_header *h, const struct hgp_image_query *query)
{
    struct hgp_error cut = {.code = HG_E_FORMAT, .reason = hgp_str_make("cut short")};
    if (query->has_offset && query->offset + query->data.size < query->size) {
        answer(h, HGP_T_ok, &(struct hgp_ok){.revision = 1});
        return;
    }
    if (!query->data.size || query->data.data[query->data.size - 1] != '\n') {
        answer(h, HGP_T_error, &cut);
        return;
    }
    char text[128] = "{\"job\":\"01";
    memset(text + 10, '0', 62);
    strcpy(text + 72, "\"}");
    answer(h, HGP_T_json, &(struct hgp_json){.text = hgp_str_make(text)});
}

static void send_checkpoint(const struct hgp_header *h)
{
    struct hgp_checkpoint c = {
        .job = {job_byte()}, .samples = 16, .data = {(const uint8_t *)"film", 4}};
    answer(h, HGP_T_checkpoint, &c);
}

static void send_have(const struct hgp_header *h, const struct hgp_upload_query *query)
{
    static struct hgp_flag flags[1024];
    for (uint32_t i = 0; i < query->contents.count; i++)
        flags[i].value = word("have") != NULL;
    answer(h, HGP_T_upload_have, &(struct hgp_upload_have){.have = {flags, query->contents.count}});
}

static void send_loaded(const struct hgp_header *h, const struct hgp_asset_load *load)
{
    struct hgp_notice notice = {.what = hgp_str_make("fake.gltf"),
        .where = hgp_str_make("/extensionsUsed/0"),
        .reason = hgp_str_make("unknown \033[31mextension")};
    const int warnings = word("warnings") ? atoi(word("warnings")) : !word("quiet");
    for (int i = 0; i < warnings; i++)
        answer(h, HGP_T_notice, &notice);
    const struct hgp_asset_loaded loaded = {.asset = load->asset,
        .nodes = 2,
        .triangles = 12,
        .animations = word("animations") ? (uint32_t)atoi(word("animations")) : 0};
    answer(h, HGP_T_asset_loaded, &loaded);
}

static void send_nodes(const struct hgp_header *h)
{
    struct hgp_node_entry nodes[] = {
        {.node = 1ull << 32, .name = hgp_str_make("box")},
        {.node = (1ull << 32) + 1, .camera = 1ull << 32, .name = hgp_str_make("eye")},
    };
    answer(h, HGP_T_nodes, &(struct hgp_nodes){.total = 2, .nodes = {nodes, 2}});
}

static void send_compared(const struct hgp_header *h, const struct hgp_compare *c)
{
    bool same = c->a.size == c->b.size && memcmp(c->a.data, c->b.data, c->a.size) == 0;
    struct hgp_compared out = {.value = same ? 999 : 20, .width = 1, .height = 1};
    out.diff = c->want_diff ? (struct hgp_bytes){(const uint8_t *)"diff", 4} : out.diff;
    answer(h, HGP_T_compared, &out);
}

static void log_management(FILE *out, uint16_t type, const union hgp_any *m)
{
    if (type == HGP_T_message_send)
        fprintf(out, " '%.*s' session=%u scene='%.*s'", TEXT(m->message_send.text),
            (unsigned)(m->message_send.has_session ? m->message_send.session : 0),
            TEXT(m->message_send.scene));
    if (type == HGP_T_kick)
        fprintf(out, " %llu reason='%.*s' block=%u", (unsigned long long)m->kick.session,
            TEXT(m->kick.reason), m->kick.has_block_s ? m->kick.block_s : 0);
    if (type == HGP_T_drain_set)
        fprintf(out, " ms=%u reason='%.*s' stay=%d cancel=%d", m->drain_set.deadline_ms,
            TEXT(m->drain_set.reason), m->drain_set.has_stay && m->drain_set.stay,
            m->drain_set.has_cancel && m->drain_set.cancel);
    if (type == HGP_T_join_make)
        fprintf(out, " scene='%.*s' role=%s uses=%u valid=%u label='%.*s'",
            TEXT(m->join_make.scene), hgp_enum_name("role", m->join_make.role),
            m->join_make.has_uses ? m->join_make.uses : 0,
            m->join_make.has_valid_s ? m->join_make.valid_s : 0, TEXT(m->join_make.label));
    if (type == HGP_T_join_revoke)
        fprintf(out, " %llu", (unsigned long long)m->join_revoke.ticket);
}

static void log_message(const char *name, uint16_t type, const union hgp_any *m)
{
    const char *path = word("log");
    FILE *out = path ? fopen(path, "a") : NULL;
    if (!out)
        return;
    fprintf(out, "%s", name);
    if (type == HGP_T_asset_load)
        fprintf(out, " path=%.*s files=%u", (int)m->asset_load.path.size, m->asset_load.path.data,
            m->asset_load.files.count);
    if (type == HGP_T_scene_open)
        fprintf(out, " %.*s", (int)m->scene_open.name.size,
            m->scene_open.name.size ? m->scene_open.name.data : "");
    if (type == HGP_T_upload)
        fprintf(out, " total=%llu", (unsigned long long)m->upload.total);
    if (type == HGP_T_frame_request && m->frame_request.has_rate_numerator)
        fprintf(
            out, " rate=%u/%u", m->frame_request.rate_numerator, m->frame_request.rate_denominator);
    if (type == HGP_T_frame_cancel)
        fprintf(out, " view=%u request=%u", m->frame_cancel.view, m->frame_cancel.request);
    if (type == HGP_T_animation_set)
        fprintf(out, " time=%g", m->animation_set.time_s);
    if (type == HGP_T_environment_set)
        fprintf(out, " kind=%s", hgp_enum_name("environment_kind", m->environment_set.kind));
    if (type == HGP_T_environment_set && m->environment_set.has_sun)
        fprintf(out, " sun=%d at %.3g,%.3g,%.3g turbidity=%g", m->environment_set.sun,
            (double)m->environment_set.sun_direction[0],
            (double)m->environment_set.sun_direction[1],
            (double)m->environment_set.sun_direction[2], (double)m->environment_set.turbidity);
    if (type == HGP_T_view_camera)
        fprintf(out, " eye=%.6g,%.6g,%.6g camera=%llu", (double)m->view_camera.eye[0],
            (double)m->view_camera.eye[1], (double)m->view_camera.eye[2],
            (unsigned long long)m->view_camera.camera);
    if (type == HGP_T_view_fit)
        fprintf(out, " cameras=%d azimuth=%.4g elevation=%.4g vfov=%.4g", m->view_fit.cameras,
            (double)m->view_fit.azimuth_rad, (double)m->view_fit.elevation_rad,
            (double)m->view_fit.vfov_rad);
    if (type == HGP_T_view_camera && m->view_camera.has_lens_radius)
        fprintf(out, " lens=%g,%g", (double)m->view_camera.lens_radius,
            (double)m->view_camera.focus_distance);
    if (type == HGP_T_node_set)
        fprintf(out, " node=%llu catches=%d", (unsigned long long)m->node_set.node,
            m->node_set.catches_shadows);
    if (type == HGP_T_image_query && m->image_query.has_offset)
        fprintf(out, " part=%llu size=%llu", (unsigned long long)m->image_query.offset,
            (unsigned long long)m->image_query.size);
    if (type == HGP_T_checkpoint_set)
        fprintf(out, " %.*s", (int)m->checkpoint_set.data.size, m->checkpoint_set.data.data);
    if (type == HGP_T_view_set && m->view_set.has_mode)
        fprintf(out, " mode=%u trace=%u bounces=%u noise=%g time=%g planes=%x", m->view_set.mode,
            m->view_set.trace, m->view_set.max_bounces, (double)m->view_set.noise,
            (double)m->view_set.time_limit_s, m->view_set.planes);
    if (type == HGP_T_view_set && m->view_set.has_filter)
        fprintf(out, " filter=%u,%g clamp=%g", m->view_set.filter,
            (double)m->view_set.filter_radius_px, (double)m->view_set.clamp_indirect);
    if (type == HGP_T_view_set && m->view_set.has_exposure_mode && !m->view_set.has_width)
        fprintf(out, " exposure=%u,%g", m->view_set.exposure_mode, (double)m->view_set.exposure_ev);
    const float *region = m->view_set.region;
    if (type == HGP_T_view_set && m->view_set.has_region)
        fprintf(out, " region=%g,%g,%g,%g", (double)region[0], (double)region[1], (double)region[2],
            (double)region[3]);
    if (type == HGP_T_view_set)
        fprintf(out, " size=%ux%u samples=%u", m->view_set.width, m->view_set.height,
            m->view_set.samples);
    log_management(out, type, m);
    fprintf(out, "\n");
    fclose(out);
}

static void answer_query(const struct hgp_header *h, const union hgp_any *m)
{
    static const char stats[] = "{\"device\":{\"name\":\"fake\"},\"frame\":{\"render_ms\":1.5}}";
    static const char info[] = "{\"assets\":[{\"counts\":{\"nodes\":2},\"extensions\":[\"A\"]}]}";
    static const char sessions[] = "{\"sessions\":[{\"id\":1,\"name\":\"a\"}]}";
    switch ((enum hgp_type)h->type) {
    case HGP_T_view_fit:
        answer(h, HGP_T_view_fitted,
            &(struct hgp_view_fitted){.camera = m->view_fit.cameras ? (1ull << 32 | 1) : 0,
                .eye = {0, 0, 5},
                .up = {0, 1, 0},
                .vfov_rad = m->view_fit.has_vfov_rad ? m->view_fit.vfov_rad : 0.8f,
                .half_height = 1});
        break;
    case HGP_T_pick:
        answer(h, HGP_T_picked, &(struct hgp_picked){.hit = m->pick.x < 10, .node = 1ull << 32});
        break;
    case HGP_T_stats_query:
        answer(h, HGP_T_json, &(struct hgp_json){.text = hgp_str_make(stats)});
        break;
    case HGP_T_info_query:
        answer(h, HGP_T_json, &(struct hgp_json){.text = hgp_str_make(info)});
        break;
    case HGP_T_sessions_query:
        answer(h, HGP_T_json, &(struct hgp_json){.text = hgp_str_make(sessions)});
        break;
    case HGP_T_join_query:
        answer(h, HGP_T_json,
            &(struct hgp_json){
                .text = hgp_str_make(word("tickets") ? "{\"tickets\":[{\"ticket\":4,\"label\":"
                                                       "\"ann\",\"used\":1}]}"
                                                     : "{\"tickets\":[]}")});
        break;
    case HGP_T_join_make:
        answer(h, HGP_T_join_ticket,
            &(struct hgp_join_ticket){.ticket = 4,
                .secret = hgp_str_make("hj-secret"),
                .scene = m->join_make.scene,
                .role = m->join_make.role,
                .uses = m->join_make.has_uses ? m->join_make.uses : 1,
                .valid_s = m->join_make.has_valid_s ? m->join_make.valid_s : 3600});
        break;
    case HGP_T_bake: {
        const char *report = word("unbaked")  ? "{\"textures\":{\"failures\":[{\"what\":\"a.png\","
                                                "\"reason\":\"broken\"}]}}"
                             : word("absent") ? "{\"cache\":{\"absent\":2}}"
                                              : "{\"textures\":{\"packs\":2}}";
        answer(h, HGP_T_json, &(struct hgp_json){.text = hgp_str_make(report)});
        break;
    }
    case HGP_T_compare:
        send_compared(h, &m->compare);
        break;
    case HGP_T_job_query:
        answer(h, HGP_T_job, &(struct hgp_job){.hash = {job_byte()}});
        break;
    case HGP_T_exposure_query:
        answer(h, HGP_T_exposure,
            &(struct hgp_exposure){.mode = HGP_exposure_mode_AUTO, .exposure_ev = -2.5f});
        break;
    case HGP_T_image_query:
        send_image(h, &m->image_query);
        break;
    case HGP_T_checkpoint_query:
        send_checkpoint(h);
        if (held.is_set)
            send_frame(&held.header, &held.request);
        held.is_set = false;
        break;
    default:
        answer(h, HGP_T_ok, &(struct hgp_ok){.revision = 1});
    }
}

static void greet(const struct hgp_header *h)
{
    const char *version = word("version");
    struct hgp_welcome welcome = {
        .version = (uint16_t)(version ? atoi(version) : 1),
        .server = hgp_str_make("fake/1"),
        .session = 7,
        .auth_required = word("token") != NULL,
        .role = HGP_role_ADMIN,
        .max_message_bytes = 1 << 20,
    };
    answer(h, HGP_T_welcome, &welcome);
}

static void check_token(const struct hgp_header *h, const struct hgp_auth *auth)
{
    const char *token = word("token");
    if (token && strlen(token) == auth->token.size &&
        memcmp(token, auth->token.data, auth->token.size) == 0) {
        answer(h, HGP_T_auth_ok, &(struct hgp_auth_ok){.role = HGP_role_EDIT});
        return;
    }
    struct hgp_error error = {.code = HG_E_AUTH, .reason = hgp_str_make("unknown token")};
    answer(h, HGP_T_error, &error);
    end();
}

static void respond(const struct hgp_header *h, const union hgp_any *m)
{
    if (h->type == HGP_T_animation_set && word("folder"))
        mkdir(word("folder"), 0777);
    switch ((enum hgp_type)h->type) {
    case HGP_T_hello:
        greet(h);
        return;
    case HGP_T_auth:
        check_token(h, &m->auth);
        return;
    case HGP_T_ping:
        answer(h, HGP_T_pong, &(struct hgp_pong){.nonce = m->ping.nonce});
        return;
    case HGP_T_scene_open:
        answer(h, HGP_T_scene_opened, &(struct hgp_scene_opened){.first_id = 1, .id_count = 1000});
        return;
    case HGP_T_asset_load:
        send_loaded(h, &m->asset_load);
        return;
    case HGP_T_nodes_query:
        send_nodes(h);
        return;
    case HGP_T_frame_request:
        if (!refuse_paced(h) && !hold_for_drain(h, &m->frame_request))
            send_frame(h, &m->frame_request);
        return;
    case HGP_T_upload_query:
        send_have(h, &m->upload_query);
        return;
    case HGP_T_session_attach:
        if (h->request)
            answer(h, HGP_T_ok, &(struct hgp_ok){0});
        return;
    case HGP_T_view_camera:
    case HGP_T_pong:
        return;
    default:
        if (h->request)
            answer_query(h, m);
    }
}

static struct hgp_header late; // what was not answered yet

static void answer_late(void)
{
    if (!late.request)
        return;
    answer(&late, HGP_T_progress, &(struct hgp_progress){.stage = hgp_str_make("late")});
    answer(&late, HGP_T_ok, &(struct hgp_ok){0});
    late.request = 0;
}

// True when FAKE says something about this message instead of an answer.
static bool misbehave(const struct hgp_header *h, const char *name)
{
    const char *value = word("die");
    if (value && strcmp(value, name) == 0)
        end();
    value = word("silent");
    if (value && strcmp(value, name) == 0)
        return true;
    value = word("late");
    if (value && strcmp(value, name) == 0) {
        late = *h;
        return true;
    }
    value = word("fail");
    size_t n = strlen(name);
    if (value && strncmp(value, name, n) == 0 && value[n] == ':') {
        struct hgp_error error = {.code = (uint16_t)atoi(value + n + 1),
            .what = hgp_str_make(strcmp(name, "view_camera") == 0 ? "camera" : "fake.gltf"),
            .where = hgp_str_make("/meshes/0"),
            .reason = hgp_str_make("as the test wants")};
        answer(h, HGP_T_error, &error);
        return true;
    }
    return false;
}

static void send_stray(uint32_t channel)
{
    struct hgp_header nobody = {.request = 0, .channel = channel};
    struct hgp_notice notice = {.reason = hgp_str_make("stray")};
    answer(&nobody, HGP_T_notice, &notice);
    answer(&nobody, HGP_T_ping, &(struct hgp_ping){.nonce = 5});
}

// As the broker of a worker that works for long gets them.
static void send_signs_of_life(uint32_t channel, int count)
{
    const struct hgp_header worker = {0}, session = {.channel = channel};
    for (int i = 0; i < count; i++) {
        if (word("beat"))
            usleep((useconds_t)atoi(word("beat")) * 1000);
        answer(&worker, HGP_T_busy, &(struct hgp_busy){.channel = channel, .view = 1});
        answer(&worker, HGP_T_pulse, &(struct hgp_pulse){.busy_ns = 1000000});
        answer(&session, HGP_T_ping, &(struct hgp_ping){.nonce = 5});
    }
}

static bool serve_one(void)
{
    uint8_t bytes[HGP_HEADER_BYTES];
    struct hgp_header h;
    if (!receive(bytes, sizeof bytes))
        return false;
    if (hgp_header_decode(bytes, sizeof bytes, HGP_LIMIT_OPEN_DEFAULT, &h))
        abort();
    uint8_t *payload = malloc(h.length + 1);
    struct hg_arena arena = {0};
    union hgp_any m;
    if (!payload || !receive(payload, h.length))
        return false;
    if (hgp_decode(1, h.type, hg_reader_make(payload, h.length), &arena, &m, NULL))
        abort();
    const char *name = hgp_find(h.type)->name;
    log_message(name, h.type, &m);
    if (word("stray") && h.type != HGP_T_hello && h.type != HGP_T_pong)
        send_stray(h.channel);
    if (word("alive") && h.request)
        send_signs_of_life(h.channel, atoi(word("alive")));
    answer_late();
    if (!misbehave(&h, name))
        respond(&h, &m);
    hg_arena_finish(&arena);
    free(payload);
    return true;
}

static void send_file(const char *path)
{
    uint8_t bytes[65536];
    FILE *in = fopen(path, "rb");
    size_t n = in ? fread(bytes, 1, sizeof bytes, in) : 0;
    send_bytes(bytes, n);
    shutdown(peer_fd, SHUT_WR);
    while (recv(peer_fd, bytes, sizeof bytes, 0) > 0)
        ;
    _exit(0);
}

static void send_raw(const char *hex)
{
    for (; hex[0] && hex[1]; hex += 2) {
        unsigned byte;
        sscanf(hex, "%2x", &byte);
        send_bytes(&(uint8_t){(uint8_t)byte}, 1);
    }
}

static void serve(int fd)
{
    peer_fd = fd;
    uint8_t preface[HGP_PREFACE_BYTES];
    if (!is_worker && !receive(preface, sizeof preface))
        _exit(0);
    if (word("file"))
        send_file(word("file"));
    if (word("raw"))
        send_raw(word("raw"));
    if (is_worker && !word("raw")) {
        struct hgp_worker_ready ready = {.pid = (uint32_t)getpid(), .device = hgp_str_make("{}")};
        answer(NULL, HGP_T_worker_ready, &ready);
    }
    while (serve_one())
        ;
    _exit(0);
}

static int listen_on(const char *path)
{
    struct sockaddr_un sa = {.sun_family = AF_UNIX};
    snprintf(sa.sun_path, sizeof sa.sun_path, "%s", path);
    int listener = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    unlink(path);
    if (listener < 0 || bind(listener, (struct sockaddr *)&sa, sizeof sa) || listen(listener, 16))
        return -1;
    return listener;
}

int main(int argc, char **argv)
{
    if (argc < 3)
        return 2;
    if (strcmp(argv[1], "--fd") == 0) {
        is_worker = true;
        serve(atoi(argv[2]));
    }
    int listener = strcmp(argv[1], "--inherit") == 0 ? atoi(argv[2]) : listen_on(argv[2]);
    if (listener < 0)
        return 1;
    signal(SIGCHLD, SIG_IGN);
    puts("ready");
    fflush(stdout);
    for (;;) {
        int fd = accept(listener, NULL, NULL);
        if (fd >= 0 && fork() == 0)
            serve(fd);
        if (fd >= 0)
            close(fd);
    }
}
