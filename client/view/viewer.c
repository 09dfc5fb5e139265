// viewer.c - the window of `helio view`: its loop, events and drawing.
#include "client/view/viewer.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "client/cli/cli.h"

enum {
    IDLE_MS = 100, // between looks at the state while nothing comes
    MOVING_MS = 8, // while keys or sticks move the camera
    FONT_PX = 15,
    DRAG_PX = 4,     // that a press moves before it is no click
    CHECKER_PX = 16, // squares behind what is transparent
};
static const uint64_t message_ns = 4000000000, resize_ns = 150000000, second_ns = 1000000000;

void hg_viewer_say(struct hg_viewer *v, const char *fmt, ...)
{
    va_list args;
    va_start(args, fmt);
    vsnprintf(v->status.message, sizeof v->status.message, fmt, args);
    va_end(args);
    v->times.message_until_ns = hg_clock_now_ns() + message_ns;
    v->dirty = true;
}

void hg_viewer_send_camera(struct hg_viewer *v)
{
    struct hgp_view_camera camera = {0};
    if (v->status.state != HG_VIEW_OPEN)
        return;
    hg_navigate_camera(&v->navigate, &camera);
    const uint64_t seq = hg_view_session_camera(v->session, &camera);
    v->measured.sent[seq % HG_VIEWER_SENT_MAX] =
        (struct hg_viewer_sent){seq, hg_clock_now_ns(), camera};
    v->measured.newest_seq = seq;
    v->choice.camera = -1;
    v->dirty |= v->choice.reprojects;
}

// ---- what the session has ----------------------------------------------------------------------

static void show_picture(struct hg_viewer *v)
{
    const struct hg_view_pixels *p = &v->picture.pixels;
    int width = 0, height = 0;
    if (v->canvas.texture)
        SDL_QueryTexture(v->canvas.texture, NULL, NULL, &width, &height);
    if (width != (int)p->width || height != (int)p->height) {
        if (v->canvas.texture)
            SDL_DestroyTexture(v->canvas.texture);
        v->canvas.texture = SDL_CreateTexture(v->renderer, SDL_PIXELFORMAT_RGBA32,
            SDL_TEXTUREACCESS_STREAMING, (int)p->width, (int)p->height);
        if (v->canvas.texture)
            SDL_SetTextureBlendMode(v->canvas.texture, SDL_BLENDMODE_BLEND);
    }
    if (!v->canvas.texture ||
        SDL_UpdateTexture(v->canvas.texture, NULL, p->data, (int)p->width * 4))
        hg_viewer_say(v, "the picture cannot be shown: %s", SDL_GetError());
    struct hg_viewer_sent *sent =
        &v->measured.sent[v->picture.facts.input_seq % HG_VIEWER_SENT_MAX];
    if (sent->ns && sent->seq == v->picture.facts.input_seq) {
        v->measured.latency_ms = (double)(hg_clock_now_ns() - sent->ns) * 1e-6;
        sent->ns = 0;
    }
}

static void take_answer(struct hg_viewer *v, const struct hg_view_answer *answer)
{
    if (answer->ask == HG_VIEW_ASK_PICK)
        hg_viewer_note_picked(v, answer);
    else if (answer->ask == HG_VIEW_ASK_POINT)
        hg_viewer_note_point(v, answer);
    else if (answer->ask == HG_VIEW_ASK_VISIBLE)
        hg_viewer_note_visible(v, answer);
    else if (answer->hit) {
        hg_navigate_centre(&v->navigate, answer->position);
        hg_viewer_send_camera(v);
    }
}

static void take_answers(struct hg_viewer *v)
{
    struct hgp_view_camera camera;
    struct hg_view_answer answer;
    if (v->taken.fits != v->status.fits) {
        v->taken.fits = v->status.fits;
        if (hg_view_session_fitted(v->session, &camera) && camera.has_eye) {
            hg_navigate_look(&v->navigate, camera.eye, camera.target, &camera);
            if (!camera.has_camera) // else the view has the scene's camera already
                hg_viewer_send_camera(v);
        }
    }
    while (v->taken.answers != v->status.answers)
        if (hg_view_session_answer(v->session, ++v->taken.answers, &answer))
            take_answer(v, &answer);
    if (v->taken.lists != v->status.lists) {
        v->taken.lists = v->status.lists;
        hg_viewer_take_nodes(v);
    }
}

static void measure(struct hg_viewer *v)
{
    struct hg_viewer_measured *m = &v->measured;
    const uint64_t now_ns = hg_clock_now_ns();
    if (now_ns - m->since_ns < second_ns)
        return;
    const double s = (double)(now_ns - m->since_ns) * 1e-9;
    m->fps = (double)(v->status.frames - m->frames) / s;
    m->bytes_per_s = (double)(v->status.bytes - m->bytes) / s;
    m->frames = v->status.frames;
    m->bytes = v->status.bytes;
    m->since_ns = now_ns;
    v->dirty |= v->statistics;
}

static void take_session(struct hg_viewer *v)
{
    char message[HG_VIEW_TEXT_BYTES];
    memcpy(message, v->status.message, sizeof message);
    hg_view_session_status(v->session, &v->status);
    if (v->taken.messages != v->status.messages) {
        v->taken.messages = v->status.messages;
        v->times.message_until_ns = hg_clock_now_ns() + message_ns;
    } else {
        memcpy(v->status.message, message, sizeof message); // perhaps one of the window's own
    }
    if (v->taken.scenes != v->status.scene && v->status.state == HG_VIEW_OPEN) {
        v->taken.scenes = v->status.scene;
        hg_view_session_scene(v->session, v->scene);
        hg_viewer_begin_scene(v);
    }
    take_answers(v);
    if (hg_view_session_take(v->session, &v->picture))
        show_picture(v);
    v->dirty = true;
}

// ---- events ------------------------------------------------------------------------------------

static void on_key(struct hg_viewer *v, const SDL_KeyboardEvent *key, bool down)
{
    bool moves;
    const enum hg_view_action action = hg_controls_find(key->keysym.scancode, &moves);
    const bool shift = key->keysym.mod & KMOD_SHIFT;
    if (down && key->keysym.scancode == SDL_SCANCODE_Q && (key->keysym.mod & KMOD_CTRL))
        v->quits = true;
    else if (key->keysym.mod & (KMOD_CTRL | KMOD_ALT))
        return;
    else if ((down && hg_viewer_panel_key(v, key->keysym.scancode, shift)) ||
             action == HG_VIEW_ACTION_COUNT)
        return;
    else if (moves)
        v->controls.held[action] = down;
    else if (down && !key->repeat)
        hg_viewer_do(v, action, shift);
}

// What turns the camera once it moves is a click when it does not.
static void on_button(struct hg_viewer *v, const SDL_MouseButtonEvent *button)
{
    const bool down = button->type == SDL_MOUSEBUTTONDOWN;
    const bool shift = SDL_GetModState() & KMOD_SHIFT;
    const bool clicked = !down && v->pointer.clicks && button->button == SDL_BUTTON_LEFT;
    v->pointer.turns = down && button->button == SDL_BUTTON_LEFT && !shift;
    v->pointer.pans = down && !v->pointer.turns;
    v->pointer.clicks = v->pointer.turns;
    v->pointer.dx = v->pointer.dy = 0;
    SDL_CaptureMouse(v->pointer.turns || v->pointer.pans);
    if (clicked)
        hg_viewer_click(
            v, button->x, button->y, v->panels.measures ? HG_VIEW_ASK_POINT : HG_VIEW_ASK_PICK);
    if (v->pointer.turns && button->clicks == 2 && !v->panels.measures) {
        v->pointer.clicks = false;
        hg_viewer_click(v, button->x, button->y, HG_VIEW_ASK_CENTRE);
    }
}

static void on_motion(struct hg_viewer *v, const SDL_MouseMotionEvent *motion)
{
    struct hg_viewer_pointer *p = &v->pointer;
    p->dx += motion->xrel;
    p->dy += motion->yrel;
    if (p->clicks && abs(p->dx) + abs(p->dy) < DRAG_PX)
        return;
    p->clicks = false;
    if (p->turns)
        hg_navigate_drag(&v->navigate, p->dx, p->dy, v->height);
    else if (p->pans)
        hg_navigate_pan(&v->navigate, p->dx, p->dy, v->height);
    if (p->turns || p->pans)
        hg_viewer_send_camera(v);
    p->dx = p->dy = 0;
}

static void on_window(struct hg_viewer *v, const SDL_WindowEvent *event)
{
    v->dirty = true;
    if (event->event == SDL_WINDOWEVENT_SIZE_CHANGED) {
        SDL_GetRendererOutputSize(v->renderer, &v->width, &v->height);
        v->times.resized_ns = hg_clock_now_ns();
    } else if (event->event == SDL_WINDOWEVENT_FOCUS_LOST) {
        hg_controls_release(&v->controls);
        v->pointer = (struct hg_viewer_pointer){0};
    }
}

static void on_drop(struct hg_viewer *v, SDL_DropEvent *drop)
{
    if (drop->type == SDL_DROPFILE && drop->file)
        hg_view_session_open(v->session, drop->file);
    SDL_free(drop->file);
}

static void on_pointer(struct hg_viewer *v, const SDL_Event *e)
{
    if (!v->pointer.turns && !v->pointer.pans && hg_viewer_panel_pointer(v, e))
        return;
    switch (e->type) {
    case SDL_MOUSEBUTTONDOWN:
    case SDL_MOUSEBUTTONUP:
        on_button(v, &e->button);
        break;
    case SDL_MOUSEMOTION:
        on_motion(v, &e->motion);
        break;
    case SDL_MOUSEWHEEL:
        hg_navigate_wheel(&v->navigate, (double)e->wheel.preciseY);
        hg_viewer_send_camera(v);
        break;
    case SDL_CONTROLLERBUTTONDOWN:
        hg_viewer_do(v, hg_controls_button(e->cbutton.button, v->navigate.style), false);
        break;
    default:
        hg_controls_pad(&v->controls, e);
    }
}

static void on_event(struct hg_viewer *v, SDL_Event *e)
{
    switch (e->type) {
    case SDL_QUIT:
        v->quits = true;
        break;
    case SDL_WINDOWEVENT:
        on_window(v, &e->window);
        break;
    case SDL_KEYDOWN:
    case SDL_KEYUP:
        on_key(v, &e->key, e->type == SDL_KEYDOWN);
        break;
    case SDL_TEXTINPUT:
        hg_viewer_type(v, e->text.text);
        break;
    case SDL_DROPFILE:
    case SDL_DROPTEXT:
        on_drop(v, &e->drop);
        break;
    default:
        if (e->type == v->wake_event)
            take_session(v);
        else
            on_pointer(v, e);
    }
}

// ---- drawing -----------------------------------------------------------------------------------

// Squares of two greys, where the picture is transparent.
static void draw_checker(struct hg_viewer *v)
{
    SDL_SetRenderDrawColor(v->renderer, 46, 48, 52, 255);
    SDL_RenderClear(v->renderer);
    if (v->choice.background != HGP_background_NONE)
        return;
    SDL_SetRenderDrawColor(v->renderer, 60, 62, 66, 255);
    for (int y = 0; y < v->height; y += CHECKER_PX)
        for (int x = (y / CHECKER_PX % 2) * CHECKER_PX; x < v->width; x += 2 * CHECKER_PX)
            SDL_RenderFillRect(v->renderer, &(SDL_Rect){x, y, CHECKER_PX, CHECKER_PX});
}

bool hg_viewer_picture_rect(const struct hg_viewer *v, struct hg_projection_rect *rect)
{
    int width, height;
    if (!v->canvas.texture || SDL_QueryTexture(v->canvas.texture, NULL, NULL, &width, &height) ||
        width < 1 || height < 1)
        return false;
    *rect = hg_projection_picture(width, height, v->width, v->height);
    return true;
}

bool hg_viewer_is_reprojected(const struct hg_viewer *v)
{
    return v->choice.reprojects && v->picture.depth.is_known &&
           v->picture.facts.input_seq < v->measured.newest_seq;
}

// False: it cannot be, and the picture itself is to be shown.
static bool draw_reprojected(struct hg_viewer *v, const struct hg_projection_rect *r)
{
    struct hgp_view_camera camera = {0};
    struct hg_warp_mesh *mesh = &v->canvas.mesh;
    static const SDL_Color white = {255, 255, 255, 255};
    const int stride = (int)sizeof *mesh->vertices;
    hg_navigate_camera(&v->navigate, &camera);
    if (!hg_viewer_is_reprojected(v) || !hg_warp_build(mesh, &v->picture.depth, &camera, r))
        return false;
    SDL_RenderSetClipRect(v->renderer, &(SDL_Rect){r->x, r->y, r->width, r->height});
    const int failed = SDL_RenderGeometryRaw(v->renderer, v->canvas.texture, &mesh->vertices[0].x,
        stride, &white, 0, &mesh->vertices[0].u, stride, (int)(4 * mesh->quad_count), mesh->indices,
        (int)(6 * mesh->quad_count), sizeof *mesh->indices);
    SDL_RenderSetClipRect(v->renderer, NULL);
    return failed == 0;
}

static void draw_picture(struct hg_viewer *v)
{
    struct hg_projection_rect r;
    if (hg_viewer_picture_rect(v, &r) && !draw_reprojected(v, &r))
        SDL_RenderCopy(
            v->renderer, v->canvas.texture, NULL, &(SDL_Rect){r.x, r.y, r.width, r.height});
}

static void draw(struct hg_viewer *v)
{
    char title[400];
    hg_viewer_title(v, title, sizeof title);
    if (strcmp(title, SDL_GetWindowTitle(v->window)) != 0)
        SDL_SetWindowTitle(v->window, title);
    draw_checker(v);
    draw_picture(v);
    hg_viewer_draw_measure(v);
    hg_viewer_draw_panel(v);
    hg_viewer_draw_text(v);
    SDL_RenderPresent(v->renderer);
    v->dirty = false;
}

// ---- the loop ----------------------------------------------------------------------------------

// What keys and sticks do while they are held. True: they are.
static bool move(struct hg_viewer *v)
{
    struct hg_navigate_wish wish = {0};
    const uint64_t now_ns = hg_clock_now_ns();
    const double seconds = (double)(now_ns - v->times.moved_ns) * 1e-9;
    v->times.moved_ns = now_ns;
    hg_controls_wish(&v->controls, SDL_GetModState() & KMOD_SHIFT, &wish);
    if (!hg_navigate_move(&v->navigate, &wish, seconds))
        return false;
    hg_viewer_send_camera(v);
    return true;
}

static bool play(struct hg_viewer *v)
{
    struct hg_viewer_clock *c = &v->clock;
    const uint64_t now_ns = hg_clock_now_ns();
    if (!c->plays || v->status.state != HG_VIEW_OPEN || v->scene->duration_s <= 0)
        return false;
    c->time_s += (double)(now_ns - c->before_ns) * 1e-9;
    c->before_ns = now_ns;
    while (c->time_s >= v->scene->duration_s)
        c->time_s -= v->scene->duration_s;
    hg_view_session_pose(v->session, c->time_s);
    return true;
}

static void tick(struct hg_viewer *v)
{
    const uint64_t now_ns = hg_clock_now_ns();
    measure(v);
    if (v->times.resized_ns && now_ns - v->times.resized_ns >= resize_ns) {
        v->times.resized_ns = 0;
        if (v->status.state == HG_VIEW_OPEN)
            hg_viewer_send_size(v);
    }
    if (v->times.message_until_ns && now_ns >= v->times.message_until_ns) {
        v->times.message_until_ns = 0;
        v->dirty = true;
    }
    hg_viewer_refresh_tree(v);
    v->quits |= hg_cli_is_stopped();
}

static void loop(struct hg_viewer *v)
{
    SDL_Event event;
    bool moving = false;
    while (!v->quits) {
        const int wait_ms = moving ? MOVING_MS : IDLE_MS;
        if (SDL_WaitEventTimeout(&event, wait_ms))
            do
                on_event(v, &event);
            while (SDL_PollEvent(&event));
        moving = move(v);
        moving |= play(v);
        tick(v);
        if (v->dirty)
            draw(v);
    }
}

// ---- the window --------------------------------------------------------------------------------

static void wake(void *user)
{
    struct hg_viewer *v = user;
    SDL_Event event = {.type = v->wake_event};
    SDL_PushEvent(&event); // a full queue wakes, too
}

static enum hg_status fail_sdl(struct hg_error *err)
{
    return hg_error_set(err, HG_E_DEVICE, "window", NULL, "cannot be opened: %s", SDL_GetError());
}

static enum hg_status open_window(struct hg_viewer *v, struct hg_error *err)
{
    const struct hg_cli_options *o = v->o;
    const int width = o->has_size ? (int)o->size.width : HGP_STANDARD_width;
    const int height = o->has_size ? (int)o->size.height : HGP_STANDARD_height;
    const Uint32 flags =
        SDL_WINDOW_RESIZABLE | (o->full_screen ? SDL_WINDOW_FULLSCREEN_DESKTOP : 0);
    struct hg_error font = {0};
    SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");
    if (SDL_Init(SDL_INIT_VIDEO | SDL_INIT_GAMECONTROLLER))
        return fail_sdl(err);
    // Without a display SDL may fall back to a driver that shows nothing: no user could close it.
    if (!SDL_getenv("SDL_VIDEODRIVER") && SDL_strcmp(SDL_GetCurrentVideoDriver(), "offscreen") == 0)
        return hg_error_set(err, HG_E_DEVICE, "window", NULL,
            "there is no display (neither DISPLAY nor WAYLAND_DISPLAY names one)");
    v->wake_event = SDL_RegisterEvents(1);
    v->window = SDL_CreateWindow(
        "helio view", SDL_WINDOWPOS_UNDEFINED, SDL_WINDOWPOS_UNDEFINED, width, height, flags);
    if (v->window)
        v->renderer = SDL_CreateRenderer(v->window, -1, 0);
    if (v->window && !v->renderer)
        v->renderer = SDL_CreateRenderer(v->window, -1, SDL_RENDERER_SOFTWARE);
    if (!v->renderer)
        return fail_sdl(err);
    SDL_EventState(SDL_DROPFILE, SDL_ENABLE);
    SDL_StopTextInput(); // keys are places, until something is searched for
    SDL_GetRendererOutputSize(v->renderer, &v->width, &v->height);
    if (hg_overlay_init(&v->overlay, v->renderer, FONT_PX, &font))
        fprintf(stderr, "helio: %s: %s\n", font.what, font.reason);
    return HG_OK;
}

static void close_window(struct hg_viewer *v)
{
    hg_controls_finish(&v->controls);
    hg_overlay_finish(&v->overlay);
    if (v->canvas.texture)
        SDL_DestroyTexture(v->canvas.texture);
    if (v->renderer)
        SDL_DestroyRenderer(v->renderer);
    if (v->window)
        SDL_DestroyWindow(v->window);
    SDL_Quit();
    hg_view_picture_finish(&v->picture);
    hg_warp_mesh_finish(&v->canvas.mesh);
    hg_tree_finish(&v->panels.tree);
    hg_free(v->measured.sent);
    hg_free(v->scene);
}

int hg_viewer_run(const struct hg_cli_options *options)
{
    struct hg_viewer v = {.o = options, .dirty = true, .times.moved_ns = hg_clock_now_ns()};
    struct hg_error err = {0};
    v.scene = hg_calloc(1, sizeof *v.scene);
    v.measured.sent = hg_calloc(HG_VIEWER_SENT_MAX, sizeof *v.measured.sent);
    enum hg_status status = v.scene && v.measured.sent ? open_window(&v, &err) : HG_E_NOMEM;
    if (!status)
        status = hg_view_session_create(options, wake, &v, &v.session, &err);
    if (!status)
        loop(&v);
    hg_view_session_destroy(v.session);
    // A scene that could not be opened, or was lost, is what the command ended with.
    const int code = status ? (int)hg_cli_report(NULL, HG_CLI_DOING_RENDER, &err)
                     : v.status.state == HG_VIEW_FAILED ? v.status.exit_code
                                                        : HG_CLI_EXIT_OK;
    close_window(&v);
    return code;
}
