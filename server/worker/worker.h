// worker.h - what the threads of helio-worker share, and the layers of its files.
// Floor 6, private to server/worker.
//
// Three kinds of threads: the I/O thread owns the socketpair (io_thread.c); the render thread owns
// the renderer, the scenes, the sessions and their views (dispatch.c and everything it calls); task
// threads load files (task.c) and encoder threads encode frames (encode_queue.c). They meet only in
// the bounded queues of struct worker. A broker may run several workers.
//
// Files include only files of the lines above their own, and what a .c file exports is declared in
// its own header, so calls go the same way. tests/unit/floors/floors.py reads this list:
// Layers, lowest first:
//   turn watch                              whose turn it is; what threads are at
//   view_control                            what the network delivers, what frames may cost
//   worker                                  options, queues between threads
//   reply asset_path sandbox lazy_device    messages out; what may be read; the device in advance
//   shader_seed                             compiled shaders in advance
//   view_params frame_planes picture_extremes    parameters, planes and pixels, of protocol and
//   encode_depth                            how far its surfaces are, as bytes
//   renderer encode_request                          a frame to be encoded, and what its file says
//   encode_exr encode_tiles yuv rate_control    files and frames as bytes
//   h264
//   encode_openh264 encode_x264 encode_av1  video
//   encoder                                 encodings behind one interface
//   encode_queue                            a stream of requests for each view, encoder threads
//   io_thread task                          the socketpair; loads and comparisons
//   render_state                            what the render thread owns
//   scene_slot
//   session
//   view_slot
//   view_codec view_memory                  negotiation of codecs; what sessions may take for views
//   load_memory                             and for files
//   request                                 a decoded message, and who is answered
//   variant                                 material variants by name
//   view_fit                                cameras that show the scene; that of a view without one
//   frame_key                               the hash of what a frame is made from
//   frame_metadata frame_depth              what a frame says besides its pixels
//   view_rate                               credit, frame rate, progress
//   view_output                             reads what a step left
//   view_schedule                           whose turn it is to render
//   session_messages view_messages checkpoint edit_load edit_object query bake    handlers
//   view_look surface_query                 likewise
//   edit_mesh
//   dispatch                                the render thread
//   main
#ifndef HG_SERVER_WORKER_WORKER_H
#define HG_SERVER_WORKER_WORKER_H

#include <stdatomic.h>

#include "base/queue.h"
#include "base/refbuf.h"
#include "base/spill.h"
#include "base/status.h"
#include "protocol/hgp.h"
#include "renderer/scene_gpu/debug_overrides.h"
#include "server/loader/loader_client.h"
#include "server/worker/watch.h"

enum { WORKER_EXIT_DISK = 9 };

struct encode_queue;
struct task;

enum hg_sandbox_mode {
    HG_SANDBOX_BEST_EFFORT, // with what the kernel has
    HG_SANDBOX_REQUIRE,     // all of it, and what must fail does fail, or no worker
    HG_SANDBOX_OFF,
};

struct worker_options {
    int fd;             // the socketpair's end; default 3
    char **asset_roots; // [asset_root_count] real paths
    uint32_t asset_root_count;
    const char *cache_dir;   // NULL: none
    const char *upload_dir;  // has `uploads`, contents by hash; NULL: the cache folder
    const char *shader_seed; // compiled shaders to begin with; NULL: none
    const char *shader_dir; // NULL: embedded shaders
    const char *device;     // NULL: best
    uint64_t memory_limit_bytes, texture_budget_bytes, geometry_budget_bytes; // 0 = unlimited
    uint64_t host_budget_bytes, cache_limit_bytes;
    uint32_t threads; // at most, for one thing at a time; 0 = one per core
    enum hg_sandbox_mode sandbox;
    struct loader_options loader;
    bool no_spill, device_info, compile_shaders, validation, warm_up;
    struct hg_debug_overrides overrides; // from the environment
};

// A message on its way to the render thread, or a finished task; neither: a wake-up.
struct command {
    struct hgp_header header;
    uint64_t received_ns;      // when its header came
    struct hg_refbuf *payload; // bytes of the message; NULL for a finished task
    struct task *task;         // finished task, else NULL
    struct command *next;      // while queued behind a session's running task
};

struct worker {
    struct worker_options options;
    struct hg_queue inbox;         // struct command *, I/O, task and encoder threads -> render
    struct hg_queue outbox;        // struct hg_refbuf *, whole messages, all threads -> I/O
    struct encode_queue *encoders; // render -> encoder threads; set before the threads start
    struct command wake;           // in the inbox while wake_queued
    _Atomic bool wake_queued;
    struct watch_list watch; // all threads but the I/O thread, which reads it
    _Atomic uint32_t view_count;
    _Atomic uint64_t encode_ns; // of the newest frame
    _Atomic bool stop, device_lost, disk_lost;
    struct hg_spill_loss loss; // once disk_lost is set
};

// The queues of a worker whose options are set; on error hg_worker_finish is still to be called.
enum hg_status hg_worker_init(struct worker *w) HG_MUST_CHECK;
// After all threads have ended. What is still queued is dropped; options stay.
void hg_worker_finish(struct worker *w);

// Wakes the render thread. Any thread; never waits, allocates nothing.
void hg_worker_wake(struct worker *w);
// Frees what came out of the inbox, or remembers that the wake-up did.
void hg_worker_free_command(struct worker *w, struct command *c);
// Ends the process soon: only a new one gets a clean device. Any thread.
void hg_worker_lose_device(struct worker *w, const struct hg_error *err);

#endif
