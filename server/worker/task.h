// task.h - slow work off the render thread: loading files, comparing images, encoding frames.
// Floor 6, private to server/worker.
#ifndef HG_SERVER_WORKER_TASK_H
#define HG_SERVER_WORKER_TASK_H

#include "renderer/light/env/env_file.h"
#include "renderer/renderer.h"
#include "server/worker/worker.h"

enum task_kind { TASK_ASSET, TASK_ENVIRONMENT, TASK_COMPARE, TASK_IMAGE };

// One job with its own thread. While it runs its session's later messages wait, so that every
// session sees its messages take effect in order.
struct task {
    enum task_kind kind;
    struct worker *w;
    uint32_t channel, request;
    uint64_t session;
    struct hg_refbuf *payload; // keeps message alive
    struct hg_arena arena;     // lists of message
    union hgp_any message;
    struct hg_writer file; // IMAGE: when it came in parts
    struct hg_jobs *jobs;
    _Atomic bool cancel;
    uint64_t progress_sent_ns;
    // Results:
    enum hg_status status;
    struct hg_error err;
    struct hg_asset *asset;
    struct hg_environment_file environment;
    double value;
    struct hg_image_told told;
    struct hg_writer diff;
    uint32_t width, height;
};

// Starts `task` (owned by its thread until it comes back through the inbox). HG_E_LIMIT.
enum hg_status task_start(struct task *task) HG_MUST_CHECK;
void task_destroy(struct task *task); // accepts NULL

// What a file says besides its pixels.
struct encode_notes {
    char device[128];
    uint32_t seed;
    double time_s;             // the scene's pose
    float shutter[2], frame_s; // frames from the pose; seconds
    float exposure;
    enum hg_view_denoise denoise;
    bool traced; // in path mode; else nothing is said of what follows
    enum hg_filter filter;
    uint32_t max_bounces;
    float filter_radius_px, clamp_indirect;
    float lens_radius, focus_distance; // metres; radius 0 = all is sharp
    float world_to_camera[16], world_to_ndc[16];
    char job[65];   // hexadecimal, or empty
    char scene[65]; // with a job: hash of what the scene holds
};

enum { ENCODE_MAX_PLANES = 40, ENCODE_MATTES = 3 };

// Pixels of a frame on their way to the encoder thread.
struct encode_job {
    uint32_t channel, request;
    struct hgp_frame frame; // without data, hash and stages
    uint8_t quality;
    bool opaque;
    bool parts; // the data may go in parts
    struct hg_refbuf *pixels;
    struct hg_frame_info info;
    uint64_t read_ns;
    struct encode_notes notes;
    struct encode_plane {
        enum hg_plane plane;
        char name[32];            // of the part; "": the plane's
        struct hg_refbuf *values; // floats
    } planes[ENCODE_MAX_PLANES];  // EXR only
    uint32_t plane_count;
    struct hg_matte mattes[ENCODE_MATTES]; // by kind; without ranks: not asked for
};

// Key of the text attribute that holds the hash of what a file was made from.
#define ENCODE_JOB_KEY "heliograph:job"

// An EXR file of the picture and its planes (encode_exr.c).
enum hg_status encode_exr(
    const struct encode_job *job, struct hg_writer *out, struct hg_error *err) HG_MUST_CHECK;

// Pixel format that an encoding starts from.
enum hg_pixel_format encode_pixel_format(enum hgp_encoding encoding);
void *encode_main(void *worker); // the encoder thread
void encode_job_destroy(struct encode_job *job);

// Real path of a file that lies under the asset roots: absolute, or relative to one of them.
// *out is freed with hg_free. HG_E_NOTFOUND, HG_E_PERM.
enum hg_status path_resolve(const struct worker_options *options, struct hgp_str path, char **out,
    struct hg_error *err) HG_MUST_CHECK;
// `<cache>/uploads/<hex>`; HG_E_STATE without a cache folder.
enum hg_status path_upload(const struct worker_options *options, const uint8_t hash[32], char **out,
    struct hg_error *err) HG_MUST_CHECK;

#endif
