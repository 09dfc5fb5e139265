// render_state.h - what the render thread owns: the renderer, scenes, sessions.
// Floor 6, private to server/worker. Thread: the render thread.
#ifndef HG_SERVER_WORKER_RENDER_STATE_H
#define HG_SERVER_WORKER_RENDER_STATE_H

#include "renderer/renderer.h"
#include "server/worker/lazy_device.h"
#include "server/worker/turn.h"
#include "server/worker/worker.h"

struct session;
struct scene_slot;
struct tenant;

struct render_state {
    struct worker *w;
    uint64_t started_ns;
    struct hg_renderer *renderer; // created when the first view needs it,
    struct lazy_device lazy;      // or begun earlier
    struct hg_jobs *jobs;         // for loads before there is a renderer
    struct session *sessions;
    struct scene_slot *scenes;
    struct tenant *tenants;
    struct turn_clock clock; // of the tenants
    struct command *blocked; // out of the inbox, but its session has no room for it yet
    char device[128];       // name, created on first use
    uint32_t tasks;         // running
};

// Begins to create the renderer, in the background.
void hg_render_state_expect_renderer(struct render_state *s);
// Creates the renderer when there is none yet.
enum hg_status hg_render_state_need_renderer(
    struct render_state *s, struct hg_error *err) HG_MUST_CHECK;
// The threads for loads; made when there are none yet. NULL: no memory.
struct hg_jobs *hg_render_state_need_jobs(struct render_state *s);
// Name of the device; "" while there is no renderer.
const char *hg_render_state_device_name(struct render_state *s);
// After the sessions.
void hg_render_state_finish(struct render_state *s);

#endif
