// serve.h - what the render thread owns: scenes, sessions, views; and the handlers of messages.
// Floor 6, private to server/worker. Everything here runs on the render thread.
#ifndef HG_SERVER_WORKER_SERVE_H
#define HG_SERVER_WORKER_SERVE_H

#include "server/worker/lazy_device.h"
#include "server/worker/task.h"
#include "server/worker/worker.h"

// A scene shared by the sessions that name its key.
struct scene_slot {
    struct scene_slot *next;
    char *key;
    struct hg_scene *scene;
    uint32_t sessions;
    bool dirty; // edits since the last publish, inside somebody's batch
    uint32_t open_batches;
    uint64_t batch_started_ns;
    double time_s;                      // of the newest pose
    struct hg_fingerprint *fingerprint; // NULL until a job is asked for
    uint8_t hash[32];                   // of what it held when a job was asked about last
};

// A client waiting for one frame of a view.
struct frame_wait {
    struct frame_wait *next;
    uint32_t request;
    bool settled, parts;
    enum hgp_encoding encoding;
    uint8_t quality;
    uint64_t progress_sent_ns;
    uint32_t most_missing; // pages and clusters, since it was asked for
    uint32_t most_baking;  // mesh parts
    uint64_t baked_before; // texels, when it was asked for; `began` then
    bool began;
};

struct view_slot {
    struct view_slot *next;
    uint32_t number;
    struct hg_view *view;
    struct hg_view_params params;
    uint32_t mattes; // bits of enum hg_matte_kind
    enum hgp_encoding encoding, still_encoding;
    uint8_t quality;
    float max_fps;
    struct hg_view_camera camera;
    uint64_t camera_node; // 0: `camera` counts
    uint64_t camera_node_revision;
    struct frame_wait *waits;
    uint32_t credit; // frames the subscription may still send
    uint64_t sent_ns, sent_number, sent_samples;
    bool fresh;                // nothing of the newest step's state has been sent yet
    bool changed;              // camera or parameters since the newest step
    bool failed;               // the newest step failed; rests until something changes
    uint64_t failed_revision;  // of the scene then
    struct hg_frame_info info; // of the newest step
    bool stepped;
    uint32_t told_failures;         // textures that could not be read, as far as the client knows
    uint64_t step_ns;               // per sample, of the newest step
    uint64_t spent_ns;              // rendering, since the state was new
    bool job_asked;                 // its settled frames say what they were made from
    enum hgp_encoding job_encoding; // that was asked about
    uint8_t job_quality;
    uint8_t job_after[32]; // job of the picture before in a series; zero = none
    // Checkpoints on their way in parts: what is sent, what has come of `receive_bytes`.
    struct hg_writer sending, receiving;
    enum hgp_checkpoint_kind receiving_kind;
    uint64_t receive_bytes;
    struct hgp_checkpoint sending_notes; // without data
};

struct session {
    struct session *next;
    uint32_t channel;
    uint64_t number;
    enum hgp_role role;
    struct scene_slot *scene;
    uint32_t first_id, id_count;
    uint64_t max_pixels;
    uint32_t batch_depth;
    bool restoring; // until replay_end
    struct view_slot *views;
    struct task *task; // running; later messages wait in `waiting`
    struct command *waiting, **waiting_end;
    uint32_t waiting_count;
    uint64_t waiting_bytes; // of their payloads
    struct hg_writer file;  // of image_query, as far as its parts have come
    uint64_t file_bytes;    // of all of it, as its first part said; 0 = none has begun
};

struct serve {
    struct worker *w;
    uint64_t started_ns;
    struct hg_renderer *renderer; // created when the first view needs it
    struct opener opener;         // or earlier
    struct hg_jobs *jobs;         // for loads before there is a renderer
    struct session *sessions;
    struct scene_slot *scenes;
    struct view_slot *turn; // view that was stepped last
    char device[128];       // name, once told
    uint32_t tasks;         // running
};

// A decoded message and where its answer goes.
struct request {
    struct serve *s;
    struct session *session;
    uint32_t channel, id;
    struct hg_refbuf *payload; // keeps the views of *message alive
    const union hgp_any *message;
};

// ---- dispatch.c -----------------------------------------------------------------------------------

void serve_answer(const struct request *r, enum hgp_type type, const void *message);
void serve_ok(const struct request *r);
void serve_fail(const struct request *r, const struct hg_error *err);
// Publishes an edit (unless a batch is open) and answers ok.
void serve_edited(const struct request *r);
// Begins to create the renderer, in the background.
void serve_expect_renderer(struct serve *s);
// Creates the renderer when there is none yet.
enum hg_status serve_need_renderer(struct serve *s, struct hg_error *err) HG_MUST_CHECK;

// ---- session.c ----------------------------------------------------------------------------------

struct session *session_find(struct serve *s, uint32_t channel);
void session_attach(
    struct serve *s, uint32_t channel, uint32_t request, const struct hgp_session_attach *m);
void session_detach(struct serve *s, struct session *session);
// Publishes what the session's open batch changed, if there is one.
void session_close_batch(struct session *session);
// Publishes what open batches changed so far: before a view looks at the scene all the same. What
// it keeps of the scene may be gone.
void session_publish(struct session *session);
struct view_slot *session_find_view(struct session *session, uint32_t number);
// NULL: the request was answered with the error.
struct view_slot *session_need_view(const struct request *r, uint32_t number);
void view_slot_destroy(struct serve *s, struct session *session, struct view_slot *view);

// ---- handlers: each answers the request ---------------------------------------------------------

// edit_load.c
void edit_asset_load(const struct request *r);
void edit_asset_unload(const struct request *r);
void edit_environment_set(const struct request *r);
void edit_animation_set(const struct request *r);
void edit_variant_set(const struct request *r);
// edit_mesh.c
void edit_mesh_set(const struct request *r);
// edit_object.c
// The object with this id; made when the id is new and lies in the session's range. NULL: the
// request has been answered with the error.
struct hg_object *serve_find_or_make(
    const struct request *r, enum hg_object_kind kind, uint64_t id, const char *message);
void edit_texture_set(const struct request *r);
void edit_material_set(const struct request *r);
void edit_node_set(const struct request *r);
void edit_light_set(const struct request *r);
void edit_camera_set(const struct request *r);
void edit_object_remove(const struct request *r);
void edit_batch_begin(const struct request *r);
void edit_batch_end(const struct request *r);
// view.c
void view_set(const struct request *r);
void view_close(const struct request *r);
void view_camera(const struct request *r);
void view_frame_request(const struct request *r);
void view_subscribe(const struct request *r);
void view_credit(const struct request *r);
// film.c
void view_job_query(const struct request *r);
void view_checkpoint_query(const struct request *r);
void view_checkpoint_set(const struct request *r);
// query.c
void query_pick(const struct request *r);
void query_bounds(const struct request *r);
void query_nodes(const struct request *r);
void query_stats(const struct request *r);
void query_info(const struct request *r);
void query_compare(const struct request *r);
void query_image(const struct request *r);
void query_image_finish(const struct request *r, const struct hg_image_told *told);
// bench.c, bake.c
void query_bench(const struct request *r);
void query_bake(const struct request *r);

// Applies and answers a finished task (edit_load.c, query.c).
void task_finish(const struct request *r, struct task *task);
// Starts a task for the request; the message is decoded again so that it outlives the request.
void serve_start_task(const struct request *r, enum task_kind kind, enum hgp_type type);

// ---- film.c: what a frame is made from and goes with --------------------------------------------

// Planes of the protocol to those of the renderer and bits of enum hg_matte_kind. HG_E_UNSUPPORTED
// names one that there is not.
enum hg_status film_planes(
    uint32_t bits, uint32_t *planes, uint32_t *mattes, struct hg_error *err) HG_MUST_CHECK;
// Of the frame that the view would give when settled, in an encoding.
enum hg_status film_job(struct serve *s, struct session *session, struct view_slot *view,
    enum hgp_encoding encoding, uint8_t quality, uint8_t hash[32],
    struct hg_error *err) HG_MUST_CHECK;
// Fills notes and planes of a frame that is about to be encoded, and frame.job.
enum hg_status film_attach(struct serve *s, struct session *session, struct view_slot *view,
    struct encode_job *job, struct hg_error *err) HG_MUST_CHECK;

// ---- view.c: the schedule -----------------------------------------------------------------------

// Steps one view that has work, in turn, and sends what became due. False: nothing to do; then
// *wait_ns is how long until a view may have work (UINT64_MAX: only after a message).
bool view_step_next(struct serve *s, uint64_t *wait_ns);
// Pose, lens and parameters of a view are up to date with its scene; steps once if it never did.
enum hg_status view_refresh(struct serve *s, struct session *session, struct view_slot *view,
    struct hg_error *err) HG_MUST_CHECK;

#endif
